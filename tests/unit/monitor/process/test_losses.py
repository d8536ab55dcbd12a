"""What the monitor tells of lost robots, hung robots and a lost router."""

import pytest

from support.monitor_desk import FLICKER, LOSS, RETURN, Open, Robot
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import FREEZES
from zteam.monitor.process.members import SILENT_AFTER


def test_a_token_that_only_flickers_is_no_loss(hub: MemoryHub, open_desk: Open) -> None:
    """A token that is back within the grace is not told; one that stays away is lost."""
    desk = open_desk(0, 1)
    robots = [Robot(hub, 0), Robot(hub, 1)]
    for robot in robots:
        robot.say()
        robot.vanish()
    desk.pass_by(FLICKER)
    robots[0].appear()
    desk.pass_by(LOSS)
    assert desk.told("lost", "back") == [("lost", 1)]


def test_a_name_is_lost_with_its_last_holder(hub: MemoryHub, open_desk: Open) -> None:
    """While another session holds the name of a robot that ends, the robot is not lost."""
    desk = open_desk(0)
    first, second = Robot(hub, 0), Robot(hub, 0)
    first.say()
    first.vanish()
    desk.pass_by(LOSS)
    assert (desk.told("lost"), desk.monitor.gate.ready) == ([], [0])
    second.vanish()
    desk.pass_by(LOSS)
    assert desk.told("lost") == [("lost", 0)]


def test_a_lost_router_is_no_lost_team(hub: MemoryHub, open_desk: Open) -> None:
    """Tokens that vanish just before the link are told as one lost router, and their return is not told."""
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
    """No robot would get it; it is given when the router is back."""
    desk = open_desk(0)
    robot = Robot(hub, 0)
    desk.link.set_link(False)
    robot.say()
    desk.look()
    assert desk.told("go") == []
    desk.link.set_link(True)
    desk.event("go")


def test_tokens_may_vanish_after_the_link(hub: MemoryHub, open_desk: Open) -> None:
    """Robots have time to come back, also when the link is told before the tokens."""
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


def test_a_robot_that_died_while_the_router_was_away_is_lost(hub: MemoryHub, open_desk: Open) -> None:
    """A robot is told as lost if its token stays away when the router is back."""
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


def test_no_robot_is_silent_without_a_router(hub: MemoryHub, open_desk: Open) -> None:
    """Robots are not told as silent while the router is away, nor at once when it is back."""
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
    assert desk.event("silent", 0).text == "does not answer for 4 s"
    robot.say()
    desk.event("answers", 0)
    assert desk.told("lost") == []


@pytest.mark.parametrize(
    ("name", "gone", "back"),
    [
        (names.SIMULATOR, "the simulator is gone: time stands still", "the simulator is back"),
        (names.AGGREGATOR, "the aggregator is gone: there are no new transforms", "the aggregator is back"),
    ],
)
def test_a_server_that_is_gone_is_named(hub: MemoryHub, open_desk: Open, name: str, gone: str, back: str) -> None:
    """The simulator and the aggregator are told as gone and as back; the table's notes have it meanwhile."""
    desk = open_desk(0)
    bus = hub.bus()
    token = bus.declare_token(names.token_key(name, bus.instance))
    desk.look()
    token.close()
    desk.pass_by(FLICKER)
    assert desk.told("process") == []
    desk.pass_by(LOSS)
    assert [event.text for event in desk.events if event.kind == "process"] == [gone]
    assert gone in desk.monitor.watch.notes()
    bus.declare_token(names.token_key(name, bus.instance))
    desk.look()
    assert [event.text for event in desk.events if event.kind == "process"] == [gone, back]
    assert gone not in desk.monitor.watch.notes()


def test_an_aggregator_that_never_came_is_named(hub: MemoryHub, open_desk: Open) -> None:
    """Without one no poses are known; without a simulator nothing is wrong."""
    desk = open_desk(0)
    assert desk.monitor.watch.notes() == ["no aggregator yet (zteam-tf): poses are not known"]
    bus = hub.bus()
    bus.declare_token(names.token_key(names.AGGREGATOR, bus.instance))
    desk.look()
    assert desk.monitor.watch.notes() == []
    desk.link.set_link(False)
    desk.look()
    assert desk.monitor.watch.notes() == ["the router is lost: nothing can be heard"]


def test_a_monitor_that_was_frozen_accuses_no_robot(
    hub: MemoryHub, open_desk: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Silence during its freeze is its own; a robot that stays silent afterwards is reported."""
    desk = open_desk(0)
    robot = Robot(hub, 0)
    robot.say()
    desk.look()
    monkeypatch.setattr(FREEZES, "look", lambda: 1.0)
    desk.pass_by(SILENT_AFTER * 3)
    assert desk.told("silent") == []
    desk.pass_by(SILENT_AFTER * 1.1)
    assert desk.told("silent") == [("silent", 0)]


def test_a_monitor_that_hears_nobody_accuses_no_robot(hub: MemoryHub, open_desk: Open) -> None:
    """The router may be silent: no process answers."""
    desk = open_desk(0)
    robot = Robot(hub, 0, answers=False)
    robot.say()
    desk.look()
    desk.pass_by(SILENT_AFTER * 3)
    assert desk.told("silent") == []
