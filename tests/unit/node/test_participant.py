"""A participant and a simulator by script: joining, answering once, repeats, and what ends an answer."""

import threading

import pytest

from support.limits import LIMIT
from support.lockstep_doubles import ScriptedSimulator
from support.participant_desk import NAME, Desk
from zteam.bus import MemoryHub
from zteam.errors import ZteamError
from zteam.messages import Done, Tick, Twist, Vector3


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
    assert (script.answers, desk.acted, desk.part.tick) == ([], [], None)
    assert desk.node.clock.now() == 0
    desk.node.become_present()
    script.tick(2)
    assert script.take() == [Done(1, 2)]
    assert desk.part.tick is not None
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


def test_a_robot_that_left_and_is_back_in_the_next_tick_is_a_newcomer(desk: Desk, script: ScriptedSimulator) -> None:
    """The team has the same robots and is another one: what the old process was told the new one has not heard."""
    script.tick(2, NAME, "robot_7")
    team = desk.part.team
    script.tick(3, NAME, "robot_7")
    assert desk.part.team is team
    script.tick(3, NAME)
    assert desk.part.team is team, "nothing changes within a tick"
    script.tick(4, NAME, "robot_7")
    assert desk.part.team == team
    assert desk.part.team is not team


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


def test_a_process_that_stops_within_its_step_does_not_answer(desk: Desk, script: ScriptedSimulator) -> None:
    """The tick then ends when its token has gone, so all know in which tick it left."""

    def stop(_: Tick) -> Twist | None:
        desk.node.stop.request("it has done its work")
        return Twist()

    desk.command = stop
    script.tick(2, NAME)
    assert (desk.acted, script.take()) == ([2], [])


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
