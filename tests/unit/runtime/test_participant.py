"""A participant and a simulator by script: joining, answering once, repeats, time, and what ends it."""

import threading
from collections.abc import Callable, Iterator

import pytest

from support.lockstep_doubles import INTERVAL, LIMIT, ScriptedSimulator, show_simulator
from support.log_capture import LogCapture, captured_log
from zteam import names
from zteam.bus import Bus, MemoryHub, NoRequest
from zteam.clock import wait_until
from zteam.errors import ZteamError
from zteam.messages import Bool, Done, Tick, Twist, Vector3, ns_from_time, time_from_ns
from zteam.runtime import participant as module
from zteam.runtime.node import Node
from zteam.runtime.participant import Participant
from zteam.runtime.shutdown import Stop
from zteam.services.simulator import SimStatus

NAME = "planner"
INPUT = "camera/seen"


class Desk:
    """A process that takes part: it acts when it was fed as often as there are ticks."""

    def __init__(self, bus: Bus) -> None:
        self.node = Node(NAME, bus, Stop())
        self.acted: list[int] = []
        self.asked: list[list[str]] = []
        """The participants of each tick at which `ready` was called."""
        self.repeats = 0
        self.fed = 0
        self.needs_food = False
        self.command: Callable[[Tick], Twist | None] = lambda _: None
        self.part = Participant(self.node, self._ready, self._act, self._repeat)
        self._input = bus.publisher(INPUT, Bool)
        self.node.subscribe(INPUT, Bool, self._on_input)

    def _ready(self, tick: Tick) -> bool:
        self.asked.append(tick.participants)
        return not (self.needs_food and "cook" in tick.participants) or self.fed >= tick.tick

    def _act(self, tick: Tick) -> Twist | None:
        self.acted.append(tick.tick)
        return self.command(tick)

    def _repeat(self) -> None:
        self.repeats += 1

    def feed(self) -> None:
        """Send it its input."""
        self._input.put(Bool(True))

    def hear(self, tick: int) -> None:
        """Data of that tick comes."""
        with self.node.changed:
            self.part.take_stamp(tick * INTERVAL)

    def _on_input(self, _key: str, _message: Bool) -> None:
        self.fed += 1
        self.part.advance()


@pytest.fixture
def script(hub: MemoryHub) -> ScriptedSimulator:
    """A simulator with its token."""
    script = ScriptedSimulator(hub, NAME)
    script.appear()
    return script


@pytest.fixture
def desk(hub: MemoryHub, script: ScriptedSimulator) -> Iterator[Desk]:
    """A present process that has just asked to be let in, and heard that it is (ticks from 2 on are for it)."""
    desk = Desk(hub.bus())
    desk.node.become_present()
    script.tick(1)
    assert script.take() == [Done(1, 1)]
    yield desk
    desk.node.close()


def test_a_newcomer_asks_to_be_let_in(desk: Desk, script: ScriptedSimulator) -> None:
    """A tick that does not list it is answered without acting; the first one that does is acted on."""
    script.tick(2, "robot_0")
    assert script.take() == [Done(1, 2)]
    assert desk.acted == []
    script.tick(3, NAME, "robot_0")
    assert script.take() == [Done(1, 3)]
    assert desk.acted == [3]


def test_who_does_not_hold_its_name_says_nothing(hub: MemoryHub, script: ScriptedSimulator) -> None:
    """Before the name is won another process may have it, so ticks are neither heard nor answered."""
    desk = Desk(hub.bus())
    script.tick(1, NAME)
    script.tick(2)
    assert (script.answers, desk.acted, desk.part.active, desk.part.tick) == ([], [], False, None)
    assert desk.node.clock.now() == 0
    desk.node.become_present()
    script.tick(2)
    assert script.take() == [Done(1, 2)]
    assert desk.part.active
    desk.node.close()


def test_a_command_travels_with_the_answer(desk: Desk, script: ScriptedSimulator) -> None:
    """What `act` returns is in the answer to that tick; with None the answer has no command."""
    desk.command = lambda tick: Twist(Vector3(0.1 * tick.tick)) if tick.tick % 2 else None
    script.tick(2, NAME)
    script.tick(3, NAME)
    assert script.take() == [Done(1, 2), Done(1, 3, True, Twist(Vector3(0.1 * 3)))]


def test_it_acts_when_its_inputs_are_there(desk: Desk, script: ScriptedSimulator) -> None:
    """The tick waits for the last input, and is acted on and answered once, in that input's callback."""
    desk.needs_food = True
    script.tick(2, NAME, "cook")
    assert (script.take(), desk.acted) == ([], [])
    desk.feed()
    assert (script.take(), desk.acted) == ([], [])
    desk.feed()
    assert (script.take(), desk.acted) == ([Done(1, 2)], [2])
    desk.feed()
    assert (script.take(), desk.acted) == ([], [2])


def test_inputs_that_come_before_their_tick_count(desk: Desk, script: ScriptedSimulator) -> None:
    """Messages may overtake the tick: it is then answered at once."""
    desk.needs_food = True
    desk.feed()
    desk.feed()
    assert script.take() == []
    script.tick(2, NAME, "cook")
    assert (script.take(), desk.acted) == ([Done(1, 2)], [2])


def test_a_repeated_tick_is_answered_again_and_not_acted_on_again(desk: Desk, script: ScriptedSimulator) -> None:
    """A tick comes again because its answer or its data was lost: both are sent once more, unchanged."""
    desk.command = lambda _: Twist(Vector3(0.1 * (1 + len(desk.acted))))
    script.tick(2, NAME)
    first = script.take()
    for count in range(1, 4):
        script.tick(2, NAME)
        assert script.take() == first
        assert desk.repeats == count
    assert desk.acted == [2]


def test_a_repeated_tick_that_waits_for_inputs_goes_on_waiting(desk: Desk, script: ScriptedSimulator) -> None:
    """It is looked at again, is not answered early, and is acted on once when all is there."""
    desk.needs_food = True
    for _ in range(3):
        script.tick(2, NAME, "cook")
    assert (script.take(), desk.acted, desk.repeats) == ([], [], 0)
    desk.feed()
    desk.feed()
    assert (script.take(), desk.acted) == ([Done(1, 2)], [2])


def test_it_looks_again_when_others_leave_the_tick(desk: Desk, script: ScriptedSimulator) -> None:
    """A repeated tick may say that a process with missing inputs does not take part any more."""
    desk.needs_food = True
    script.tick(2, NAME, "cook")
    assert script.take() == []
    script.tick(2, NAME)
    assert (script.take(), desk.acted) == ([Done(1, 2)], [2])
    assert desk.asked[-2:] == [[NAME, "cook"], [NAME]]


def test_the_tick_of_another_epoch_is_another_tick(desk: Desk, script: ScriptedSimulator) -> None:
    """GO opens the held first tick anew: it is acted on again."""
    script.tick(2, NAME, epoch=0)
    script.tick(2, NAME, epoch=4)
    assert script.take() == [Done(0, 2), Done(4, 2)]
    assert desk.acted == [2, 2]


def test_a_newer_tick_ends_the_wait_for_an_older_one(desk: Desk, script: ScriptedSimulator) -> None:
    """Left behind and let in again, it answers the tick at hand alone."""
    desk.needs_food = True
    script.tick(2, NAME, "cook")
    script.tick(3, "cook")
    assert script.take() == [Done(1, 3)]
    for _ in range(3):
        desk.feed()
    assert (script.take(), desk.acted) == ([], [])
    script.tick(4, NAME)
    assert (script.take(), desk.acted) == ([Done(1, 4)], [4])


def test_a_tick_it_was_let_into_while_it_was_open_is_acted_on(desk: Desk, script: ScriptedSimulator) -> None:
    """Having asked to be let in is no answer: the same tick may come again with its name in it."""
    script.tick(5)
    script.tick(5, NAME)
    assert script.take() == [Done(1, 5), Done(1, 5)]
    assert (desk.acted, desk.repeats) == ([5], 0)


def test_a_fault_in_its_work_ends_the_wait_of_its_main_loop(desk: Desk, script: ScriptedSimulator) -> None:
    """What `act` raises on a thread of the bus is raised where the process waits; the tick is not answered."""
    caught: list[BaseException] = []

    def fail(_: Tick) -> Twist | None:
        raise ZteamError("no path")

    def main_loop() -> None:
        try:
            desk.node.wait(lambda: False, LIMIT)
        except ZteamError as error:
            caught.append(error)

    desk.command = fail
    thread = threading.Thread(target=main_loop)
    thread.start()
    script.tick(2, NAME)
    thread.join(LIMIT)
    assert [str(error) for error in caught] == ["no path"]
    assert script.take() == []
    with pytest.raises(ZteamError, match="no path"):
        desk.node.wait(lambda: True, LIMIT)


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
    assert (desk.node.clock.now(), desk.part.active) == (5 * INTERVAL, False)
    desk.feed()
    assert (desk.fed, desk.acted, script.answers) == (1, [], [])
    desk.node.close()


def test_the_clock_is_heard_again_when_the_simulator_is_gone(desk: Desk, script: ScriptedSimulator) -> None:
    """The next simulator may not work in lock-step: the participant is idle, and the clock counts."""
    script.tick(2, NAME)
    script.vanish()
    assert (desk.part.active, desk.part.tick) == (False, None)
    assert desk.node.clock.now() == 2 * INTERVAL
    script.appear()
    script.tell(9 * INTERVAL)
    assert desk.node.clock.now() == 9 * INTERVAL
    assert not desk.part.active


def test_the_next_simulators_ticks_are_new(desk: Desk, script: ScriptedSimulator) -> None:
    """A simulator that starts anew numbers its ticks from 1: they are acted on, though they were answered before."""
    script.tick(2, NAME)
    assert script.take() == [Done(1, 2)]
    script.vanish()
    script.appear()
    script.tick(2, NAME)
    assert script.take() == [Done(1, 2)]
    assert (desk.acted, desk.repeats) == ([2, 2], 0)


def test_an_open_tick_ends_with_its_simulator(desk: Desk, script: ScriptedSimulator) -> None:
    """Inputs that come after the simulator is gone cause no answer."""
    desk.needs_food = True
    script.tick(2, NAME, "cook")
    script.vanish()
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


REFUSED = "dropped a message on sim/tick"


@pytest.fixture
def log() -> Iterator[LogCapture]:
    """What is logged during the test."""
    with captured_log() as lines:
        yield lines


def forge(hub: MemoryHub, tick: int, *participants: str) -> None:
    """A tick from a session that is no simulator."""
    publisher = hub.bus().publisher(names.TICK, Tick)
    publisher.put(Tick(time_from_ns(tick * INTERVAL), 1, tick, participants=list(participants)))


def test_a_tick_that_no_simulator_sent_stops_no_team_in_real_time(hub: MemoryHub, log: LogCapture) -> None:
    """It is neither answered nor taken for the time, and the log and the counters say that it came."""
    script, desk = ScriptedSimulator(hub, NAME), Desk(hub.bus())
    show_simulator(script.bus, lockstep=False)
    desk.node.become_present()
    script.tell(5 * INTERVAL)
    forge(hub, 0, NAME)
    forge(hub, 0)
    log.wait_for(REFUSED)
    assert (script.answers, desk.acted, desk.part.active) == ([], [], False)
    script.tell(6 * INTERVAL)
    assert desk.node.clock.now() == 6 * INTERVAL
    assert desk.node.bus.counters.snapshot()[names.TICK].dropped == 1
    desk.node.close()


def test_a_tick_that_no_simulator_sent_does_not_count_in_lock_step(
    hub: MemoryHub, desk: Desk, script: ScriptedSimulator, log: LogCapture
) -> None:
    """Beside a simulator in lock-step, only that one's ticks are answered."""
    script.tick(2, NAME)
    forge(hub, 900, NAME)
    log.wait_for(REFUSED)
    script.tick(3, NAME)
    assert (script.take(), desk.acted) == ([Done(1, 2), Done(1, 3)], [2, 3])
    assert desk.node.clock.now() == 3 * INTERVAL


def test_a_tick_may_come_before_the_simulators_token(hub: MemoryHub) -> None:
    """Nothing orders the two: the tick is kept, and answered when its simulator has said that this is lock-step."""
    script, desk = ScriptedSimulator(hub, NAME), Desk(hub.bus())
    desk.node.become_present()
    script.tick(1)
    assert script.take() == []
    script.appear()
    assert script.take() == [Done(1, 1)]
    desk.node.close()


def test_a_simulator_that_did_not_answer_is_asked_again(hub: MemoryHub) -> None:
    """Its next tick brings the question anew, and is answered when that is."""
    script, desk = ScriptedSimulator(hub, NAME), Desk(hub.bus())
    desk.node.become_present()
    script.bus.declare_token(names.token_key(names.SIMULATOR, script.bus.instance))
    status = SimStatus("scripted", [], INTERVAL, 1, 0, 0, 1.0, lockstep=True)
    script.bus.serve(names.service_key(names.SIMULATOR, "status"), NoRequest, lambda _: status)
    assert script.take() == []
    script.tick(1)
    with desk.node.changed:
        assert wait_until(desk.node.changed, lambda: script.answers == [Done(1, 1)], LIMIT)
    desk.node.close()


def test_data_that_goes_on_without_ticks_is_of_real_time(
    desk: Desk, script: ScriptedSimulator, log: LogCapture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The participant is idle again, and the clock counts; a tick takes it back into lock-step."""
    monkeypatch.setattr(module, "TICKLESS", 0.0, raising=False)
    script.tick(2, NAME)
    # Of the tick itself, and of the next one, which may come before it.
    for stamp in (2, 2, 3, 3, 3):
        desk.hear(stamp)
        assert desk.part.active
    desk.hear(4)
    assert not desk.part.active
    assert log.count("not in lock-step any more") == 1
    script.tell(9 * INTERVAL)
    assert desk.node.clock.now() == 9 * INTERVAL
    script.take()
    script.tick(10, NAME)
    with desk.node.changed:
        assert wait_until(desk.node.changed, lambda: script.answers == [Done(1, 10)], LIMIT)
    assert desk.part.active


def test_data_before_its_tick_does_not_end_lock_step(desk: Desk, script: ScriptedSimulator) -> None:
    """Scans come a moment before their tick, for as long as there are ticks."""
    for tick in range(2, 50):
        desk.hear(tick)
        desk.hear(tick)
        script.tick(tick, NAME)
    assert desk.acted == [*range(2, 50)]


@pytest.mark.parametrize("late", ["tick", "input"])
def test_nothing_is_answered_behind_the_stop_hooks(desk: Desk, script: ScriptedSimulator, late: str) -> None:
    """A hook has the last word, such as a zero velocity: a tick or an input that comes after it does nothing."""
    desk.needs_food = late == "input"
    script.tick(2, NAME, "cook")
    script.take()
    acted = [*desk.acted]

    def go_on() -> None:
        if late == "input":
            desk.feed()
            desk.feed()
        else:
            script.tick(3, NAME)

    desk.node.on_stop(go_on)
    desk.node.close()
    assert (script.take(), desk.acted) == ([], acted)
