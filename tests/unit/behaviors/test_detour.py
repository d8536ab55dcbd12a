"""detour: paths are bent around robots that stand on them."""

import math

import pytest

from support.flat_floor import make_scan
from support.flat_floor import make_view as view_of
from zteam.behaviors.detour import Detour, Standing, find_standing
from zteam.behaviors.polyline import Polyline
from zteam.behaviors.view import View
from zteam.geometry import Pose2
from zteam.messages import LaserScan
from zteam.testing import make_view

DISTANCE = 0.6
PATH = Polyline([(0.0, 0.0), (6.0, 0.0)])


def seeing(scan: LaserScan | None = None) -> View:
    """The view of robot 1 at the origin of the map."""
    return view_of(scan, robot_id=1, lookup=lambda _target, _source: (Pose2(0.0, 0.0, 0.0), 0))


def wall_at(y: float) -> LaserScan:
    """A wall along the x axis at this y."""
    angles = [math.radians(degrees - 135) for degrees in range(271)]
    return make_scan([y / math.sin(a) if y * math.sin(a) > 0.05 else 30.0 for a in angles])


def nearest(path: Polyline, x: float, y: float) -> float:
    """Metres from the path to a point."""
    at = path.at(path.project(x, y))
    return math.hypot(at.x - x, at.y - y)


@pytest.mark.parametrize("x", [0.7, 1.5])
@pytest.mark.parametrize("y", [-0.5, -0.2, 0.0, 0.2, 0.5])
def test_a_path_is_bent_around_what_stands_on_it(x: float, y: float) -> None:
    """It keeps its distance, swings out on the shorter side, and ends where it was."""
    bent = Detour().bend(seeing(), PATH, 0.0, [Standing(x, y, DISTANCE)])
    assert bent is not None
    assert nearest(bent, x, y) > DISTANCE - 0.03
    side = bent.at(bent.project(x, 1.0 if y <= 0.0 else -1.0)).y
    assert side * y <= 0.0
    assert abs(side) == pytest.approx(DISTANCE - abs(y), abs=0.03)
    assert bent.last == pytest.approx((3.3, 0.0), abs=0.05)


@pytest.mark.parametrize(("x", "y"), [(4.0, 0.0), (1.0, 0.61), (1.0, -0.61), (-0.7, 0.0)])
def test_what_is_far_or_beside_bends_nothing(x: float, y: float) -> None:
    """A robot that stands further ahead, beside the path, or behind its beginning is not in the way."""
    assert Detour().bend(seeing(), PATH, 0.0, [Standing(x, y, DISTANCE)]) is None


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_passes_where_there_is_room(side: float) -> None:
    """With a wall near on one side it takes the other, also if that is the longer way."""
    bent = Detour().bend(seeing(wall_at(0.7 * side)), PATH, 0.0, [Standing(1.5, -0.05 * side, DISTANCE)])
    assert bent is not None
    assert bent.at(bent.project(1.5, -side)).y * side < -0.5


def test_two_that_stand_together_are_passed_on_one_side() -> None:
    """The side that was begun with is kept until nothing is in the way, and chosen anew then."""
    detour, both = Detour(), [Standing(1.0, -0.1, DISTANCE), Standing(1.8, 0.2, DISTANCE)]
    bent = detour.bend(seeing(), PATH, 0.0, both)
    assert bent is not None
    assert min(nearest(bent, robot.x, robot.y) for robot in both) > DISTANCE - 0.03
    assert min(bent.at(0.1 * i).y for i in range(35)) >= 0.0
    bent = detour.bend(seeing(), PATH, 1.2, both[1:])
    assert bent is not None
    assert bent.at(bent.project(1.8, 1.0)).y > 0.7
    assert detour.bend(seeing(), PATH, 4.0, both) is None
    bent = detour.bend(seeing(), PATH, 0.0, both[1:])
    assert bent is not None
    assert bent.at(bent.project(1.8, -1.0)).y < -0.3


def test_where_the_others_stand_is_asked_of_transforms() -> None:
    """A robot without a pose is nowhere; the distance is what both bases need, and a margin."""
    found = find_standing(make_view(robot_id=1, poses={0: (2.0, 1.0, 0.5), 1: (0.0, 0.0, 0.0)}), [0, 7])
    assert found == [Standing(2.0, 1.0, pytest.approx(0.175 + math.hypot(0.225, 0.175) + 0.2))]
