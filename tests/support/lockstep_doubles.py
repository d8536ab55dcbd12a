"""Scripted lock-step on a bus in memory: participants that answer or stay silent, a simulator, a monitor, and a bus
that loses messages."""

import threading
from collections.abc import Callable, Sequence
from typing import Any

import msgspec
import numpy as np

from support.limits import LIMIT
from zteam import names
from zteam.bus import Bus, MemoryHub, NoRequest
from zteam.bus.memory import MemoryTransport
from zteam.bus.presence import own_info
from zteam.bus.transport import Closeable, Handle, RawSample, SampleHandler
from zteam.clock import to_ns, wait_until
from zteam.messages import Clock, Done, Input, TeamState, TeamStatus, Tick, Twist, time_from_ns
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import LockStepOptions
from zteam.node.shutdown import Stop
from zteam.simulator.client import SimStatus
from zteam.simulator.process.lockstep import LockStep

INTERVAL = to_ns(0.1)
"""Simulated nanoseconds of a tick."""
SHORT = 0.02
"""Host seconds of a repeat or time-out that a test waits for."""
LONG = 600.0
"""Host seconds of a time-out that no test reaches: an earlier end has another cause."""


class LossyTransport(MemoryTransport):
    """A session that loses the samples chosen by the test. Latched keys lose nothing."""

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
    """A session on the hub that does not receive a sample if `loses(key)`."""
    return Bus(LossyTransport(hub, loses))


def lose_first(key: str, count: int = 1) -> Callable[[str], bool]:
    """Lose the first `count` samples on `key`."""
    left = [count]

    def loses(sample_key: str) -> bool:
        lost = sample_key == key and left[0] > 0
        left[0] -= lost
        return lost

    return loses


class ScriptedParticipant:
    """A participant: it asks to join, and answers each tick that lists it while it is `awake`.

    It holds no lock while it publishes, so that tests may use it with threads on the synchronous bus.
    """

    def __init__(self, hub: MemoryHub, name: str, command: Twist | None = None, bus: Bus | None = None) -> None:
        self.name, self.command = name, command
        self.awake = True
        self.asks = True
        """Whether it asks to join."""
        self.blocked_by = ""
        """It does not answer while the participant of this name takes part."""
        self.heard: list[Tick] = []
        self.changed = threading.Condition()
        self.bus = bus or hub.bus()
        self._present = False
        self._busy = 0
        """Ticks that its handler is still working on."""
        self._done = self.bus.publisher(names.done_key(name), Done)
        self.bus.subscribe(names.TICK, Tick, self._on_tick)
        self.bus.serve(names.info_key(name), NoRequest, lambda _: own_info(name, self.bus.instance, 1))

    def appear(self) -> "ScriptedParticipant":
        """Declare the presence token."""
        self._present = True
        self._token = self.bus.declare_token(names.token_key(self.name, self.bus.instance))
        return self

    def vanish(self) -> None:
        """Lose the presence token, as a process that ends."""
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
        """Publish an answer, right or wrong."""
        self._done.put(done)

    def wait_until_heard(self, is_meant: Callable[[Tick], bool] = lambda _: True) -> None:
        """Wait until the newest tick that it has received is the one meant, and it has reacted to that."""
        with self.changed:
            is_done = wait_until(
                self.changed, lambda: self._busy == 0 and self.heard != [] and is_meant(self.heard[-1]), LIMIT
            )
            assert is_done, self.heard

    def wait_for_list(self, *participants: str) -> None:
        """Wait until the newest tick lists these participants."""
        self.wait_until_heard(lambda tick: tick.participants == [*participants])

    def wait_for_epoch(self, epoch: int) -> None:
        """Wait until the newest tick carries this epoch."""
        self.wait_until_heard(lambda tick: tick.epoch == epoch)

    @property
    def lists(self) -> list[list[str]]:
        """The participants of each tick that was received."""
        return [tick.participants for tick in self.heard]


def show_simulator(bus: Bus, lockstep: bool = True, robots: Sequence[int] = ()) -> Closeable:
    """Let a session hold the simulator's name and serve `sim/status`; the tokens go when the result is closed."""
    status = SimStatus("scripted", [*robots], INTERVAL, 1, 0, 0, 1.0, lockstep=lockstep, instance=bus.instance)
    bus.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: status)
    keys = [names.lockstep_key(bus.instance)] * lockstep + [names.token_key(names.SIMULATOR, bus.instance)]
    tokens = [bus.declare_token(key) for key in keys]
    return Handle(*(token.close for token in tokens))


class LockStepHarness:
    """The real `LockStep` with a scripted main loop: it opens ticks and waits for the answers."""

    def __init__(self, bus: Bus, options: LockStepOptions) -> None:
        self.stop = Stop()
        self.node = ProcessNode(names.SIMULATOR, bus, self.stop)
        self.answered: list[int] = []
        """Ids of the robots that sent commands."""
        self.resent: list[list[str]] = []
        """The participants of each repeat of the inputs."""
        self.on_resend: Callable[[], None] = lambda: None
        """Called once, at the next repeat of the inputs."""
        self.lockstep = LockStep(self.node, options, self.answered.append)
        show_simulator(bus, lockstep=False)
        self._thread = threading.Thread(target=self._wait)
        self._results: list[bool] = []
        self._returned = False
        self._looked = threading.Event()
        """Whether `LockStep.wait` has looked at the tick."""
        self._wait_for = self.lockstep._changed.wait_for
        self.lockstep._changed.wait_for = self._note_look  # type: ignore[method-assign]

    def _note_look(self, ready: Callable[[], bool], timeout: float | None = None) -> bool:
        self._looked.set()
        return self._wait_for(ready, timeout)

    def open(self, tick: int, *robots: int) -> None:
        """Open a tick."""
        self.lockstep.open(tick * INTERVAL, tick, [*robots])
        self.lockstep.send()

    def wait(self, limit: float = LIMIT) -> bool:
        """The result of `LockStep.wait`, which has to return within `limit` host seconds."""
        self.begin()
        return self.end(limit)

    def begin(self) -> None:
        """Call `LockStep.wait` in a thread."""
        self._returned = False
        self._looked.clear()
        self._thread = threading.Thread(target=self._wait)
        self._thread.start()

    def end(self, limit: float = LIMIT) -> bool:
        """The result of that call."""
        self._thread.join(limit)
        assert not self._thread.is_alive(), f"it waits for {self.lockstep.tick.waiting_for()}"
        return self._results[-1]

    @property
    def holds(self) -> bool:
        """Whether `LockStep.wait` waits, and nothing that has happened until now ends that."""
        assert self._looked.wait(LIMIT)
        return not self._returned and not self.lockstep.tick.is_over

    def _wait(self) -> None:
        self._results.append(self.lockstep.wait(self._resend))
        self._returned = True
        self._looked.set()

    def _resend(self, missing: list[str]) -> None:
        self.resent.append(missing)
        action, self.on_resend = self.on_resend, lambda: None
        action()

    def close(self) -> None:
        """Stop the node, which ends the wait."""
        self.stop.request("test over")
        if self._thread.ident is not None:
            self._thread.join(LIMIT)
        self.node.close()


class HarnessFactory:
    """Makes harnesses on a hub, and closes them all."""

    def __init__(self, hub: MemoryHub) -> None:
        self.hub = hub
        self._made: list[LockStepHarness] = []

    def __call__(
        self, *expected: str, bus: Bus | None = None, gate: bool = False, timeout: float = LONG
    ) -> LockStepHarness:
        self._made.append(LockStepHarness(bus or self.hub.bus(), LockStepOptions(expected, timeout, gate)))
        return self._made[-1]

    def close(self) -> None:
        """Close all harnesses."""
        for harness in self._made:
            harness.close()


def make_team(hub: MemoryHub, harness: LockStepHarness, *process_names: str) -> list[ScriptedParticipant]:
    """Let these processes join; they take part in tick 2, which is open on return."""
    participants = [ScriptedParticipant(hub, name).appear() for name in process_names]
    harness.open(1)
    assert harness.wait()
    harness.open(2)
    assert harness.lockstep.tick.members == sorted(process_names)
    return participants


class ScriptedSimulator:
    """A simulator without a world: its token, ticks and clock, and the answers of participant `name`."""

    def __init__(self, hub: MemoryHub, name: str) -> None:
        self.bus = hub.bus()
        self.answers: list[Done] = []
        self._ticks = self.bus.publisher(names.TICK, Tick)
        self._clock = self.bus.publisher(names.CLOCK, Clock)
        self.reads, self.sent = list[str](), 0
        """What the participant has said last that it reads, and how much it has sent in the tick."""
        self.bus.subscribe(names.done_key(name), Done, self._on_done)

    def _on_done(self, _key: str, done: Done) -> None:
        self.reads = done.reads or self.reads
        self.sent = done.sent
        self.answers.append(msgspec.structs.replace(done, reads=[], sent=0))

    def appear(self) -> None:
        """Declare the presence token of a simulator in lock-step."""
        self._token = show_simulator(self.bus)

    def vanish(self) -> None:
        """Lose the presence token."""
        self._token.close()

    def tick(
        self, tick: int, *participants: str, epoch: int = 1, robots: tuple[int, ...] = (), inputs: Sequence[Input] = ()
    ) -> None:
        """Publish a tick."""
        stamp, ids = time_from_ns(tick * INTERVAL), np.array(robots, np.int32)
        self._ticks.put(Tick(stamp, epoch, tick, ids, list(participants), inputs=list(inputs)))

    def tell(self, stamp: int) -> None:
        """Publish the clock."""
        self._clock.put(Clock(time_from_ns(stamp)))

    def take(self) -> list[Done]:
        """The answers since the last call."""
        taken, self.answers = self.answers, []
        return taken


class ScriptedMonitor:
    """A monitor that says what the test tells it, and gives GO when the test does."""

    def __init__(self, hub: MemoryHub) -> None:
        self._publisher = hub.bus().publisher(names.TEAM_STATUS, TeamStatus, latched=True)

    def give_go(self, epoch: int = 1, stamp: int = 0) -> None:
        """Publish GO under this epoch, from time `stamp` (ns) on."""
        self.say(TeamState.GO, epoch, stamp)

    def say(self, state: int, epoch: int = 1, stamp: int = 0) -> None:
        """Publish a state."""
        self._publisher.put(TeamStatus(state=state, epoch=epoch, go_stamp=time_from_ns(stamp)))


def lose(participant: ScriptedParticipant, harness: LockStepHarness) -> None:
    """Let it vanish, and wait until that is certain."""
    participant.vanish()
    lockstep = harness.lockstep
    with lockstep._changed:
        assert wait_until(lockstep._changed, lambda: participant.name not in lockstep.tick.members, LIMIT)
