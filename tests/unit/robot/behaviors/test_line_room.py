"""When a robot drives back from those ahead."""

import math

import pytest

from zteam.geometry import Pose2
from zteam.kernels.polylines import Polyline
from zteam.messages import RobotStatus, Twist, Vector3
from zteam.robot.behaviors.evasion import (
    MakingRoom,
    back_up,
    is_too_near,
)
from zteam.robot.behaviors.line import Line, LineRole
from zteam.robot.behaviors.path import SpeedLimits
from zteam.robot.behaviors.trail import Trail
from zteam.testing import make_view

LIMITS = SpeedLimits(0.7, math.pi)
AHEAD = Pose2(5.0, 0.0, 0.0)
"""The head, which drives away."""
GAP = 0.8
"""Metres to the place behind it."""
WAY = Polyline([(-5.0, 0.0), (5.0, 0.0)])


@pytest.mark.parametrize(
    ("ahead", "found"),
    [
        (Pose2(0.5, 0.0, 0.0), True),
        (Pose2(0.7, 0.0, 0.0), False),
        (Pose2(0.9, 0.0, math.pi), True),
        (Pose2(1.1, 0.0, math.pi), False),
        (Pose2(0.8, 0.5, math.pi), False),
        (Pose2(-0.5, 0.0, 0.0), False),
    ],
)
def test_it_drives_back_from_what_is_near_or_comes_towards_it(ahead: Pose2, found: bool) -> None:
    """Within 0.58 m, or 1 m of a robot that has this one ahead and is not beside it; never from one behind it."""
    assert is_too_near(ahead) is found


def step(
    room: MakingRoom,
    seconds: float,
    x: float = 1.0,
    *,
    head: Pose2 = AHEAD,
    blocked_by: int = -1,
    driven_on: float = 0.0,
) -> tuple[Twist, str] | None:
    """What robot 1 does at x on the x axis, in a large hall. Its head (in the own base frame) may be blocked by it."""
    own = Pose2(x, 0.0, 0.0)
    view = make_view(
        [5.0] * 180, now=seconds, poses={0: own.compose(head), 1: own}, robot_id=1,
        inputs={"statuses": {0: RobotStatus(blocked_by=blocked_by)}},
    )  # fmt: skip
    role = Line().find_role(view, 0)
    command, does = room.step(view, own, role, own.compose(head), GAP, LIMITS, driven_on=driven_on)
    return (command or back_up(own, WAY, 5.0 + x), does) if does else None


def test_a_robot_in_the_way_of_its_head_drives_back_until_that_has_room() -> None:
    """It begins when its head says that this robot stops it, and goes on while the head is within 1 m."""
    room, near, far = MakingRoom(), Pose2(0.7, 0.0, 0.0), Pose2(1.1, 0.0, 0.0)
    assert step(room, 1.0, head=near) is None
    told = step(room, 1.1, head=near, blocked_by=1)
    assert told == (Twist(Vector3(-0.2)), "makes room for robot_0")
    assert step(room, 1.2, head=near) == told
    assert step(room, 1.3, head=far) is None
    assert step(room, 1.4, head=near) is None


def test_a_robot_that_has_led_does_not_go_back_to_the_trail_that_it_left() -> None:
    """It was led away from that trail, a wall may be between: its new one begins where it is."""
    trail, role = Trail(), LineRole((0,), may_turn=True)

    def follow(seconds: float, own: Pose2) -> Twist:
        view = make_view([5.0] * 180, now=seconds, poses={0: Pose2(2.0, 2.0, 0.0), 1: own}, robot_id=1)
        return trail.step(view, own, role, GAP, math.inf, LIMITS)[0]

    follow(1.0, Pose2(0.0, 0.0, 0.0))
    trail.forget()
    command = follow(1.1, Pose2(2.0, 0.0, 0.5 * math.pi))
    assert command.linear.x > 0.0
    assert abs(command.angular.z) < 0.1
