"""The first tick of lock-step is held: for everybody expected, and for the monitor's GO."""

import pytest

from support.lockstep_doubles import SHORT, GateKeeper, Player, Worlds, listening, lose_first, lossy_bus
from zteam import names
from zteam.bus import MemoryHub

NO_GO = "the monitor's GO"


@pytest.mark.usefixtures("patient")
def test_it_is_held_until_everybody_expected_is_in(hub: MemoryHub, worlds: Worlds) -> None:
    """Each one that comes is let into the held tick, and only with the last one it ends."""
    world = worlds("robot_0", "tf")
    world.open(1)
    world.begin()
    robot = Player(hub, "robot_0").appear()
    robot.wait_until_heard()
    assert "tf" in world.step.waiting_for()
    assert world.holds
    aggregator = Player(hub, "tf").appear()
    assert world.end()
    for player in (robot, aggregator):
        assert player.lists[-1] == ["robot_0", "tf"]
        assert {tick.tick for tick in player.heard} == {1}
    assert world.step.participants == ["robot_0", "tf"]


@pytest.mark.usefixtures("patient")
def test_who_is_there_before_the_first_tick_is_in_it(hub: MemoryHub, worlds: Worlds) -> None:
    """A team that is complete before its world loses no time."""
    world = worlds("robot_0", "tf")
    Player(hub, "robot_0").appear()
    Player(hub, "tf").appear()
    world.open(1)
    assert world.wait()
    assert world.step.participants == ["robot_0", "tf"]


@pytest.mark.usefixtures("patient")
def test_go_is_told_when_everybody_expected_is_in(hub: MemoryHub, worlds: Worlds) -> None:
    """A GO that comes before is withheld, so that all hear it in the same tick."""
    world = worlds("robot_0", "tf", gate=True)
    world.open(1)
    world.begin()
    robot = Player(hub, "robot_0").appear()
    robot.wait_until_heard()
    GateKeeper(hub).give_go(5)
    aggregator = Player(hub, "tf").appear()
    assert world.end()
    assert world.step.is_go
    for player in (robot, aggregator):
        told = [tick.participants for tick in player.heard if tick.epoch == 5]
        assert told[0] == ["robot_0", "tf"]
        assert {tick.epoch for tick in player.heard} == {0, 5}


@pytest.mark.usefixtures("patient")
def test_go_ends_the_hold(hub: MemoryHub, worlds: Worlds) -> None:
    """With everybody in, it is GO that is waited for; the tick is then answered anew, under the new epoch."""
    world = worlds("robot_0", gate=True)
    robot = Player(hub, "robot_0").appear()
    world.open(1)
    world.begin()
    robot.wait_for_list("robot_0")
    assert world.step.waiting_for().startswith(NO_GO)
    assert not world.step.is_go
    robot.awake = False
    GateKeeper(hub).give_go(2)
    robot.wait_for_epoch(2)
    assert world.step.waiting_for() == "robot_0"
    assert world.holds
    robot.answer()
    assert world.end()
    assert world.step.is_go


@pytest.mark.usefixtures("patient")
def test_later_ticks_carry_go(hub: MemoryHub, worlds: Worlds) -> None:
    """GO stands in every tick from its own on, and the highest epoch wins."""
    keeper = GateKeeper(hub)
    world = worlds("robot_0", gate=True)
    robot = Player(hub, "robot_0").appear()
    world.open(1)
    world.begin()
    keeper.give_go(4)
    assert world.end()
    keeper.give_go(3)
    for tick in (2, 3):
        world.open(tick)
        assert world.wait()
    keeper.give_go(7)
    world.open(4)
    assert world.wait()
    assert [(tick.tick, tick.epoch) for tick in robot.heard[-3:]] == [(2, 4), (3, 4), (4, 7)]


@pytest.mark.usefixtures("patient")
def test_without_the_gate_nobody_waits_for_go(hub: MemoryHub, worlds: Worlds) -> None:
    """It is enough that everybody expected is in; a GO that comes later is told all the same."""
    world = worlds("robot_0")
    world.open(1)
    world.begin()
    robot = Player(hub, "robot_0").appear()
    assert world.end()
    assert robot.heard[-1].epoch == 0
    GateKeeper(hub).give_go(1)
    world.open(2)
    assert world.wait()
    assert robot.heard[-1].epoch == 1


@pytest.mark.usefixtures("patient")
def test_go_alone_begins_where_nobody_is_expected(hub: MemoryHub, worlds: Worlds) -> None:
    """Whoever happens to be in by then hears it."""
    world = worlds(gate=True)
    world.open(1)
    world.begin()
    robot = Player(hub, "robot_3").appear()
    robot.wait_for_list("robot_3")
    GateKeeper(hub).give_go(1)
    assert world.end()
    assert robot.heard[-1].epoch == 1


@pytest.mark.usefixtures("patient")
def test_who_is_not_expected_may_be_in_the_held_tick(hub: MemoryHub, worlds: Worlds) -> None:
    """Somebody else's process joins at once, and is waited for like all."""
    world = worlds("robot_0", "tf")
    world.open(1)
    world.begin()
    planner = Player(hub, "planner")
    planner.awake = False
    planner.appear().wait_until_heard()
    Player(hub, "robot_0").appear().wait_until_heard()
    aggregator = Player(hub, "tf").appear()
    aggregator.wait_for_list("planner", "robot_0", "tf")
    assert world.step.waiting_for() == "planner"
    planner.answer()
    assert world.end()


@pytest.mark.usefixtures("patient")
def test_who_dies_while_it_is_held_is_expected_again(hub: MemoryHub, worlds: Worlds) -> None:
    """GO is withheld until the name is back, and nobody is told of it with half a team."""
    world = worlds("robot_0", "tf", gate=True)
    world.open(1)
    world.begin()
    robot = Player(hub, "robot_0").appear()
    robot.wait_until_heard()
    aggregator = Player(hub, "tf").appear()
    robot.wait_for_list("robot_0", "tf")
    aggregator.vanish()
    GateKeeper(hub).give_go(1)
    assert "tf" in world.step.waiting_for()
    assert world.holds
    Player(hub, "tf").appear()
    assert world.end()
    assert {tuple(tick.participants) for tick in robot.heard if tick.epoch} == {("robot_0", "tf")}


@pytest.mark.usefixtures("patient")
def test_only_the_first_tick_is_held(hub: MemoryHub, worlds: Worlds) -> None:
    """Later on the world goes on without an expected process that is gone, after a reset too."""
    world = worlds("robot_0", "tf")
    Player(hub, "robot_0").appear()
    aggregator = Player(hub, "tf").appear()
    world.open(1)
    assert world.wait()
    aggregator.vanish()
    world.open(2)
    assert world.wait()
    world.step.start_anew()
    world.open(1)
    assert world.wait()
    assert world.step.participants == ["robot_0"]


@pytest.mark.usefixtures("hasty")
def test_it_says_what_it_is_held_for(worlds: Worlds) -> None:
    """Who has not come and GO are named, once in a while, with how to go on without."""
    world = worlds("robot_1", "robot_0", gate=True)
    with listening() as log:
        world.open(1)
        world.begin()
        log.wait_for("the first tick is held: waiting for robot_0, robot_1, the monitor's GO")
        assert world.step.waiting_for().startswith("robot_0, robot_1, " + NO_GO)
        assert "--no-gate" in world.step.waiting_for()
        world.stop.request("test")
        assert world.end() is False


@pytest.mark.usefixtures("hasty")
def test_nobody_is_left_behind_while_it_is_held(hub: MemoryHub, worlds: Worlds) -> None:
    """What starting takes is not known: the time-out holds for later ticks only."""
    world = worlds("robot_0", timeout=0.5 * SHORT)
    robot = Player(hub, "robot_0").appear()
    robot.awake = False
    repeats: list[int] = []

    def count() -> None:
        repeats.append(1)
        world.on_resend = count if len(repeats) < 5 else robot.answer

    world.on_resend = count
    world.open(1)
    assert world.wait()
    assert (world.step.hung, world.step.participants) == ([], ["robot_0"])


@pytest.mark.usefixtures("patient")
def test_a_standing_go_is_withheld_too(hub: MemoryHub, worlds: Worlds) -> None:
    """A monitor that outlives the simulator has given GO before the first tick: it is told when all are in."""
    GateKeeper(hub).give_go(3)
    world = worlds("robot_0", "tf", gate=True)
    world.open(1)
    world.begin()
    robot = Player(hub, "robot_0").appear()
    robot.wait_until_heard()
    Player(hub, "tf").appear()
    assert world.end()
    assert {tuple(tick.participants) for tick in robot.heard if tick.epoch} == {("robot_0", "tf")}


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize("lost", [names.TICK, names.done_key("robot_0")])
def test_a_lost_message_does_not_hold_it_for_ever(hub: MemoryHub, worlds: Worlds, lost: str) -> None:
    """Whether the newcomer misses the held tick or its word is lost, it hears the tick again until it is in."""
    # The first two come by themselves, with the token and with the news of it.
    bus = lossy_bus(hub, lose_first(lost, 4))
    world = worlds("robot_0", bus=None if lost == names.TICK else bus)
    world.open(1)
    Player(hub, "robot_0", bus=bus if lost == names.TICK else None).appear()
    assert world.wait()


@pytest.mark.usefixtures("hasty")
def test_asking_to_be_let_in_again_is_no_news(hub: MemoryHub, worlds: Worlds) -> None:
    """While somebody is absent, the held tick comes at its own pace, not with every word of those who are there."""
    world = worlds("robot_0", "tf")
    world.open(1)
    robot = Player(hub, "robot_0").appear()
    with listening() as log:
        world.begin()
        log.wait_for("the first tick is held")
        heard = len(robot.heard)
    # One a SHORT after a few at once, and the first complaint comes after one SHORT.
    assert heard < 12
    Player(hub, "tf").appear()
    assert world.end()
