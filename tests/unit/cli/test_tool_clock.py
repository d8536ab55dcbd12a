"""The clock of a tool, and moments at a rate of it, on a bus in memory."""

import json
import threading

import pytest

from support.commands import Run, run_here
from support.limits import LIMIT
from support.transports import wait_until_true
from zteam import clock as clock_module
from zteam import names
from zteam.bus import Bus, MemoryHub, NoRequest
from zteam.cli import listening, tool_clock, topic
from zteam.clock import to_ns
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
def test_with_a_simulator_the_clock_follows_it(hub: MemoryHub, mode: ClockMode) -> None:
    """A tool has simulated time at once, without a tick: the world may be paused. A tick sets it."""
    simulator = Simulator(hub, 12.3)
    clock = tool_clock.open_clock(hub.bus(), mode)
    assert (clock.simulated, clock.now()) == (True, to_ns(12.3))
    simulator.go_to(12.4)
    assert clock.now() == to_ns(12.4)
    assert not tool_clock.open_clock(hub.bus(), "wall").simulated


def test_without_a_simulator_the_clock_is_the_hosts(hub: MemoryHub) -> None:
    """The clock stays the host's even if a simulator starts later."""
    clock = tool_clock.open_clock(hub.bus(), "auto")
    Simulator(hub, 0.0).go_to(0.1)
    assert (clock.decided, clock.simulated) == (True, False)
    assert clock.now() > to_ns(1e9)


def test_a_simulator_that_does_not_answer_counts(hub: MemoryHub) -> None:
    """With a busy or frozen simulator the clock is simulated time, not the host's."""

    def refuse(_request: NoRequest) -> None:
        raise QueryTimeoutError("a key: no answer in time", "no answer in time")

    hub.bus().serve(names.service_key(names.SIMULATOR, "status"), NoRequest, refuse)
    assert tool_clock.open_clock(hub.bus(), "auto").simulated


def test_simulated_time_can_be_waited_for(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """With `--clock sim` and no simulator yet, the clock opens at the first tick."""
    found, asked = [], threading.Event()
    monkeypatch.setattr(tool_clock, "ask_time", lambda _bus: asked.set())
    thread = threading.Thread(target=lambda: found.append(tool_clock.open_clock(hub.bus(), "sim")))
    thread.start()
    assert asked.wait(LIMIT)
    assert found == []
    Simulator(hub, 0.0).go_to(0.1)
    thread.join(LIMIT)
    assert (found[0].simulated, found[0].now()) == (True, to_ns(0.1))


PUB = "zteam topic pub flag Bool '{data: true}'"


def test_messages_are_published_in_simulated_time(
    tools: MemoryHub, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first message is sent at once, the others at the ticks of their moments, and none while time stands still."""
    monkeypatch.setattr(clock_module, "STILL", 0.01)
    simulator, heard, codes, errors = Simulator(tools, 5.0), list[Bool](), list[int](), ""
    tools.bus().subscribe("flag", Bool, lambda _key, message: heard.append(message))
    thread = threading.Thread(target=lambda: codes.append(run_here(f"{PUB} --rate 5 --times 4")), daemon=True)
    thread.start()

    def stands_still() -> bool:
        nonlocal errors
        errors += capsys.readouterr().err
        return "time stands still at 5.000 s: see 'zteam sim status' (--clock wall uses the host's time)" in errors

    wait_until_true(stands_still)
    assert len(heard) == 1
    for tick, count in ((5.1, 1), (5.2, 2), (5.3, 2), (5.4, 3), (5.5, 3)):
        simulator.go_to(tick)
        wait_until_true(lambda least=count: len(heard) == least)  # type: ignore[misc]
    assert not codes
    simulator.go_to(5.6)
    wait_until_true(lambda: codes == [0])
    assert len(heard) == 4
    assert (errors + capsys.readouterr().err).count("stands still") == 1


@pytest.mark.parametrize("words", ["", "--clock wall"])
def test_messages_are_published_in_the_hosts_time(words: str, tools: MemoryHub, run: Run) -> None:
    """Without a simulator, or with `--clock wall` beside one that stands still, messages are sent at the rate."""
    if words:
        Simulator(tools, 5.0)
    heard = list[Bool]()
    tools.bus().subscribe("flag", Bool, lambda _key, message: heard.append(message))
    run(f"{PUB} --rate 1000 --times 5 {words}")
    assert len(heard) == 5


def test_one_message_needs_no_clock(tools: MemoryHub, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """`--once` publishes without opening a clock."""
    monkeypatch.setattr(topic, "open_clock", lambda *_: pytest.fail("a clock was opened"))
    run(f"{PUB} --once")


RESET = (50, 51, 52, 1, 2, 3, 4)


@pytest.mark.parametrize(
    ("words", "ticks", "clock", "rate"),
    [("", RESET, "wall", None), ("--clock sim", RESET, "sim", 10.0), ("--clock sim", (50, 0, 0, 0, 0), "sim", 0.0)],
)
def test_hz_names_its_clock(
    words: str,
    ticks: tuple[int, ...],
    clock: str,
    rate: float | None,
    hub: MemoryHub,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """`zteam topic hz` measures in the host's time by default; in simulated time its rate is exact, and messages of a
    paused simulator are messages."""
    simulator, sender, subscribed = Simulator(hub, 5.0), hub.bus().publisher("flag", Bool), threading.Event()

    class SignallingBus(Bus):
        """Sets an event when a subscriber is declared."""

        def subscribe_raw(self, *args: object, **options: object) -> object:  # type: ignore[override]
            handle = super().subscribe_raw(*args, **options)  # type: ignore[arg-type]
            subscribed.set()
            return handle

    monkeypatch.setattr(listening, "connect", lambda *_, **__: SignallingBus(hub.bus().transport))
    thread = threading.Thread(target=run_here, args=(f"zteam topic hz flag --once --json {words}",))
    thread.start()
    assert subscribed.wait(LIMIT)
    # The simulator is reset on the way: earlier stamps do not count.
    for tick in ticks:
        simulator.go_to(tick / 10)
        sender.put(Bool(True))
    thread.join(LIMIT)
    measured = json.loads(capsys.readouterr().out)
    assert measured["clock"] == clock
    if rate is not None:
        assert (measured["rate"], measured["window"]) == (pytest.approx(rate), 4)
