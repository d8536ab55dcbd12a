"""The ticks of a simulator by script: the time that they tell, which of them count, and what ends lock-step."""

from collections.abc import Iterator

import pytest

from support.limits import LIMIT
from support.lockstep_doubles import INTERVAL, ScriptedSimulator, show_simulator
from support.log_capture import LogCapture, captured_log
from support.participant_desk import NAME, Desk
from zteam import names
from zteam.bus import MemoryHub
from zteam.messages import Done, Tick, ns_from_time, time_from_ns

REFUSED = "dropped a message on sim/tick"


@pytest.fixture
def log() -> Iterator[LogCapture]:
    """What is logged during the test."""
    with captured_log() as lines:
        yield lines


def test_time_goes_with_the_ticks(desk: Desk, script: ScriptedSimulator) -> None:
    """In lock-step each tick sets the time; the clock, which would only wake the process once more, is not heard."""
    times: list[int] = []
    desk.command = lambda _: times.append(desk.node.clock.now())
    for tick in (2, 3, 4):
        script.tick(tick, NAME)
    assert times == [2 * INTERVAL, 3 * INTERVAL, 4 * INTERVAL]
    script.tell(77 * INTERVAL)
    assert desk.node.clock.now() == 4 * INTERVAL
    assert desk.node.clock.simulated
    assert desk.part.tick is not None
    assert ns_from_time(desk.part.tick.stamp) == 4 * INTERVAL


def test_the_clock_tells_the_time_outside_of_lock_step(hub: MemoryHub, script: ScriptedSimulator) -> None:
    """Before the first tick the participant is idle and its node hears the clock as ever."""
    desk = Desk(hub.bus())
    desk.node.become_present()
    script.tell(5 * INTERVAL)
    assert (desk.node.clock.now(), desk.part.tick) == (5 * INTERVAL, None)
    desk.feed()
    assert (desk.fed, desk.acted, script.answers) == (1, [], [])
    desk.node.close()


def lose(desk: Desk, script: ScriptedSimulator) -> None:
    """Let the simulator vanish, and wait until that is certain."""
    script.vanish()
    with desk.node.changed:
        desk.node.changed.wait_until(lambda: desk.part.tick is None, LIMIT)
        assert desk.part.tick is None


def test_the_clock_is_heard_again_when_the_simulator_is_gone(desk: Desk, script: ScriptedSimulator) -> None:
    """The next simulator may not work in lock-step: the participant is idle, and the clock counts."""
    script.tick(2, NAME)
    lose(desk, script)
    assert desk.part.tick is None
    assert desk.node.clock.now() == 2 * INTERVAL
    script.appear()
    script.tell(9 * INTERVAL)
    assert desk.node.clock.now() == 9 * INTERVAL
    assert desk.part.tick is None


def test_the_next_simulators_ticks_are_new(desk: Desk, script: ScriptedSimulator) -> None:
    """A simulator that starts anew numbers its ticks from 1: they are acted on, though they were answered before."""
    script.tick(2, NAME)
    assert script.take() == [Done(1, 2)]
    lose(desk, script)
    script.appear()
    script.tick(2, NAME)
    assert script.take() == [Done(1, 2)]
    assert (desk.acted, desk.repeats) == ([2, 2], 0)


def test_an_open_tick_ends_with_its_simulator(desk: Desk, script: ScriptedSimulator) -> None:
    """Inputs that come after the simulator is gone cause no answer."""
    desk.needs_food = True
    script.tick(2, NAME, "cook")
    lose(desk, script)
    desk.feed()
    desk.feed()
    assert (script.take(), desk.acted) == ([], [])


def test_a_jump_back_is_told_before_the_tick_is_acted_on(desk: Desk, script: ScriptedSimulator) -> None:
    """After a reset the old data is forgotten first; the inputs are asked for when that is done."""
    order: list[str] = []
    desk.node.clock.sim.on_jump_back(lambda old, new: order.append(f"{old // INTERVAL} -> {new // INTERVAL}"))
    desk.command = lambda tick: order.append(f"act {tick.tick}")
    for tick in (8, 9, 2, 3):
        script.tick(tick, NAME)
    assert order == ["act 8", "act 9", "9 -> 2", "act 2", "act 3"]


def test_a_repeated_tick_is_no_jump(desk: Desk, script: ScriptedSimulator) -> None:
    """The time of a repeat is the time that it is."""
    jumps: list[int] = []
    desk.node.clock.sim.on_jump_back(lambda _old, new: jumps.append(new))
    for tick in (2, 2, 3, 3, 3):
        script.tick(tick, NAME)
    assert jumps == []


def forge(hub: MemoryHub, tick: int, *participants: str) -> None:
    """A tick from a session that is no simulator."""
    publisher = hub.bus().publisher(names.TICK, Tick)
    publisher.put(Tick(time_from_ns(tick * INTERVAL), 1, tick, participants=list(participants)))


@pytest.mark.gate
def test_a_tick_that_no_simulator_sent_stops_no_team_in_real_time(hub: MemoryHub, log: LogCapture) -> None:
    """It is neither answered nor taken for the time, and the log and the counters say that it came."""
    script, desk = ScriptedSimulator(hub, NAME), Desk(hub.bus())
    show_simulator(script.bus, lockstep=False)
    desk.node.become_present()
    script.tell(5 * INTERVAL)
    forge(hub, 0, NAME)
    forge(hub, 0)
    log.wait_for(REFUSED)
    assert (script.answers, desk.acted, desk.part.tick) == ([], [], None)
    script.tell(6 * INTERVAL)
    assert desk.node.clock.now() == 6 * INTERVAL
    assert desk.node.bus.counters.snapshot()[names.TICK].dropped == 1
    desk.node.close()


@pytest.mark.gate
def test_a_tick_that_no_simulator_sent_does_not_count_in_lock_step(
    hub: MemoryHub, desk: Desk, script: ScriptedSimulator, log: LogCapture
) -> None:
    """Beside a simulator in lock-step, only that one's ticks are answered."""
    script.tick(2, NAME)
    forge(hub, 900, NAME)
    forge(hub, 901, NAME)
    log.wait_for(REFUSED)
    script.tick(3, NAME)
    assert (script.take(), desk.acted) == ([Done(1, 2), Done(1, 3)], [2, 3])
    assert desk.node.clock.now() == 3 * INTERVAL


def test_a_tick_may_come_before_the_simulators_token(hub: MemoryHub) -> None:
    """Nothing orders the two: the tick is kept, and answered when the token has come."""
    script, desk = ScriptedSimulator(hub, NAME), Desk(hub.bus())
    desk.node.become_present()
    script.tick(1)
    assert script.take() == []
    script.appear()
    assert script.take() == [Done(1, 1)]
    desk.node.close()


def test_lock_step_ends_with_its_token(hub: MemoryHub, desk: Desk, script: ScriptedSimulator) -> None:
    """Also where a simulator in real time is there by then: the participant is idle, and the clock counts."""
    script.tick(2, NAME)
    other = ScriptedSimulator(hub, NAME)
    show_simulator(other.bus, lockstep=False)
    script.vanish()
    assert desk.node.wait(lambda: desk.part.tick is None, LIMIT)
    other.tell(9 * INTERVAL)
    assert desk.node.clock.now() == 9 * INTERVAL
