"""A robot does not drive by a scan while it is not known where its laser is."""

from collections.abc import Iterator

import pytest

from support.real_time_robot import TICK, RealTimeRobot
from support.transforms import stamped
from zteam.behaviors import Behavior, View
from zteam.messages import RobotState, TeamState, TeamStatus, TFMessage, Twist, Vector3, time_from_ns

LACKS = "its laser's frame robot_1/eye (robot_1/tf_static, from its base)"


class Onward(Behavior):
    """Straight on, and notes where its laser is."""

    def step(self, view: View) -> Twist:
        return Twist(Vector3(0.3, y=view.laser[0]))


@pytest.fixture(params=[True, False], ids=["gate", "no gate"])
def robot(request: pytest.FixtureRequest) -> Iterator[RealTimeRobot]:
    """With and without the start gate."""
    made = RealTimeRobot(Onward, gate=request.param)
    yield made
    made.close()


def say_eye(robot: RealTimeRobot, parent: str) -> None:
    """Its base publishes where its laser is."""
    robot.say_fixed(TFMessage([stamped(parent, "eye", 0, 0.2)]))


def step(robot: RealTimeRobot, tick: int) -> Twist:
    """Its command for a scan in the laser's frame."""
    before = len(robot.commands)
    robot.say_odometry(tick)
    robot.say_time(tick)
    robot.say_transforms(tick)
    robot.say_scan(tick, frame="eye")
    robot.wait_for_commands(before + 1)
    return robot.commands[-1]


def test_before_go_the_frame_is_what_it_waits_for() -> None:
    """It is not ready and names the frame; when its base says where that is, it is ready."""
    robot = RealTimeRobot(Onward, gate=True)
    try:
        robot.say_base_info()
        robot.say_statics()
        robot.say_odometry(1)
        robot.say_transforms(1)
        for tick, frame, lacks in (
            (1, "eye", LACKS),
            (2, "", "a frame_id in the header of its scans"),
            (3, "eye", LACKS),
        ):
            robot.say_time(tick)
            robot.say_scan(tick, frame=frame)
            robot.wait_for_text(f"waiting for {lacks}")
        say_eye(robot, "base_link")
        robot.say_fixed(TFMessage([stamped("base_footprint", "base_link", 0)]))
        robot.say_time(4)
        robot.say_scan(4, frame="eye")
        robot.wait_for_status(lambda status: status.state == RobotState.READY)
    finally:
        robot.close()


def test_a_robot_that_drives_stands_when_the_frame_is_lost(robot: RealTimeRobot) -> None:
    """It says why, and drives on when the frame is there again. It needs no aggregator to know where its laser is."""
    say_eye(robot, "base_footprint")
    robot.ready(1)
    robot.say_scan(2, frame="eye")
    robot.say_team(TeamStatus(state=TeamState.GO, epoch=1, go_stamp=time_from_ns(2 * TICK)))
    for tick in range(3, 6):
        command = step(robot, tick)
    assert command.linear.x == 0.3
    say_eye(robot, "nowhere")
    for tick in range(6, 10):
        command = step(robot, tick)
    assert command == Twist()
    robot.wait_for_text(f"needs {LACKS}")
    say_eye(robot, "base_footprint")
    for tick in range(10, 14):
        command = step(robot, tick)
    assert command.linear.x == 0.3
    robot.wait_for_text("")


def test_without_a_safety_layer_the_behaviour_is_not_asked() -> None:
    """`--no-safety` leaves obstacles to the behaviour, which cannot see them in such a scan either."""
    robot = RealTimeRobot(Onward, safety=False)
    try:
        robot.ready(1)
        assert step(robot, 2) == Twist()
        robot.wait_for_status(lambda status: status.reason == f"needs {LACKS}")
    finally:
        robot.close()
