"""Any path: places, projection and what is dropped agree; any pose: pursuit gives a velocity within the limits."""

import math
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zteam.geometry import Pose2
from zteam.kernels.polylines import Polyline
from zteam.robot.behaviors.path import SpeedLimits, pursue

metres = st.floats(-50.0, 50.0, allow_subnormal=False)
points = st.lists(st.tuples(metres, metres), min_size=1, max_size=40)
shares = st.floats(0.0, 1.0)
near = 1e-6


def distance(a: Sequence[float], b: Sequence[float]) -> float:
    """Metres between two poses."""
    return math.dist(a[:2], b[:2])


@given(points, shares, shares)
def test_two_places_are_no_further_apart_than_the_path_between_them(
    points: list[tuple[float, float]], a: float, b: float
) -> None:
    """A step along the path is at least the straight way, and the ends are the first and the last point."""
    path = Polyline(points)
    s, t = a * path.end, b * path.end
    assert distance(path.at(s), path.at(t)) <= abs(s - t) + near
    assert path.at(0.0)[:2] == pytest.approx(points[0], abs=near)
    assert path.at(path.end)[:2] == pytest.approx(points[-1], abs=near)


@given(points, metres, metres, shares, shares, st.lists(shares, max_size=20))
def test_no_place_of_the_stretch_is_nearer_than_the_projection(
    points: list[tuple[float, float]], x: float, y: float, a: float, b: float, others: list[float]
) -> None:
    """The projection lies in the stretch, and no other place there is nearer."""
    path = Polyline(points)
    low, high = sorted((a * path.end, b * path.end))
    found, off = path.near((x, y), low, high)
    assert low - near <= found <= high + near
    here = Pose2(x, y, 0.0)
    assert distance(here, path.at(found)) == pytest.approx(off, abs=near)
    for share in others:
        assert distance(here, path.at(found)) <= distance(here, path.at(low + share * (high - low))) + near


@given(points, shares, shares)
def test_dropping_and_cutting_change_no_place_that_remains(
    points: list[tuple[float, float]], a: float, b: float
) -> None:
    """Places between what is dropped and what is cut are the same points as before."""
    whole, part = Polyline(points), Polyline(points)
    low, high = sorted((a * whole.end, b * whole.end))
    part.drop_before(low)
    part.cut_after(high)
    assert (part.start, part.end) == pytest.approx((low, high), abs=near)
    for s in (low, 0.5 * (low + high), high):
        assert distance(part.at(s), whole.at(s)) <= near


@given(points, st.floats(0.1, 2.0), st.integers(1, 30))
def test_a_path_that_is_dropped_behind_a_walker_stays_small(
    points: list[tuple[float, float]], step: float, rounds: int
) -> None:
    """However long it grows, it keeps as many points as the last metres have, and some to spare."""
    path = Polyline(points)
    for i in range(50 * rounds):
        path.append(100.0 + step * i, 0.0)
        path.drop_before(path.end - 5.0)
    assert len(path) <= 5.0 / step + 70 + len(points)
    assert path.end - path.start <= 5.0 + near


@given(
    points, st.builds(Pose2, metres, metres, st.floats(-4.0, 4.0)), shares, st.floats(-1.0, 2.0), st.floats(0.05, 3.0)
)
def test_pursuit_stays_within_the_limits(
    points: list[tuple[float, float]], pose: Pose2, share: float, speed: float, look_ahead: float
) -> None:
    """Wherever a robot is, on whatever path: finite, never backwards, within speed, turn and lateral acceleration."""
    path, limits = Polyline(points), SpeedLimits(0.7, 2.0, 0.5)
    command = pursue(pose, path, share * path.end, speed, limits, look_ahead)
    v, w = command.linear.x, command.angular.z
    assert 0.0 <= v <= max(0.0, min(speed, 0.7))
    assert abs(w) <= 2.0 + near
    assert abs(v * w) <= 0.5 + near
