"""around: to a place past walls and robots."""

import math

import pytest

from support.flat_floor import BEAMS, make_scan, make_view
from zteam.behaviors import View
from zteam.behaviors.around import Around
from zteam.behaviors.pursuit import Limits
from zteam.geometry import Pose2
from zteam.messages import Twist

LIMITS = Limits(0.7, math.pi)


def look(*mates: tuple[float, float]) -> View:
    """An open floor with the robots 1, 2, ... at these places of the own base frame."""
    frames = {f"robot_{i}/base_footprint": (Pose2(x, y, 0.0), 0) for i, (x, y) in enumerate(mates, 1)}
    team = tuple(range(len(mates) + 1))
    return make_view(make_scan([30.0] * BEAMS), lookup=lambda _target, source: frames.get(source), team=team)


def go(view: View, x: float, y: float, but: int | None = None, room: float = 0.0) -> Twist:
    """One step towards (x, y)."""
    return Around().drive_to(view, x, y, LIMITS, but, room)


def test_a_free_way_is_driven_straight() -> None:
    """By the lectures' law, as fast as its limits allow."""
    command = go(look(), 1.0, 0.1)
    assert command.linear.x == pytest.approx(0.5 * math.hypot(1.0, 0.1))
    assert command.angular.z == pytest.approx(4.0 * math.atan2(0.1, 1.0))
    assert go(look(), 9.0, 0.0).linear.x == LIMITS.linear
    assert go(look(), 0.1, 1.0).angular.z == LIMITS.angular


@pytest.mark.parametrize("y", [0.3, -0.3])
def test_a_place_behind_is_turned_to_on_the_spot(y: float) -> None:
    """On the side where it is."""
    command = go(look(), -1.0, y)
    assert command.linear.x == 0.0
    assert command.angular.z * y > 0.0


@pytest.mark.parametrize("y", [0.2, -0.2])
def test_a_robot_in_the_way_is_passed_on_the_side_with_more_room(y: float) -> None:
    """Slower than on a free way."""
    command = go(look((0.9, y)), 3.0, 0.0)
    assert command.angular.z * y < 0.0
    assert command.linear.x < LIMITS.linear


@pytest.mark.parametrize("mate", [(0.9, 0.8), (1.5, 0.0), (-0.5, 0.0)])
def test_a_robot_that_is_not_in_the_way_changes_nothing(mate: tuple[float, float]) -> None:
    """Beside the way, far ahead, or behind."""
    assert go(look(mate), 3.0, 0.0) == go(look(), 3.0, 0.0)


def test_the_robot_that_is_driven_to_is_not_in_the_way() -> None:
    """Nor is one that stands beyond the place."""
    assert go(look((0.9, 0.0)), 0.9, 0.0, but=1).angular.z == 0.0
    assert go(look((0.9, 0.0)), 0.9, 0.0).angular.z != 0.0
    assert go(look((0.9, 0.0)), 0.4, 0.0).angular.z == 0.0


def test_what_stands_near_the_place_is_not_in_the_way() -> None:
    """The laser sees the robot that it drives to: within `room` metres of the place nothing counts."""
    ranges = [30.0] * BEAMS
    ranges[BEAMS // 2] = 0.4
    view = make_view(make_scan(ranges))
    assert go(view, 0.6, 0.0).angular.z != 0.0
    assert go(view, 0.6, 0.0, room=0.3).angular.z == 0.0


def test_it_keeps_the_side_until_the_way_is_clear() -> None:
    """Where the robot in the way is a little on the other side now, it goes on to the same side."""
    around = Around()
    first = around.drive_to(look((0.9, -0.05)), 3.0, 0.0, LIMITS)
    assert first.angular.z > 0.0
    assert around.drive_to(look((0.9, 0.05)), 3.0, 0.0, LIMITS).angular.z > 0.0
    around.drive_to(look(), 3.0, 0.0, LIMITS)
    assert around.drive_to(look((0.9, 0.1)), 3.0, 0.0, LIMITS).angular.z < 0.0
