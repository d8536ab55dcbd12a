"""The simulator's half of lock-step, with participants by script: ticks out, answers in, deaths, resets."""

import pytest

from support.lockstep_doubles import INTERVAL, Player, Worlds, make_team
from zteam import names
from zteam.bus import MemoryHub
from zteam.messages import Done, Twist, Vector3, ns_from_time


@pytest.mark.usefixtures("patient")
def test_a_world_alone_waits_for_nobody(worlds: Worlds) -> None:
    """Without participants, expectations and gate every tick is over at once."""
    world = worlds()
    for tick in range(1, 4):
        world.open(tick)
        assert world.wait()
    assert (world.step.participants, world.step.resends, world.step.waiting_for()) == ([], 0, "")


@pytest.mark.usefixtures("patient")
def test_a_tick_tells_what_it_is(hub: MemoryHub, worlds: Worlds) -> None:
    """Number, time, epoch, the robots in the world and who takes part are in the message."""
    world = worlds()
    (robot,) = make_team(hub, world, "robot_0")
    world.open(3, 0, 4)
    tick = robot.heard[-1]
    assert (tick.tick, ns_from_time(tick.stamp), tick.epoch) == (3, 3 * INTERVAL, 0)
    assert (tick.robots.tolist(), tick.participants) == ([0, 4], ["robot_0"])
    assert not world.step.is_go


@pytest.mark.usefixtures("patient")
def test_a_tick_ends_with_the_last_answer(hub: MemoryHub, worlds: Worlds) -> None:
    """The wait is over in the moment the last one answers, and not before."""
    world = worlds()
    first, last = make_team(hub, world, "robot_0", "tf")
    assert world.wait()
    first.awake = last.awake = False
    world.open(3)
    world.begin()
    first.answer()
    assert world.step.waiting_for() == "tf"
    assert world.holds
    last.answer()
    assert world.end()


@pytest.mark.usefixtures("patient")
def test_a_newcomer_hears_of_the_tick_at_hand(hub: MemoryHub, worlds: Worlds) -> None:
    """It joins though the world stands, hinders nobody, and is waited for from the next tick on."""
    world = worlds()
    make_team(hub, world, "robot_0")
    assert world.wait()
    late = Player(hub, "planner").appear()
    assert (world.step.joining, world.step.participants) == (["planner"], ["robot_0"])
    assert world.wait()
    late.awake = False
    world.open(3)
    assert (world.step.joining, world.step.participants) == ([], ["planner", "robot_0"])
    world.begin()
    assert world.step.waiting_for() == "planner"
    late.answer()
    assert world.end()


@pytest.mark.usefixtures("patient")
def test_a_death_ends_the_wait_at_once(hub: MemoryHub, worlds: Worlds) -> None:
    """The dead are not waited for, and the others are told who takes part now."""
    world = worlds()
    robot, aggregator = make_team(hub, world, "robot_0", "tf")
    assert world.wait()
    aggregator.awake = False
    world.open(3)
    world.begin()
    assert world.holds
    aggregator.vanish()
    assert world.end()
    assert robot.lists[-2:] == [["robot_0", "tf"], ["robot_0"]]
    assert robot.heard[-1].tick == 3
    assert (world.step.hung, world.step.resends) == ([], 0)
    world.open(4)
    assert world.wait()
    assert robot.lists[-1] == ["robot_0"]


@pytest.mark.usefixtures("patient")
def test_a_restarted_process_goes_on_where_the_old_one_was(hub: MemoryHub, worlds: Worlds) -> None:
    """When the new token comes before the old one goes, the name stays in, and its new holder hears the open tick."""
    world = worlds()
    (old,) = make_team(hub, world, "robot_0")
    assert world.wait()
    old.awake = False
    world.open(3)
    world.begin()
    new = Player(hub, "robot_0").appear()
    assert world.end()
    assert new.lists == [["robot_0"]]
    old.vanish()
    world.open(4)
    assert (world.wait(), world.step.participants) == (True, ["robot_0"])


@pytest.mark.usefixtures("patient")
def test_a_stop_request_ends_the_wait(hub: MemoryHub, worlds: Worlds) -> None:
    """The process may stop while somebody holds the world: `wait` says that the tick did not end."""
    world = worlds()
    (robot,) = make_team(hub, world, "robot_0")
    robot.awake = False
    world.open(3)
    world.begin()
    assert world.holds
    world.stop.request("test")
    assert world.end() is False


@pytest.mark.usefixtures("patient")
def test_nobodys_answer_is_counted_and_dropped(hub: MemoryHub, worlds: Worlds) -> None:
    """Who holds no name by a token does not take part, whatever it says."""
    world = worlds()
    ghost = Player(hub, "robot_9")
    world.open(1)
    ghost.say(Done(0, 1))
    assert world.step.joining == []
    assert world.node.bus.counters.snapshot()[names.done_key("robot_9")].dropped == 1
    world.open(2)
    assert world.step.participants == []


@pytest.mark.usefixtures("patient")
def test_commands_come_with_the_answers(hub: MemoryHub, worlds: Worlds) -> None:
    """They are the robots' that are in the world, by id, and those of the open tick only."""
    world = worlds()
    players = [Player(hub, f"robot_{i}", Twist(Vector3(0.1 * i))).appear() for i in (10, 2, 3)]
    Player(hub, "tf").appear()
    Player(hub, "robot_4").appear()
    world.open(1)
    assert world.step.take_commands({2: None, 10: None}) == {}
    assert world.wait()
    world.open(2, 2, 4, 10)
    assert world.wait()
    commands = world.step.take_commands({2: None, 4: None, 10: None})
    assert list(commands.items()) == [(2, Twist(Vector3(0.2))), (10, Twist(Vector3(1.0)))]
    assert {10, 2, 3} <= set(world.answered)
    players[0].awake = False
    world.open(3, 2, 4, 10)
    players[0].say(Done(0, 2, True, Twist(Vector3(9.0))))
    assert list(world.step.take_commands({2: None, 10: None})) == [2]


@pytest.mark.usefixtures("patient")
def test_after_a_reset_old_answers_count_no_more(hub: MemoryHub, worlds: Worlds) -> None:
    """The world that goes back to the tick it is at waits for everybody to answer that tick again."""
    world = worlds()
    (robot,) = make_team(hub, world, "robot_0")
    assert world.wait()
    robot.awake = False
    world.step.start_anew()
    assert world.step.take_commands({0: None}) == {}
    world.open(2)
    world.begin()
    assert world.step.waiting_for() == "robot_0"
    robot.answer()
    assert world.end()
