"""detour: paths are bent around robots that stand on them."""

import math

import pytest

from support.flat_floor import make_scan
from support.flat_floor import make_view as view_of
from zteam.behaviors.detour import Detour, Standing, find_standing
from zteam.behaviors.polyline import Polyline
from zteam.behaviors.pursuit import Limits, pursue
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


OWN, TO, LIMITS = Pose2(0.0, 0.0, 0.1), Pose2(6.0, 0.0, 0.0), Limits(0.7, 3.0)
STANDING = [Standing(0.8, -0.1, DISTANCE)]
OTHER_DRIVES: dict[str, tuple[Pose2, Pose2, list[Standing], float, Limits]] = {
    "elsewhere": (Pose2(0.0, 0.01, 0.1), TO, STANDING, 0.5, LIMITS),
    "turned": (Pose2(0.0, 0.0, 0.11), TO, STANDING, 0.5, LIMITS),
    "to another place": (OWN, Pose2(6.0, 0.2, 0.0), STANDING, 0.5, LIMITS),
    "round one that moved": (OWN, TO, [Standing(0.8, -0.11, DISTANCE)], 0.5, LIMITS),
    "round a wider one": (OWN, TO, [Standing(0.8, -0.1, DISTANCE + 0.01)], 0.5, LIMITS),
    "round two": (OWN, TO, [*STANDING, Standing(1.0, 0.3, DISTANCE)], 0.5, LIMITS),
    "no robot stands": (OWN, TO, [], 0.5, LIMITS),
    "slower": (OWN, TO, STANDING, 0.4, LIMITS),
    "with other limits": (OWN, TO, STANDING, 0.5, Limits(0.3, 3.0)),
}


@pytest.mark.parametrize("other", OTHER_DRIVES)
def test_another_drive_is_not_taken_for_the_last_one(other: str) -> None:
    """After the same drive several times, each one with some other argument is as of a detour that knows no other."""
    detour, view = Detour(), seeing()
    for _ in range(3):
        first = detour.drive(view, OWN, TO, STANDING, 0.5, LIMITS)
        assert first[1]
        assert (first, detour.swing) == (detour.drive(view, OWN, TO, STANDING, 0.5, LIMITS), pytest.approx(0.5))
    fresh = Detour()
    found = detour.drive(view, *OTHER_DRIVES[other])
    assert found == fresh.drive(view, *OTHER_DRIVES[other])
    assert found != first
    assert detour.swing == fresh.swing


def test_a_drive_knows_a_side_that_was_chosen_meanwhile() -> None:
    """A path that is bent between two same drives may be passed on the other side: so is the drive."""
    detour, robot = Detour(), Standing(0.8, -0.1, DISTANCE)
    left, _ = detour.drive(seeing(), OWN, TO, [robot], 0.5, LIMITS)
    swing = detour.swing
    assert detour.bend(seeing(), PATH, 0.0, []) is None
    assert detour.drive(seeing(), OWN, TO, [robot], 0.5, LIMITS)[0] == left
    assert detour.swing == swing > 0.0
    assert detour.bend(seeing(), PATH, 4.0, [robot]) is None
    assert detour.bend(seeing(wall_at(0.7)), PATH, 0.0, [robot]) is not None
    right, _ = detour.drive(seeing(), OWN, TO, [robot], 0.5, LIMITS)
    assert left.angular.z > 0.0 > right.angular.z


def test_a_drive_is_along_the_whole_bent_path() -> None:
    """Although only its beginning is worked out."""
    standing = [*STANDING, Standing(1.8, 0.2, DISTANCE)]
    detour, way = Detour(), Polyline([OWN[:2], TO[:2]])
    bent = detour.bend(seeing(), way, 0.0, standing)
    assert bent is not None
    command, _ = Detour().drive(seeing(), OWN, TO, standing, 0.5, LIMITS)
    assert command == pursue(OWN, bent, 0.0, 0.5, LIMITS)


def test_the_caller_may_change_the_command_of_a_drive() -> None:
    """The next one is a new one."""
    detour = Detour()
    command, _ = detour.drive(seeing(), OWN, TO, STANDING, 0.5, LIMITS)
    speed, command.linear.x = command.linear.x, 9.0
    assert detour.drive(seeing(), OWN, TO, STANDING, 0.5, LIMITS)[0].linear.x == speed > 0.0
