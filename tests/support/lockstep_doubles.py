"""Lock-step by script on a bus in memory: participants that answer or not, a bus that loses messages, a log to read."""

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from zteam import names
from zteam.bus import Bus, MemoryHub, NoRequest
from zteam.bus.memory import MemoryTransport
from zteam.bus.transport import Closeable, RawSample, SampleHandler
from zteam.clock import to_ns, wait_until
from zteam.messages import Clock, Done, TeamState, TeamStatus, Tick, Twist, time_from_ns
from zteam.nodes.simulator.lockstep import LockStep, LockStepOptions
from zteam.runtime.node import Node
from zteam.runtime.shutdown import Stop
from zteam.services.simulator import SimStatus

LIMIT = 20.0
"""Host seconds after which a wait has failed."""
INTERVAL = to_ns(0.1)
"""A tick of the scripts, in simulated ns."""
SHORT = 0.02
"""Host seconds of what a test wants to see happen."""
LONG = 600.0
"""Host seconds that no test lives to see: what ends before was not ended by a time-out."""


class LossyTransport(MemoryTransport):
    """A session that does not hear what the test says it loses; latched keys lose nothing."""

    def __init__(self, hub: MemoryHub, loses: Callable[[str], bool]) -> None:
        super().__init__(hub)
        self._loses = loses

    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, *rest: Any, **more: Any
    ) -> Closeable:
        def hear(sample: RawSample) -> None:
            if latched or not self._loses(sample.key):
                handler(sample)

        return super().declare_subscriber(key_expr, hear, latched, *rest, **more)


def lossy_bus(hub: MemoryHub, loses: Callable[[str], bool]) -> Bus:
    """A session on the hub that does not hear a sample if `loses(key)`."""
    return Bus(LossyTransport(hub, loses))


def lose_first(key: str, count: int = 1) -> Callable[[str], bool]:
    """Lose the first `count` samples on `key`."""
    left = [count]

    def loses(sample_key: str) -> bool:
        lost = sample_key == key and left[0] > 0
        left[0] -= lost
        return lost

    return loses


class Player:
    """A participant: asks to be let in, and answers what it is listed in as long as it is `awake`.

    It holds no lock while it speaks, so that it may be used with threads on the synchronous bus.
    """

    def __init__(self, hub: MemoryHub, name: str, command: Twist | None = None, bus: Bus | None = None) -> None:
        self.name, self.command = name, command
        self.awake = True
        self.asks = True
        """Whether it asks to be let in."""
        self.blocked_by = ""
        """It does not answer while this one takes part."""
        self.heard: list[Tick] = []
        self.changed = threading.Condition()
        self._bus = bus or hub.bus()
        self._present = False
        self._busy = 0
        """Ticks that it is about to answer."""
        self._done = self._bus.publisher(names.done_key(name), Done)
        self._bus.subscribe(names.TICK, Tick, self._on_tick)

    def appear(self) -> "Player":
        """Show the presence token."""
        self._present = True
        self._token = self._bus.declare_token(names.token_key(self.name, self._bus.instance))
        return self

    def vanish(self) -> None:
        """The process dies."""
        self._present = False
        self._token.close()

    def _on_tick(self, _key: str, tick: Tick) -> None:
        with self.changed:
            self.heard.append(tick)
            self._busy += 1
        listed = tick.participants
        if self._present and self.name not in listed and self.asks:
            self.say(Done(tick.epoch, tick.tick))
        elif self._present and self.name in listed and self.awake and self.blocked_by not in listed:
            self.answer()
        with self.changed:
            self._busy -= 1
            self.changed.notify_all()

    def answer(self) -> None:
        """Answer the newest tick."""
        tick = self.heard[-1]
        self.say(Done(tick.epoch, tick.tick, self.command is not None, self.command or Twist()))

    def say(self, done: Done) -> None:
        """Put an answer, right or wrong."""
        self._done.put(done)

    def wait_until_heard(self) -> None:
        """Wait until it has heard a tick, and said what it has to say to that."""
        with self.changed:
            assert wait_until(self.changed, lambda: self._busy == 0 and self.heard != [], LIMIT)

    def wait_for_list(self, *participants: str) -> None:
        """Wait until the newest tick has these participants, and what it has to say to that is said."""
        with self.changed:
            assert wait_until(self.changed, lambda: self._busy == 0 and self.lists[-1:] == [[*participants]], LIMIT), (
                self.heard
            )

    def wait_for_epoch(self, epoch: int) -> None:
        """Wait until the newest tick is under this GO."""
        with self.changed:
            assert wait_until(self.changed, lambda: self._busy == 0 and self.heard[-1].epoch == epoch, LIMIT), (
                self.heard
            )

    @property
    def lists(self) -> list[list[str]]:
        """The participants of each tick that was heard."""
        return [tick.participants for tick in self.heard]


def show_simulator(bus: Bus, lockstep: bool = True) -> Closeable:
    """Have a session hold the simulator's token, and answer whether it works in lock-step; the token."""
    status = SimStatus("scripted", [], INTERVAL, 1, 0, 0, 1.0, lockstep=lockstep)
    bus.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: status)
    return bus.declare_token(names.token_key(names.SIMULATOR, bus.instance))


class World:
    """Opens ticks and waits for the answers; it has no robots and no time of its own."""

    def __init__(self, bus: Bus, options: LockStepOptions) -> None:
        self.stop = Stop()
        self.node = Node(names.SIMULATOR, bus, self.stop)
        self.answered: list[int] = []
        """Robots whose commands came."""
        self.resent: list[list[str]] = []
        """To whom inputs were sent again."""
        self.on_resend: Callable[[], None] = lambda: None
        """What happens the next time inputs are sent again."""
        self.step = LockStep(self.node, options, self.answered.append)
        show_simulator(bus)
        self._thread = threading.Thread(target=self._wait)
        self._results: list[bool] = []

    def open(self, tick: int, *robots: int) -> None:
        """Send a tick."""
        self.step.open(tick * INTERVAL, tick, [*robots])

    def wait(self, limit: float = LIMIT) -> bool:
        """What `LockStep.wait` says, which has to end by itself."""
        self.begin()
        return self.end(limit)

    def begin(self) -> None:
        """Wait in a thread."""
        self._thread = threading.Thread(target=self._wait)
        self._thread.start()

    def end(self, limit: float = LIMIT) -> bool:
        """What that came to."""
        self._thread.join(limit)
        assert not self._thread.is_alive(), f"it waits for {self.step.waiting_for()}"
        return self._results[-1]

    @property
    def holds(self) -> bool:
        """Whether it still waits."""
        return self._thread.is_alive()

    def _wait(self) -> None:
        self._results.append(self.step.wait(self._resend))

    def _resend(self, missing: list[str]) -> None:
        self.resent.append(missing)
        action, self.on_resend = self.on_resend, lambda: None
        action()

    def close(self) -> None:
        """End whatever it waits for."""
        self.stop.request("test over")
        if self._thread.ident is not None:
            self._thread.join(LIMIT)
        self.node.close()


class Worlds:
    """Makes worlds on a hub, and ends them all."""

    def __init__(self, hub: MemoryHub) -> None:
        self.hub = hub
        self._made: list[World] = []

    def __call__(self, *expected: str, bus: Bus | None = None, gate: bool = False, timeout: float = LONG) -> World:
        self._made.append(World(bus or self.hub.bus(), LockStepOptions(expected, timeout, gate)))
        return self._made[-1]

    def close(self) -> None:
        """End whatever they wait for."""
        for world in self._made:
            world.close()


def make_team(hub: MemoryHub, world: World, *who: str) -> list[Player]:
    """These take part from tick 2 on, which is open."""
    players = [Player(hub, name).appear() for name in who]
    world.open(1)
    assert world.wait()
    world.open(2)
    assert world.step.participants == sorted(who)
    return players


class Script:
    """A simulator by script: its token, ticks and clock; what `name` answers it."""

    def __init__(self, hub: MemoryHub, name: str) -> None:
        self.bus = hub.bus()
        self.answers: list[Done] = []
        self._ticks = self.bus.publisher(names.TICK, Tick)
        self._clock = self.bus.publisher(names.CLOCK, Clock)
        self.bus.subscribe(names.done_key(name), Done, lambda _key, done: self.answers.append(done))

    def appear(self) -> None:
        """Show the token of a simulator in lock-step."""
        self._token = show_simulator(self.bus)

    def vanish(self) -> None:
        """Lose it."""
        self._token.close()

    def tick(self, tick: int, *participants: str, epoch: int = 1, robots: tuple[int, ...] = ()) -> None:
        """Send a tick."""
        stamp = time_from_ns(tick * INTERVAL)
        self._ticks.put(Tick(stamp, epoch, tick, np.array(robots, np.int32), list(participants)))

    def tell(self, stamp: int) -> None:
        """Send the clock."""
        self._clock.put(Clock(time_from_ns(stamp)))

    def take(self) -> list[Done]:
        """The answers since the last call."""
        taken, self.answers = self.answers, []
        return taken


class GateKeeper:
    """A monitor by script."""

    def __init__(self, hub: MemoryHub) -> None:
        self._publisher = hub.bus().publisher(names.TEAM_STATUS, TeamStatus, latched=True)

    def give_go(self, epoch: int = 1) -> None:
        """GO."""
        self._publisher.put(TeamStatus(state=TeamState.GO, epoch=epoch))


class Log(logging.Handler):
    """Lines that zteam logs, whatever a command has done to its loggers."""

    def __init__(self) -> None:
        super().__init__()
        self.changed = threading.Condition()
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        with self.changed:
            self.lines.append(record.getMessage())
            self.changed.notify_all()

    def wait_for(self, text: str) -> None:
        """Wait for a line with this in it."""
        with self.changed:
            assert wait_until(self.changed, lambda: self.count(text) > 0, LIMIT), self.lines

    def count(self, text: str) -> int:
        """How many lines have this in them."""
        return sum(text in line for line in self.lines)


@contextmanager
def listening() -> Iterator[Log]:
    """What is logged meanwhile, from information upwards."""
    handler, root = Log(), logging.getLogger("zteam")
    level = root.level
    root.setLevel(logging.INFO)
    root.addHandler(handler)
    try:
        yield handler
    finally:
        root.removeHandler(handler)
        root.setLevel(level)
