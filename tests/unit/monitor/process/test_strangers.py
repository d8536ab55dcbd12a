"""Statuses of robots that neither a process nor the team knows."""

from support.monitor_desk import Open, Robot
from zteam.bus import MemoryHub
from zteam.messages import RobotState


def test_invented_robots_are_told_in_one_line(hub: MemoryHub, open_desk: Open) -> None:
    """A thousand faults of robots without a process make one line; a robot whose token comes after its status counts
    all the same.
    """
    desk = open_desk(team_size=1)
    desk.look()
    late = Robot(hub, 7, present=False)
    for number in range(100, 1100):
        Robot(hub, number, present=False).say(RobotState.FAULT, text="x")
        if number == 110:
            late.say()
    late.appear()
    assert desk.told("go")
    desk.pass_by(2.0)
    desk.pass_by(60.0)
    (line,) = [event.text for event in desk.events if event.kind == "strangers"]
    assert line == "robot_100 and 999 other robots have a status but no process: the monitor leaves such robots out"
    assert desk.told("fault") == []
    assert [*desk.monitor.gate.members] == [7]
