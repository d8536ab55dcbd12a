"""A process's part in lock-step: it answers every tick it is listed in, once its inputs of that tick are there.

The same for every process: the robot, the aggregator, a user's own node. Without a simulator in lock-step it does
nothing. The protocol in words: docs/time.md.
"""

import logging
from collections import deque
from collections.abc import Callable

import msgspec

from zteam import names
from zteam.bus import NoRequest
from zteam.clock import monotonic
from zteam.messages import Done, Tick, Twist, ns_from_time
from zteam.runtime.node import Node
from zteam.runtime.ticks import Ticks

log = logging.getLogger("zteam")

_WINDOW = 1000
"""Ticks that timing looks back."""
TICKLESS = 2.0
"""Host seconds of newer and newer data without a tick after which this is real time."""


class RoundTiming(msgspec.Struct):
    """Answer to `<name>/timing`: milliseconds of the host a tick, on average over the newest ticks."""

    ticks: int
    inputs: float
    """From the tick's arrival until all its inputs were there."""
    act: float
    """The tick's work and the sending of the answer."""


class Lacking(msgspec.Struct):
    """Answer to `<name>/lacking`: the keys whose message of the open tick has not come."""

    keys: list[str]


class Participant:
    """Answers ticks for `node`. Callbacks run under `node.changed`, on the bus's threads: no thread is woken to act."""

    def __init__(
        self,
        node: Node,
        ready: Callable[[Tick], bool],
        act: Callable[[Tick], Twist | None],
        repeat: Callable[[], None] = lambda: None,
        lacks: Callable[[Tick], list[str]] = lambda tick: [],
    ) -> None:
        """`ready(tick)`: whether the inputs of that tick are there. `act(tick)`: do the tick's work; a robot's command
        comes back. `repeat()`: send what was sent for the last tick once more, because a subscriber may lack it.
        `lacks(tick)`: the keys whose message of that tick has not come; asked without the lock, for the log.
        """
        self._node = node
        self._ready = ready
        self._act = act
        self._repeat = repeat
        self._lacks = lacks
        self.robots: frozenset[int] = frozenset()
        """In the world at the newest tick."""
        self._robots_seen = b""
        self.tick: Tick | None = None
        """The newest tick; None without a simulator in lock-step."""
        self._open: Tick | None = None
        """To be answered."""
        self._answer = Done()
        self._heard = 0.0
        self._stamp = 0
        """Of the newest tick, in ns."""
        self._ahead: tuple[float, int] | None = None
        """Host time and stamp of the first data that is newer than the newest tick."""
        self._inputs: deque[float] = deque(maxlen=_WINDOW)
        self._acts: deque[float] = deque(maxlen=_WINDOW)
        node.bus.serve(names.service_key(node.name, "timing"), NoRequest, lambda _: self._timing())
        node.bus.serve(names.service_key(node.name, names.LACKING), NoRequest, lambda _: self._lacking())
        self._done = node.bus.publisher(names.done_key(node.name), Done)
        node.follow_clock()
        node.on_simulator_lost(self._forget)
        self._ticks = Ticks(node, self._on_tick)

    @property
    def active(self) -> bool:
        """Whether this is lock-step."""
        return self.tick is not None

    def advance(self) -> bool:
        """Answer the open tick if its last input has come; return whether it did. Call it under `node.changed`."""
        tick = self._open
        if tick is None or not self._node.speaks or not self._ready(tick):
            return False
        self._open = None
        begin = monotonic()
        with self._node.failing():
            command = self._act(tick)
            self._answer = Done(tick.epoch, tick.tick, command is not None, command or Twist())
            self._done.put(self._answer)
        self._inputs.append(begin - self._heard)
        self._acts.append(monotonic() - begin)
        return True

    def take_stamp(self, stamp: int) -> None:
        """Data of the simulator of time `stamp` (ns) has come (call it under `node.changed`).

        Its tick follows within moments. Data that goes on without ticks is of a simulator in real time.
        """
        if self.tick is None or stamp <= self._stamp:
            return
        if self._ahead is None:
            self._ahead = monotonic(), stamp
        elif stamp > self._ahead[1] and monotonic() - self._ahead[0] > TICKLESS:
            log.warning("data goes on without a tick for %g s: not in lock-step any more", TICKLESS)
            self._forget()
            self._node.take_time_from_clock()
            self._ticks.doubt()
            self._node.wake()

    def _timing(self) -> RoundTiming:
        count = max(1, len(self._acts))
        return RoundTiming(len(self._acts), 1e3 * sum(self._inputs) / count, 1e3 * sum(self._acts) / count)

    def _lacking(self) -> Lacking:
        tick = self._open
        return Lacking([] if tick is None else self._lacks(tick))

    def _on_tick(self, tick: Tick) -> None:
        if not self._node.speaks:
            # Another process may hold the name: it is heard again as soon as the name is won.
            return
        if self.tick is None:
            self._node.take_time_from_ticks()
        self.tick, self._stamp, self._ahead = tick, ns_from_time(tick.stamp), None
        seen = tick.robots.tobytes()
        if seen != self._robots_seen:
            self._robots_seen, self.robots = seen, frozenset(tick.robots.tolist())
        self._node.set_time(self._stamp)
        if self._node.name not in tick.participants:
            # Asks to be let in. It is no answer: once it is listed, this tick may come again.
            self._open = None
            self._done.put(Done(tick.epoch, tick.tick))
        elif (tick.epoch, tick.tick) == (self._answer.epoch, self._answer.tick) and self._open is None:
            self._repeat()
            self._done.put(self._answer)
        else:
            self._open = tick
            self._heard = monotonic()
            self.advance()

    def _forget(self) -> None:
        self.tick = self._open = self._ahead = None
        self._answer = Done()
