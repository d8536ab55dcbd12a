"""The simulator's half of lock-step, with participants by script: ticks out, answers in, deaths, resets."""

import pytest

from support.lockstep_doubles import INTERVAL, HarnessFactory, ScriptedParticipant, make_team
from zteam import names
from zteam.bus import MemoryHub
from zteam.messages import Done, Twist, Vector3, ns_from_time


@pytest.mark.usefixtures("patient")
def test_a_world_alone_waits_for_nobody(new_harness: HarnessFactory) -> None:
    """Without participants, expectations and gate every tick is over at once."""
    harness = new_harness()
    for tick in range(1, 4):
        harness.open(tick)
        assert harness.wait()
    assert (harness.lockstep.participants, harness.lockstep.resends, harness.lockstep.waiting_for()) == ([], 0, "")


@pytest.mark.usefixtures("patient")
def test_a_tick_tells_what_it_is(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """Number, time, epoch, the robots in the world and who takes part are in the message."""
    harness = new_harness()
    (robot,) = make_team(hub, harness, "robot_0")
    harness.open(3, 0, 4)
    tick = robot.heard[-1]
    assert (tick.tick, ns_from_time(tick.stamp), tick.epoch) == (3, 3 * INTERVAL, 0)
    assert (tick.robots.tolist(), tick.participants) == ([0, 4], ["robot_0"])
    assert not harness.lockstep.is_go


@pytest.mark.usefixtures("patient")
def test_a_tick_ends_with_the_last_answer(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """The wait is over in the moment the last one answers, and not before."""
    harness = new_harness()
    first, last = make_team(hub, harness, "robot_0", "tf")
    assert harness.wait()
    first.awake = last.awake = False
    harness.open(3)
    harness.begin()
    first.answer()
    assert harness.lockstep.waiting_for() == "tf"
    assert harness.holds
    last.answer()
    assert harness.end()


@pytest.mark.usefixtures("patient")
def test_a_newcomer_hears_of_the_tick_at_hand(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """It joins though the world stands, hinders nobody, and is waited for from the next tick on."""
    harness = new_harness()
    make_team(hub, harness, "robot_0")
    assert harness.wait()
    late = ScriptedParticipant(hub, "planner").appear()
    assert (harness.lockstep.joining, harness.lockstep.participants) == (["planner"], ["robot_0"])
    assert harness.wait()
    late.awake = False
    harness.open(3)
    assert (harness.lockstep.joining, harness.lockstep.participants) == ([], ["planner", "robot_0"])
    harness.begin()
    assert harness.lockstep.waiting_for() == "planner"
    late.answer()
    assert harness.end()


@pytest.mark.usefixtures("patient")
def test_a_death_ends_the_wait_at_once(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """The dead are not waited for, and the others are told who takes part now."""
    harness = new_harness()
    robot, aggregator = make_team(hub, harness, "robot_0", "tf")
    assert harness.wait()
    aggregator.awake = False
    harness.open(3)
    harness.begin()
    assert harness.holds
    aggregator.vanish()
    assert harness.end()
    assert robot.lists[-2:] == [["robot_0", "tf"], ["robot_0"]]
    assert robot.heard[-1].tick == 3
    assert (harness.lockstep.hung, harness.lockstep.resends) == ([], 0)
    harness.open(4)
    assert harness.wait()
    assert robot.lists[-1] == ["robot_0"]


@pytest.mark.usefixtures("patient")
def test_a_restarted_process_goes_on_where_the_old_one_was(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """When the new token comes before the old one goes, the name stays in, and its new holder hears the open tick."""
    harness = new_harness()
    (old,) = make_team(hub, harness, "robot_0")
    assert harness.wait()
    old.awake = False
    harness.open(3)
    harness.begin()
    new = ScriptedParticipant(hub, "robot_0").appear()
    assert harness.end()
    assert new.lists == [["robot_0"]]
    old.vanish()
    harness.open(4)
    assert (harness.wait(), harness.lockstep.participants) == (True, ["robot_0"])


@pytest.mark.usefixtures("patient")
def test_a_stop_request_ends_the_wait(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """The process may stop while somebody holds the world: `wait` says that the tick did not end."""
    harness = new_harness()
    (robot,) = make_team(hub, harness, "robot_0")
    robot.awake = False
    harness.open(3)
    harness.begin()
    assert harness.holds
    harness.stop.request("test")
    assert harness.end() is False


@pytest.mark.usefixtures("patient")
def test_nobodys_answer_is_counted_and_dropped(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """Who holds no name by a token does not take part, whatever it says."""
    harness = new_harness()
    ghost = ScriptedParticipant(hub, "robot_9")
    harness.open(1)
    ghost.say(Done(0, 1))
    assert harness.lockstep.joining == []
    assert harness.node.bus.counters.snapshot()[names.done_key("robot_9")].dropped == 1
    harness.open(2)
    assert harness.lockstep.participants == []


@pytest.mark.usefixtures("patient")
def test_commands_come_with_the_answers(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """They are the robots' that are in the world, by id, and those of the open tick only."""
    harness = new_harness()
    participants = [ScriptedParticipant(hub, f"robot_{i}", Twist(Vector3(0.1 * i))).appear() for i in (10, 2, 3)]
    ScriptedParticipant(hub, "tf").appear()
    ScriptedParticipant(hub, "robot_4").appear()
    harness.open(1)
    assert harness.lockstep.take_commands({2: None, 10: None}) == {}
    assert harness.wait()
    harness.open(2, 2, 4, 10)
    assert harness.wait()
    commands = harness.lockstep.take_commands({2: None, 4: None, 10: None})
    assert list(commands.items()) == [(2, Twist(Vector3(0.2))), (10, Twist(Vector3(1.0)))]
    assert {10, 2, 3} <= set(harness.answered)
    participants[0].awake = False
    harness.open(3, 2, 4, 10)
    participants[0].say(Done(0, 2, True, Twist(Vector3(9.0))))
    assert list(harness.lockstep.take_commands({2: None, 10: None})) == [2]


@pytest.mark.usefixtures("patient")
def test_after_a_reset_old_answers_count_no_more(hub: MemoryHub, new_harness: HarnessFactory) -> None:
    """The world that goes back to the tick it is at waits for everybody to answer that tick again."""
    harness = new_harness()
    (robot,) = make_team(hub, harness, "robot_0")
    assert harness.wait()
    robot.awake = False
    harness.lockstep.start_anew()
    assert harness.lockstep.take_commands({0: None}) == {}
    harness.open(2)
    harness.begin()
    assert harness.lockstep.waiting_for() == "robot_0"
    robot.answer()
    assert harness.end()
