"""Getting past what stands between."""

import math

import pytest

from support.flat_floor import BEAMS, make_scan, make_view
from zteam.behaviors import View
from zteam.geometry import Pose2
from zteam.messages import Twist
from zteam.robot.behaviors.evasion import Around
from zteam.robot.behaviors.path import SpeedLimits

LIMITS = SpeedLimits(0.7, math.pi)


def look(*mates: tuple[float, float]) -> View:
    """An open floor with the robots 1, 2, ... at these places of the own base frame."""
    frames = {f"robot_{i}/base_footprint": (Pose2(x, y, 0.0), 0) for i, (x, y) in enumerate([(0.0, 0.0), *mates])}
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


@pytest.mark.parametrize("y", [0.2, -0.2])
def test_a_robot_in_the_way_is_passed_on_the_side_with_more_room(y: float) -> None:
    """Slower than on a free way."""
    command = go(look((0.9, y)), 3.0, 0.0)
    assert command.angular.z * y < 0.0
    assert command.linear.x < LIMITS.linear


def test_the_robot_that_is_driven_to_is_not_in_the_way() -> None:
    """Nor is one that stands beyond the place."""
    assert go(look((0.9, 0.0)), 0.9, 0.0, but=1).angular.z == 0.0
    assert go(look((0.9, 0.0)), 0.9, 0.0).angular.z != 0.0
    assert go(look((0.9, 0.0)), 0.4, 0.0).angular.z == 0.0


def test_it_keeps_the_side_until_the_way_is_clear() -> None:
    """Where the robot in the way is a little on the other side now, it goes on to the same side."""
    around = Around()
    first = around.drive_to(look((0.9, -0.05)), 3.0, 0.0, LIMITS)
    assert first.angular.z > 0.0
    assert around.drive_to(look((0.9, 0.05)), 3.0, 0.0, LIMITS).angular.z > 0.0
    around.drive_to(look(), 3.0, 0.0, LIMITS)
    assert around.drive_to(look((0.9, 0.1)), 3.0, 0.0, LIMITS).angular.z < 0.0
