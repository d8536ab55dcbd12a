"""The clock of a tool, and moments at a rate of it, on a bus in memory."""

import io
import json
import sys
import threading
from collections.abc import Callable

import pytest

from support.limits import LIMIT
from zteam import clock as clock_module
from zteam import names
from zteam.bus import Bus, MemoryHub, NoRequest
from zteam.cli import tool_clock, topic
from zteam.clock import to_ns, wait_until
from zteam.errors import QueryTimeoutError
from zteam.messages import Bool, Clock, time_from_ns
from zteam.node.process_node import ClockMode
from zteam.simulator.client import SimStatus


class Simulator:
    """A simulator reduced to its clock: it publishes ticks and answers `sim/status`."""

    def __init__(self, hub: MemoryHub, now: float) -> None:
        self._bus = hub.bus()
        self._now = now
        self._clock = self._bus.publisher(names.CLOCK, Clock)
        self._bus.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: self._status())

    def _status(self) -> SimStatus:
        return SimStatus("scripted", [0], to_ns(0.1), 1, to_ns(self._now), round(self._now / 0.1), 1.0)

    def go_to(self, now: float) -> None:
        """A tick at `now` (s)."""
        self._now = now
        self._clock.put(Clock(time_from_ns(to_ns(now))))


@pytest.mark.parametrize("mode", ["auto", "sim"])
def test_with_a_simulator_the_clock_starts_at_its_time(mode: ClockMode) -> None:
    """A tool has simulated time at once, without a tick: the world may be paused."""
    hub = MemoryHub()
    Simulator(hub, 12.3)
    clock = tool_clock.open_clock(hub.bus(), mode)
    assert (clock.simulated, clock.now()) == (True, to_ns(12.3))


def test_the_clock_follows_the_simulators_ticks() -> None:
    """A tick sets the time of an open clock."""
    hub = MemoryHub()
    simulator = Simulator(hub, 12.3)
    clock = tool_clock.open_clock(hub.bus(), "auto")
    simulator.go_to(12.4)
    assert clock.now() == to_ns(12.4)


def test_without_a_simulator_the_clock_is_the_hosts() -> None:
    """The clock stays the host's even if a simulator starts later."""
    hub = MemoryHub()
    clock = tool_clock.open_clock(hub.bus(), "auto")
    Simulator(hub, 0.0).go_to(0.1)
    assert (clock.decided, clock.simulated) == (True, False)
    assert clock.now() > to_ns(1e9)


def test_the_hosts_clock_can_be_chosen() -> None:
    """`--clock wall` uses the host's time although a simulator runs."""
    hub = MemoryHub()
    Simulator(hub, 12.3)
    assert not tool_clock.open_clock(hub.bus(), "wall").simulated


def test_a_simulator_that_does_not_answer_counts() -> None:
    """With a busy or frozen simulator the clock is simulated time, not the host's."""
    hub = MemoryHub()

    def refuse(_request: NoRequest) -> None:
        raise QueryTimeoutError("a key: no answer in time", "no answer in time")

    hub.bus().serve(names.service_key(names.SIMULATOR, "status"), NoRequest, refuse)
    assert tool_clock.open_clock(hub.bus(), "auto").simulated


def test_simulated_time_can_be_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """With `--clock sim` and no simulator yet, the clock opens at the first tick."""
    hub, found, asked = MemoryHub(), [], threading.Event()

    def find_no_simulator(_bus: Bus) -> None:
        asked.set()

    monkeypatch.setattr(tool_clock, "ask_time", find_no_simulator)
    thread = threading.Thread(target=lambda: found.append(tool_clock.open_clock(hub.bus(), "sim")))
    thread.start()
    assert asked.wait(LIMIT)
    assert found == []
    Simulator(hub, 0.0).go_to(0.1)
    thread.join(LIMIT)
    assert (found[0].simulated, found[0].now()) == (True, to_ns(0.1))


class Publishing:
    """Runs `zteam topic pub` in a thread and counts the messages that arrive."""

    def __init__(self, hub: MemoryHub, monkeypatch: pytest.MonkeyPatch, *words: str) -> None:
        self.changed = threading.Condition()
        self.count = 0
        self.exit_code: int | None = None
        hub.bus().subscribe("flag", Bool, lambda _key, _message: self._notify(1))
        monkeypatch.setattr(topic, "open_bus", lambda _options: hub.bus())
        self._words = ["pub", "flag", "Bool", "{data: true}", *words]
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        self.exit_code = topic.main(self._words)
        self._notify(0)

    def _notify(self, more: int) -> None:
        with self.changed:
            self.count += more
            self.changed.notify_all()

    def wait(self, ready: Callable[[], bool]) -> None:
        """Wait until `ready()`; fail after LIMIT."""
        with self.changed:
            assert wait_until(self.changed, ready, LIMIT)


class WatchedOutput(io.StringIO):
    """An output stream that a test can wait for."""

    def __init__(self) -> None:
        super().__init__()
        self._changed = threading.Condition()

    def write(self, text: str) -> int:
        with self._changed:
            self._changed.notify_all()
            return super().write(text)

    def wait_for(self, text: str) -> None:
        """Wait until `text` was written; fail after LIMIT."""
        with self._changed:
            assert wait_until(self._changed, lambda: text in self.getvalue(), LIMIT)


def test_messages_are_published_in_simulated_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first message is sent at once, the others at the ticks of their moments, and none while time stands still."""
    monkeypatch.setattr(clock_module, "STILL", 0.01)
    hub, stderr = MemoryHub(), WatchedOutput()
    monkeypatch.setattr(sys, "stderr", stderr)
    simulator = Simulator(hub, 5.0)
    publishing = Publishing(hub, monkeypatch, "--rate", "5", "--times", "4")
    publishing.wait(lambda: publishing.count == 1)
    stderr.wait_for("time stands still at 5.000 s: see 'zteam sim status' (--clock wall uses the host's time)")
    for tick, count in ((5.1, 1), (5.2, 2), (5.3, 2), (5.4, 3), (5.5, 3)):
        simulator.go_to(tick)
        publishing.wait(lambda least=count: publishing.count == least)  # type: ignore[misc]
    assert publishing.exit_code is None
    simulator.go_to(5.6)
    publishing.wait(lambda: publishing.exit_code == 0)
    assert publishing.count == 4
    assert stderr.getvalue().count("stands still") == 1


@pytest.mark.parametrize("words", [(), ("--clock", "wall")])
def test_messages_are_published_in_the_hosts_time(words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a simulator, or with `--clock wall` beside one that stands still, messages are sent at the rate."""
    hub = MemoryHub()
    if words:
        Simulator(hub, 5.0)
    publishing = Publishing(hub, monkeypatch, "--rate", "1000", "--times", "5", *words)
    publishing.wait(lambda: publishing.exit_code == 0)
    assert publishing.count == 5


def test_one_message_needs_no_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """`--once` publishes without opening a clock."""

    def fail(*_: object) -> None:
        raise AssertionError

    hub = MemoryHub()
    monkeypatch.setattr(topic, "open_clock", fail)
    once = Publishing(hub, monkeypatch, "--once")
    once.wait(lambda: once.exit_code == 0)
    assert once.count == 1


@pytest.mark.few(1)
@pytest.mark.parametrize(
    ("words", "simulated", "rate"),
    [((), False, None), (("--clock", "sim"), True, 10.0), (("--clock", "auto"), True, 10.0)],
)
def test_hz_names_its_clock(
    words: tuple[str, ...],
    simulated: bool,
    rate: float | None,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """`zteam topic hz` measures in the host's time by default; in simulated time its rate is exact."""
    hub = MemoryHub()
    simulator, sender = Simulator(hub, 5.0), hub.bus().publisher("flag", Bool)
    subscribed = threading.Event()

    class SignallingBus(Bus):
        """Sets an event when a subscriber is declared."""

        def subscribe_raw(self, *args: object, **options: object) -> object:  # type: ignore[override]
            handle = super().subscribe_raw(*args, **options)  # type: ignore[arg-type]
            subscribed.set()
            return handle

    monkeypatch.setattr(topic, "open_bus", lambda _options: SignallingBus(hub.bus().transport))
    thread = threading.Thread(target=lambda: topic.main(["hz", "flag", "--once", "--json", *words]))
    thread.start()
    assert subscribed.wait(LIMIT)
    # The simulator is reset on the way: earlier stamps do not count.
    for tick in (50, 51, 52, 1, 2, 3, 4):
        simulator.go_to(tick / 10)
        sender.put(Bool(True))
    thread.join(LIMIT)
    measured = json.loads(capsys.readouterr().out)
    assert measured["clock"] == ("sim" if simulated else "wall")
    if rate is not None:
        assert measured["rate"] == pytest.approx(rate)
        assert measured["window"] == 4
