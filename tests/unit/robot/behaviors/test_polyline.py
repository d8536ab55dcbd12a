"""Paths by arc length, and keeping to them."""

import math

import pytest

from support.flat_floor import drive
from zteam.geometry import Pose2
from zteam.robot.behaviors.path import Polyline, SpeedLimits, pursue, slow_down


def corner() -> Polyline:
    """2 m along x, then 1 m along y."""
    return Polyline([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0)])


@pytest.mark.parametrize(
    ("s", "pose"),
    [
        (-1.0, Pose2(0.0, 0.0, 0.0)),
        (0.5, Pose2(0.5, 0.0, 0.0)),
        (2.0, Pose2(2.0, 0.0, math.pi / 2)),
        (2.25, Pose2(2.0, 0.25, math.pi / 2)),
        (9.0, Pose2(2.0, 1.0, math.pi / 2)),
    ],
)
def test_a_place_is_metres_along_the_path(s: float, pose: Pose2) -> None:
    """Between two points a place is interpolated, and a place beyond an end is that end."""
    assert corner().at(s) == pytest.approx(pose)


def test_a_point_twice_is_one_point() -> None:
    """A step of no length adds nothing, so that every piece has a direction."""
    path = Polyline([(1.0, 1.0), (1.0, 1.0), (1.0, 3.0), (1.0, 3.0 + 1e-12)])
    assert (len(path), path.end, path.last) == (2, 2.0, (1.0, 3.0))


@pytest.mark.parametrize(
    ("x", "y", "low", "high", "s"),
    [
        (1.0, 3.0, 0.0, 9.0, 3.0),
        (0.5, -2.0, 0.0, 9.0, 0.5),
        (1.5, 0.9, 0.0, 9.0, 2.9),
        (1.5, 0.9, 0.0, 1.8, 1.5),
        (0.5, 0.0, 1.0, 2.0, 1.0),
        (5.0, 0.5, 0.0, 2.25, 2.25),
        (0.0, 0.0, 7.0, 8.0, 3.0),
        (0.0, 0.0, 1.5, 1.0, 1.5),
    ],
)
def test_the_nearest_place_of_a_stretch(x: float, y: float, low: float, high: float, s: float) -> None:
    """Only places from `low` to `high` count, so a path that comes near itself is not confused."""
    assert corner().project(x, y, low, high) == pytest.approx(s)


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
    assert slow_down(0.5, curvature, limits) == pytest.approx(speed)
