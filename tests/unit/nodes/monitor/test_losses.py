"""What the monitor tells of lost robots, hung robots and a lost router."""

from support.monitor_desk import FLICKER, LOSS, RETURN, Open, Robot
from zteam.bus import MemoryHub
from zteam.nodes.monitor.members import SILENT_AFTER


def test_a_token_that_only_flickers_is_no_loss(hub: MemoryHub, open_desk: Open) -> None:
    """A token that is back within the grace was never gone; one that stays away is lost."""
    desk = open_desk(0, 1)
    robots = [Robot(hub, 0), Robot(hub, 1)]
    for robot in robots:
        robot.say()
        robot.vanish()
    desk.pass_by(FLICKER)
    robots[0].appear()
    desk.pass_by(LOSS)
    assert desk.told("lost", "back") == [("lost", 1)]


def test_a_lost_router_is_no_lost_team(hub: MemoryHub, open_desk: Open) -> None:
    """Tokens that vanish just before the link are told as one lost router, and come back without a word."""
    desk = open_desk(0, 1)
    robots = [Robot(hub, 0), Robot(hub, 1)]
    for robot in robots:
        robot.say()
        robot.vanish()
    desk.link.set_link(False)
    desk.pass_by(RETURN)
    desk.link.set_link(True)
    for robot in robots:
        robot.appear()
    desk.pass_by(RETURN)
    assert [e.text for e in desk.events if e.kind == "link"] == ["router lost", "router is back"]
    assert desk.told("lost", "back") == []


def test_no_go_without_a_router(hub: MemoryHub, open_desk: Open) -> None:
    """Nobody would hear it; it is given when the router is back."""
    desk = open_desk(0)
    robot = Robot(hub, 0)
    desk.link.set_link(False)
    robot.say()
    desk.look()
    assert desk.told("go") == []
    desk.link.set_link(True)
    desk.wait_for("go")


def test_tokens_may_vanish_after_the_link(hub: MemoryHub, open_desk: Open) -> None:
    """Which of both is told first is chance; robots get some time to come back in either case."""
    desk = open_desk(0)
    robot = Robot(hub, 0)
    robot.say()
    desk.link.set_link(False)
    robot.vanish()
    desk.pass_by(5.0)
    desk.link.set_link(True)
    desk.look()
    robot.appear()
    desk.pass_by(RETURN)
    assert desk.told("lost", "back") == []


def test_who_died_while_the_router_was_away_is_lost(hub: MemoryHub, open_desk: Open) -> None:
    """After the router is back, a robot whose token stays away is told as lost."""
    desk = open_desk(0, 1)
    robots = [Robot(hub, 0), Robot(hub, 1)]
    for robot in robots:
        robot.say()
        robot.vanish()
    desk.link.set_link(False)
    desk.pass_by(5.0)
    desk.link.set_link(True)
    robots[0].appear()
    for _ in range(20):
        desk.pass_by(1.0)
    assert desk.told("lost", "back") == [("lost", 1)]


def test_nobody_is_silent_without_a_router(hub: MemoryHub, open_desk: Open) -> None:
    """While the router is away the robots are not said to be silent, nor at once when it is back."""
    desk = open_desk(0)
    robot = Robot(hub, 0)
    robot.say()
    desk.link.set_link(False)
    desk.pass_by(SILENT_AFTER * 2)
    desk.link.set_link(True)
    desk.look()
    desk.pass_by(SILENT_AFTER * 0.9)
    assert desk.told("silent") == []
    desk.pass_by(SILENT_AFTER)
    assert desk.told("silent") == [("silent", 0)]


def test_a_hung_robot_is_named(hub: MemoryHub, open_desk: Open) -> None:
    """A living token without statuses is told as not answering, and never as lost."""
    desk = open_desk(0, 1)
    robot = Robot(hub, 0)
    robot.say()
    desk.pass_by(SILENT_AFTER + 1)
    assert desk.wait_for("silent", 0).text == "does not answer for 4 s"
    robot.say()
    desk.wait_for("answers", 0)
    assert desk.told("lost") == []
