"""Keeping to a path."""

import math

import pytest

from support.flat_floor import drive
from zteam.geometry import Pose2
from zteam.kernels.polylines import Polyline
from zteam.robot.behaviors.path import SpeedLimits, pursue

STRAIGHT = Polyline([(0.0, 0.0), (10.0, 0.0)])
LIMITS = SpeedLimits(linear=0.7)


@pytest.mark.parametrize(
    ("pose", "turn"),
    [
        (Pose2(1.0, 0.0, 0.0), 0.0),
        (Pose2(1.0, 0.1, 0.0), -1.0),
        (Pose2(1.0, -0.1, 0.0), 1.0),
        (Pose2(1.0, 0.0, 0.1), -1.0),
    ],
)
def test_it_steers_back_to_the_path(pose: Pose2, turn: float) -> None:
    """Beside the path, or with another heading, it drives on and turns to the side of the path."""
    command = pursue(pose, STRAIGHT, 1.0, 0.5, LIMITS)
    assert command.linear.x == 0.5
    assert math.copysign(1.0, command.angular.z) * bool(command.angular.z) == turn


def test_the_arc_meets_the_point_ahead() -> None:
    """The velocity leads exactly through the point of the path that it looks at."""
    pose = Pose2(1.0, -0.15, 0.3)
    command = pursue(pose, STRAIGHT, 1.0, 0.5, LIMITS, look_ahead=0.4)
    ways = [drive(pose, command, 0.01 * i) for i in range(200)]
    assert min(math.hypot(way.x - 1.4, way.y) for way in ways) < 0.01


@pytest.mark.parametrize(("yaw", "turn"), [(2.0, -3.14), (-2.0, 3.14)])
def test_it_turns_on_the_spot_when_the_path_leads_elsewhere(yaw: float, turn: float) -> None:
    """More than a radian off it does not drive, and turns the shorter way round within its limit."""
    command = pursue(Pose2(1.0, 0.0, yaw), STRAIGHT, 1.0, 0.5, SpeedLimits(0.7, 3.14))
    assert (command.linear.x, command.angular.z) == (0.0, turn)


@pytest.mark.parametrize(
    ("limits", "curvature", "speed"),
    [
        (SpeedLimits(), 3.0, 0.5),
        (SpeedLimits(linear=0.3), 3.0, 0.3),
        (SpeedLimits(angular=1.0), 4.0, 0.25),
        (SpeedLimits(angular=1.0), -4.0, 0.25),
        (SpeedLimits(angular=1.0), 0.0, 0.5),
        (SpeedLimits(lateral=0.1), 2.5, 0.2),
        (SpeedLimits(lateral=0.1), 0.1, 0.5),
    ],
)
def test_it_slows_down_in_bends(limits: SpeedLimits, curvature: float, speed: float) -> None:
    """The speed is the largest within the limits of speed, turn and acceleration to the side."""
    aside = (1.0 - math.sqrt(1.0 - (0.2 * curvature) ** 2)) / curvature if curvature else 0.0
    command = pursue(Pose2(1.0, -aside, 0.0), STRAIGHT, 1.0, 0.5, limits, look_ahead=0.2)
    assert (command.linear.x, command.angular.z) == pytest.approx((speed, speed * curvature))
