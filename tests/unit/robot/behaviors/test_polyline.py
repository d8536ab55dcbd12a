"""Paths by arc length, and keeping to them."""

import math

import pytest

from support.flat_floor import TICK, drive
from zteam.geometry import Pose2
from zteam.robot.behaviors.polyline import LOOK_AHEAD, Polyline, SpeedLimits, pursue, slow_down


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


def test_one_point_is_a_path_without_length() -> None:
    """Each place is that point, and each point projects onto it."""
    path = Polyline([(3.0, 4.0)])
    assert path.at(1.0) == Pose2(3.0, 4.0, 0.0)
    assert path.project(9.0, 9.0) == 0.0


def test_a_path_without_points_has_no_place() -> None:
    """It says so by the error of an empty list."""
    with pytest.raises(IndexError):
        Polyline().at(0.0)
    with pytest.raises(IndexError):
        Polyline().project(0.0, 0.0)


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


def test_what_is_dropped_leaves_all_other_places() -> None:
    """Memory shrinks, places stay what they were, and a dropped place is the new beginning."""
    path = Polyline([(0.1 * i, 0.0) for i in range(1000)])
    path.drop_before(90.0)
    assert path.start == 90.0
    assert len(path) < 200
    assert path.at(95.25) == pytest.approx(Pose2(95.25, 0.0, 0.0))
    assert path.at(3.0) == pytest.approx(Pose2(90.0, 0.0, 0.0))
    assert path.project(0.0, 1.0) == 90.0
    path.drop_before(3.0)
    assert path.start == 90.0


def test_a_path_may_be_dropped_to_its_end() -> None:
    """Its end remains, with its direction, and it grows on from there."""
    path = Polyline([(0.1 * i, 0.0) for i in range(1000)])
    path.drop_before(1e9)
    assert path.start == path.end
    assert path.at(0.0) == pytest.approx(Pose2(99.9, 0.0, 0.0))
    path.append(99.9, 1.0)
    assert path.at(path.end) == pytest.approx(Pose2(99.9, 1.0, math.pi / 2))


def test_a_path_is_cut_back() -> None:
    """It ends where it was cut, and goes on from there."""
    path = corner()
    path.cut_after(1.5)
    assert path.end == pytest.approx(1.5)
    assert path.last == pytest.approx((1.5, 0.0))
    path.append(1.5, -1.0)
    assert path.at(2.0) == pytest.approx(Pose2(1.5, -0.5, -math.pi / 2))
    path.cut_after(9.0)
    assert path.end == pytest.approx(2.5)


def test_a_path_is_not_cut_before_its_beginning() -> None:
    """What was dropped does not come back: the path becomes its beginning."""
    path = corner()
    path.drop_before(1.0)
    path.cut_after(0.5)
    assert (path.start, path.end) == (1.0, 1.0)
    assert path.last == pytest.approx((1.0, 0.0))


def test_nothing_is_cut_from_nothing() -> None:
    """A path without points stays one."""
    path = Polyline()
    path.cut_after(0.0)
    path.drop_before(1.0)
    assert (len(path), path.start, path.end) == (0, 0.0, 0.0)


STRAIGHT = Polyline([(0.0, 0.0), (10.0, 0.0)])
LIMITS = SpeedLimits(linear=0.7)


def follow(path: Polyline, pose: Pose2, speed: float, seconds: float) -> tuple[Pose2, list[float]]:
    """Where a robot gets to along a path, and how far off it was in each tick."""
    s, off = 0.0, []
    for _ in range(round(seconds * 1e9 / TICK)):
        s = path.project(pose.x, pose.y, s, s + 0.5)
        place = path.at(s)
        off.append(math.hypot(place.x - pose.x, place.y - pose.y))
        pose = drive(pose, pursue(pose, path, s, speed, LIMITS), TICK / 1e9)
    return pose, off


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


def test_it_drives_on_where_the_path_comes_back_to_it() -> None:
    """The point ahead is the robot's own place, because the path turns round half way to it: it drives to the turn."""
    there_and_back = Polyline([(0.0, 0.0), (2.0, 0.0), (2.0 - 0.5 * LOOK_AHEAD, 0.0), (0.0, 3.0)])
    place = 2.0 - 0.5 * LOOK_AHEAD
    command = pursue(Pose2(place, 0.0, 0.0), there_and_back, place, 0.5, LIMITS)
    assert (command.linear.x, command.angular.z) != (0.0, 0.0)


@pytest.mark.parametrize("speed", [0.0, -0.5])
def test_it_stands_when_told_to(speed: float) -> None:
    """Without a speed ahead it neither drives nor turns."""
    command = pursue(Pose2(1.0, 0.5, 2.0), STRAIGHT, 1.0, speed, LIMITS)
    assert (command.linear.x, command.angular.z) == (0.0, 0.0)


def test_it_does_not_swing_at_the_end() -> None:
    """Behind its end the path is taken to go straight on, however near the end is."""
    command = pursue(Pose2(9.99, 0.005, 0.0), STRAIGHT, 9.99, 0.5, LIMITS)
    assert command.linear.x == 0.5
    assert abs(command.angular.z) < 0.1


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


@pytest.mark.parametrize("beside", [0.5, -0.5])
def test_it_comes_back_from_the_side(beside: float) -> None:
    """From half a metre beside a straight path it is on it after 3 s."""
    pose, off = follow(STRAIGHT, Pose2(0.0, beside, 0.0), 0.5, 5.0)
    assert max(off[30:]) < 0.02
    assert abs(pose.yaw) < 0.05


@pytest.mark.parametrize("radius", [0.5, 1.0, 3.0])
def test_it_keeps_to_a_circle(radius: float) -> None:
    """At 0.5 m/s it is never further than 2 cm from a circle on which it began."""
    angles = [i * 0.02 / radius for i in range(1000)]
    path = Polyline([(radius * math.sin(a), radius - radius * math.cos(a)) for a in angles])
    _, off = follow(path, Pose2(0.0, 0.0, 0.0), 0.5, 20.0)
    assert max(off) < 0.02
