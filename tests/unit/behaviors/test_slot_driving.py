"""Getting past each other."""

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from zteam.behaviors.slot_driving import HORIZON, Other, Others, Target, drive_to, give_way, meets
from zteam.geometry import Pose2
from zteam.testing import make_view

ORIGIN = Pose2(0.0, 0.0, 0.0)
ROOM = 0.6
speeds = st.floats(-1.0, 1.0)
others = st.lists(st.builds(Other, st.floats(-3, 3), st.floats(-3, 3), speeds, speeds), max_size=5)


def apart(x: float, y: float, other: Other, seconds: float) -> float:
    """Metres to another robot in so many seconds, both straight on."""
    return math.hypot(other.x + (other.velocity_x - x) * seconds, other.y + (other.velocity_y - y) * seconds)


def test_a_free_way_is_taken() -> None:
    """No other robot, one far away, one that drives away: the velocity stays."""
    for around in ([], [Other(5.0, 0.0)], [Other(1.0, 0.0, 0.5, 0.0)], [Other(-0.3, 0.0)]):
        assert give_way(ORIGIN, 0.4, 0.0, around, ROOM) == pytest.approx((0.4, 0.0))


def test_head_on_it_goes_to_the_right() -> None:
    """As on a road."""
    x, y = give_way(ORIGIN, 0.4, 0.0, [Other(1.5, 0.0, -0.4, 0.0)], ROOM)
    assert x > 0.0
    assert y < 0.0


def test_behind_a_slower_one_it_slows_down() -> None:
    """Rather than to leave its way by a right angle."""
    x, y = give_way(ORIGIN, 0.8, 0.0, [Other(0.9, 0.0, 0.4, 0.0), Other(0.9, -0.7, 0.4, 0.0)], ROOM)
    assert 0.0 < x <= 0.7
    assert abs(y) <= 0.6 * x


def test_hemmed_in_it_stands() -> None:
    """With robots on all sides there is no velocity left."""
    ring = [Other(0.65 * math.cos(turn), 0.65 * math.sin(turn)) for turn in (-2, -1.5, -1, -0.5, 0, 0.5, 1, 1.5, 2)]
    assert give_way(ORIGIN, 0.4, 0.0, ring, ROOM) == (0.0, 0.0)


def test_what_comes_after_its_arrival_does_not_count() -> None:
    """A robot that is in its slot before they meet drives there."""
    crossing = [Other(1.0, 0.0)]
    assert give_way(ORIGIN, 0.4, 0.0, crossing, ROOM, 0.5) == pytest.approx((0.4, 0.0))
    assert give_way(ORIGIN, 0.4, 0.0, crossing, ROOM) != pytest.approx((0.4, 0.0))


def test_a_heading_that_does_not_point_along_the_velocity_is_looked_at_too() -> None:
    """A robot that still turns drives along its heading: not into one that stands there, but past one beside it."""
    mate = [Other(0.7, 0.0, robot=7)]
    assert meets(ORIGIN, 0.4, 0.0, mate, 0.45, 1.0) == 7
    assert meets(ORIGIN, 0.0, 0.4, mate, 0.45, 1.0) is None
    assert meets(ORIGIN, 0.2, 0.0, mate, 0.45, 1.0) is None
    assert meets(ORIGIN, 0.0, 0.0, mate, 0.45, 1.0) is None
    slot = Target(Pose2(1.0, 1.2, 0.0), 0.0, 0.0)
    command, waits_for = drive_to(ORIGIN, slot, [Other(0.5, 0.0, robot=7)], 0.3, 1.0, 2.0)
    assert (command.linear.x, waits_for) == (0.0, 7)
    assert command.angular.z > 0.0


@given(speeds, speeds, others)
@example(-1e-198, 0.0, [Other(-1.0, 0.0)])
def test_no_robot_is_driven_into(x: float, y: float, around: list[Other]) -> None:
    """A robot that is not near yet keeps its distance, while all drive straight on; it is never faster than asked."""
    taken = give_way(ORIGIN, x, y, around, ROOM)
    assert math.hypot(*taken) <= math.hypot(x, y) + 1e-9
    if taken == (0.0, 0.0):
        return
    for other in around:
        now = apart(*taken, other, 0.0)
        least = min(apart(*taken, other, step * HORIZON / 50) for step in range(51))
        assert least >= min(ROOM, now) - 0.02


def test_velocities_come_from_two_poses() -> None:
    """A robot that was seen once stands, one that was seen twice moves, and one that is not seen is forgotten."""
    known = Others()
    first = known.take(make_view(poses={0: (0, 0, 0), 1: (1, 0, 0)}, now=1.0), ORIGIN, {1})
    assert first[1].speed == 0.0
    second = known.take(make_view(poses={0: (0, 0, 0), 1: (1.1, 0, 0)}, now=1.5), ORIGIN, {1})
    assert (second[1].velocity_x, second[1].velocity_y) == pytest.approx((0.2, 0.0))
    assert known.take(make_view(poses={0: (0, 0, 0)}, now=2.0), ORIGIN, {1}) == {}
