"""Polyline: places, projection, curvature, and what is dropped, on paths that can be computed by hand."""

import math

import pytest

from zteam.behaviors.polyline import Polyline
from zteam.geometry import Pose2


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
