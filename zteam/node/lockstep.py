"""A process's part in lock-step: whose ticks count, and the answer to each once its inputs are there."""

from collections import deque
from collections.abc import Callable, Sequence
from enum import Enum, auto
from itertools import count

import msgspec
import numpy as np

from zteam import names
from zteam.bus import NoRequest
from zteam.bus.transport import Closeable, RawSample
from zteam.clock import monotonic
from zteam.messages import Done, Input, Tick, Twist, ns_from_time
from zteam.messages.message import CDR
from zteam.node.process_node import ProcessNode
from zteam.node.screen import FROM_TICK, Screen
from zteam.node.tokens import CertainTokens

_WINDOW = 1000
"""Ticks that timing looks back."""
_STAND, _NOTHING = Twist(), list[str]()
"""In answers, which are not changed: no command, and nothing new to read."""


class Ticks:
    """Calls `on_tick(tick)` under `node.changed` for each tick of a simulator in lock-step, and for no other sender's.

    Any process can put a tick on the bus, and one is enough to stop a robot in real time: it would wait for the next.
    So only ticks count whose session holds the token of lock-step, which a simulator shows before that of its name.
    """

    def __init__(
        self, node: ProcessNode, on_tick: Callable[[Tick], None], on_end: Callable[[], None] = lambda: None
    ) -> None:
        """It receives ticks from `listen` on. `on_end()` is called, as `on_tick`, when the last token is lost."""
        self._node = node
        self._handle, self._on_end = on_tick, on_end
        self.simulators: set[str] = set()
        """The sessions that hold the token: the simulators in lock-step."""
        self._early: tuple[str, Tick] | None = None
        """The newest tick of a session without the token, which may be on its way, and that session."""
        self._input: Closeable | None = None
        CertainTokens(node.bus, names.lockstep_key("*"), node.handler(self._on_token))

    def listen(self) -> None:
        """Receive ticks; nothing if they are received already."""
        if self._input is None:
            self._input = self._node.bus.subscribe_from(
                names.TICK, Tick, self._node.handler(self._on_tick), screened=False
            )

    def deafen(self) -> None:
        """Receive no ticks until `listen`."""
        if self._input is not None:
            self._input.close()
            self._input = None

    def _on_token(self, key: str, alive: bool) -> None:
        session = key.rpartition("/")[2]
        if not alive:
            self.simulators.discard(session)
            if not self.simulators:
                # The next simulator may not work in lock-step.
                self._node.take_time_from_clock()
                self.listen()
                self._on_end()
            return
        self.simulators.add(session)
        if self._early is not None and self._early[0] == session:
            (_, tick), self._early = self._early, None
            self._handle(tick)

    def _on_tick(self, _key: str, tick: Tick, source: str) -> None:
        if source in self.simulators:
            self._handle(tick)
            return
        if self._early is not None:
            self._node.bus.counters.drop(names.TICK, "no simulator in lock-step sent it, so it does not count")
        self._early = source, tick


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


class TickState(Enum):
    """What a participant has made of the newest tick.

    A new tick is UNLISTED or OPEN. OPEN becomes ACTING, and ACTING becomes ANSWERED; a tick that comes once more after
    that is ANSWERED at once. All become NONE with the end of the simulator.
    """

    NONE = auto()
    """There is no simulator in lock-step."""
    UNLISTED = auto()
    """It does not list the participant, which asks to be let in."""
    OPEN = auto()
    """It waits for this process's step."""
    ACTING = auto()
    """The step is under way."""
    ANSWERED = auto()


class Participant:
    """A process's part in the ticks: the open one waits for `begin`, once its inputs are there, and `answer` ends it.
    Without a simulator in lock-step it does nothing. The protocol in words: docs/time.md.

    All is called under `node.changed`.
    """

    robots: frozenset[int] = frozenset()
    """In the world at the newest tick; another set when they are others."""
    _world: Sequence[int] = ()
    """As the newest tick lists them."""
    team: tuple[int, ...] = ()
    """The robots whose processes took part when the newest tick was opened, ascending: the same for all of them, also
    if one ends in the middle of the tick. Another tuple when another process takes part, be it of the same robot."""
    _listed: Sequence[str] = ()
    """The participants at the time of `team`."""
    tick: Tick | None = None
    """The newest tick; None without a simulator in lock-step."""
    state = TickState.NONE
    _heard = _begun = 0.0
    """When it came and when its step began, in host time."""
    stamp = 0
    """Of the newest tick, in ns."""
    _catches_up = False
    """Whether it waits for latched messages before it asks to be let in."""
    gives_away = False
    """Whether the commands may be handed over: they have plain finite numbers and do not change."""

    def __init__(
        self,
        node: ProcessNode,
        on_listed: Callable[[], object] = lambda: None,
        on_refused: Callable[[str], object] = lambda _: None,
    ) -> None:
        """`on_listed()` is called when a tick lists this process for the first time, or again; `on_refused(key)` for a
        message from outside that was dropped while the open tick waits for inputs."""
        self._node, self._on_listed, self._on_refused = node, on_listed, on_refused
        self.repeat: Callable[[], None] = lambda: None
        """Sends what was sent for the last tick once more, because a subscriber may lack it."""
        self._answer = Done()
        self._sent_before = 0
        """How many messages of ticks the process had sent before this tick (`Bus.in_ticks`)."""
        self.is_early = False
        """Whether what it publishes between an answer and the next tick belongs to that tick."""
        self._told_reads = -1
        """The version of what this process reads (`Bus.reads`) that it has told."""
        self._number = 0
        """Of the newest input that was taken."""
        self.changes: dict[str, Callable[[bytes], object]] = {}
        """What a request that a tick carries changes in this process, by its key."""
        self._asked: list[Input] = []
        """The requests that were handed on, and that no tick has carried yet."""
        self._asked_numbers = count(1)
        self._inputs: deque[float] = deque(maxlen=_WINDOW)
        self._acts: deque[float] = deque(maxlen=_WINDOW)
        node.bus.serve(names.service_key(node.name, "timing"), NoRequest, lambda _: self._timing())
        self._done = node.bus.publisher(names.done_key(node.name), Done)
        # In this order: that a simulator is in lock-step is known before it is known that there is one.
        self.ticks = Ticks(node, self._on_tick, self._forget)
        self.screen = Screen(node.bus.counters, node.lock, self.ticks.simulators)
        node.follow_clock()
        self.ticks.listen()

    @property
    def expected(self) -> bool:
        """Whether this is lock-step, or is going to be: then nothing may be done at other times than those of ticks."""
        return self.tick is not None or bool(self.ticks.simulators)

    def begin(self) -> None:
        """The step of the open tick begins, whose last input has come."""
        self.state, self._begun = TickState.ACTING, monotonic()

    def answer(self, tick: Tick, command: Twist | None) -> None:
        """Answer the tick whose step has begun, a robot with its command."""
        sent = self._node.bus.in_ticks.sent - self._sent_before
        self._answer = Done(
            tick.epoch, tick.tick, command is not None, command or _STAND, sent, self._news(), [*self._asked]
        )
        (self._done.put_owned if command is None or self.gives_away else self._done.put)(self._answer)
        self._sent_before = self._node.bus.in_ticks.sent
        self.state = TickState.ANSWERED
        self._inputs.append(self._begun - self._heard)
        self._acts.append(monotonic() - self._begun)

    def hand_on(self, key: str, request: bytes) -> None:
        """Let the next tick carry a query's request, which changes this process then."""
        self._asked.append(Input(next(self._asked_numbers), key, Input.REQUEST, np.frombuffer(request, np.uint8)))
        if self.state is TickState.ANSWERED:
            # The world may stand still.
            self._done.put(msgspec.structs.replace(self._answer, inputs=[*self._asked]))

    def _news(self) -> list[str]:
        """What this process reads, if that has changed since it was told."""
        bus = self._node.bus
        if self._told_reads == bus.reads_version:
            return _NOTHING
        self._told_reads = bus.reads_version
        return bus.reads()

    def _timing(self) -> RoundTiming:
        ticks = max(1, len(self._acts))
        return RoundTiming(len(self._acts), 1e3 * sum(self._inputs) / ticks, 1e3 * sum(self._acts) / ticks)

    def _on_tick(self, tick: Tick) -> None:
        if not self._node.can_publish:
            # Another process may hold the name: it is heard again as soon as the name is won.
            return
        before, self.tick, sent = self.tick, tick, self._node.bus.in_ticks.sent
        state, is_listed = self.state, self._node.name in tick.participants
        # No step begins before all that the tick brings is taken.
        self.state = TickState.UNLISTED
        if before is None:
            self._node.take_time_from_ticks()
        elif tick.tick < before.tick:
            # The world begins anew.
            self._number = self.stamp = 0
        stamp = ns_from_time(tick.stamp)
        self._node.set_time(stamp)
        if is_listed:
            if state in (TickState.NONE, TickState.UNLISTED):
                self._on_listed()
            if tick.inputs:
                # They count as sent in the tick before.
                self._take_inputs(tick)
        self.stamp = stamp
        if (robots := tick.robots.tolist()) != self._world:
            self._world, self.robots = robots, frozenset(robots)
        # Without sessions it is that of an older simulator.
        refused = self.screen.open(tick.sessions if tick.sessions or not tick.participants else None)
        if not is_listed:
            if not self._catches_up:
                self._catches_up = True
                self._node.bus.transport.when_caught_up(self._node.handler(self._ask_to_join))
            return
        was_open = state is TickState.OPEN
        seen = before if before is not None and was_open else self._answer
        is_new = (tick.epoch, tick.tick) != (seen.epoch, seen.tick)
        if tick.participants != self._listed:
            # What leaves during a tick may be back in the next one, as another process.
            self._listed = tick.participants if is_new else ()
            if is_new:
                ids = map(names.robot_id_of, tick.participants)
                self.team = tuple(sorted(i for i in ids if i is not None))
        if is_new or was_open:
            self.state, self._heard = TickState.OPEN, monotonic()
            if is_new and not self.is_early:
                # What was published since the last answer belongs to no step.
                self._sent_before = sent
            for key in () if is_new else refused:
                self._on_refused(key)
        else:
            self.state = TickState.ANSWERED
            count = self._node.bus.in_ticks
            sent = count.sent
            self.repeat()
            # First sendings alone are counted.
            count.sent = sent
            self._done.put(self._answer)

    def _ask_to_join(self) -> None:
        """Ask to be let in, now that the latched messages have come. It is no answer: once the process is listed, this
        tick may come again."""
        self._catches_up = False
        if (tick := self.tick) is not None and self.state is TickState.UNLISTED:
            self._told_reads = -1
            self._done.put(Done(tick.epoch, tick.tick, reads=self._news(), inputs=[*self._asked]))

    def _take_inputs(self, tick: Tick) -> None:
        """Hand what the tick carries to its subscriptions; what has come before comes again for those that join."""
        for each in tick.inputs:
            if each.number <= self._number:
                continue
            data = each.data.tobytes()
            if each.type == Input.REQUEST:
                if (change := self.changes.get(each.key)) is None:
                    continue
                mine = (asked for asked in self._asked if (asked.key, asked.data.tobytes()) == (each.key, data))
                if (carried := next(mine, None)) is not None:
                    self._asked.remove(carried)
                change(data)
            else:
                encoding = CDR + each.type if each.type else ""
                self._node.bus.hand_in(RawSample(each.key, data, encoding, source=FROM_TICK))
        self._number = max(each.number for each in tick.inputs)

    def _forget(self) -> None:
        self.tick = None
        self.state = TickState.NONE
        self._answer, self._number = Done(), 0
        self.screen.forget()
        asked, self._asked = self._asked, []
        for each in asked:
            self.changes[each.key](each.data.tobytes())
        self._node.wake()
