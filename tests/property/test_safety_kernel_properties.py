"""The kernels of the safety layer give what their formulas say, and whatever they are given is defined."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from zteam.geometry import Pose2, normalize_angle
from zteam.kernels import safety
from zteam.messages.base import DEFAULT_BASE
from zteam.robot.safety.motion import limits_of

Floats = NDArray[np.float64]
Triple = Sequence[float]
places, angles = st.floats(-2.0, 2.0), st.floats(-7.0, 7.0)
odd = st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -0.0, 1e-300, 1e300, -1e300]) | st.floats()
NEAR = 1e-9


def points(rows: int) -> st.SearchStrategy[Floats]:
    """(rows, n)."""
    return st.integers(0, 9).flatmap(lambda count: arrays(np.float64, (rows, count), elements=places))


@given(arrays(np.float64, (4, 3), elements=st.floats(-9.0, 9.0)), st.integers(0, 3))
def test_poses_in_the_frame_of_one_of_them(poses: Floats, own: int) -> None:
    """As Pose2 says, with yaws between -pi and pi."""
    for found, pose in zip(safety.see_poses(poses, own), poses.tolist(), strict=True):
        expected = Pose2(*poses[own].tolist()).inverse().compose(Pose2(*pose))
        assert math.isclose(found[0], expected.x, abs_tol=1e-13)
        assert math.isclose(found[1], expected.y, abs_tol=1e-13)
        assert abs(found[2]) <= math.pi
        assert abs(normalize_angle(found[2] - expected.yaw)) < 1e-13


LASERS = [(-2.356, 0.1, 48), (2.356, -0.1, 48), (-math.pi, math.tau / 36, 36), (0.3, 0.5, 40), (0.0, 0.0, 1)]
"""First angle, increment and number of beams: both ways round, a whole turn and more, one beam."""


@st.composite
def scans(draw: st.DrawFn) -> tuple[tuple[float, float], Floats, Floats]:
    """A laser, directions and distances."""
    start, step, count = draw(st.sampled_from(LASERS))
    directions = start + step * np.arange(count)
    distances = draw(arrays(np.float64, count, elements=st.floats(1e-6, 4.0) | st.sampled_from([math.nan, math.inf])))
    return (start, step), np.array((np.cos(directions), np.sin(directions))), distances


def see_slowly(
    known: Sequence[Triple], beams: Sequence[Triple], laser: tuple[float, float], few: int, place: Triple,
    far: float, way: float, oldest: float,
) -> list[Triple]:  # fmt: skip
    """What the kernel is to give, point by point: x, y, when after a scan with beams (cosine, sine, distance)."""
    (start, step), (x, y), found = laser, place, []
    step = math.copysign(max(abs(step), 1e-6), step)
    for point in known:
        away = math.hypot(point[0] - x, point[1] - y)
        at = round((math.atan2(point[1] - y, point[0] - x) - start) / step) % max(1, round(math.tau / abs(step)))
        is_told = at < len(beams) and beams[at][2] >= away - 0.05
        if away <= far and point[2] >= oldest and not is_told:
            found.append(point)
    for first in range(0, len(beams), few):
        hits = [beam for beam in beams[first : first + few] if beam[2] < far]
        if hits:
            cosine, sine, distance = min(hits, key=lambda beam: beam[2])
            found.append((x + distance * cosine, y + distance * sine, way))
    return found


@given(points(3), scans(), st.integers(1, 5), st.tuples(places, places), st.floats(0.0, 5.0), places)
def test_a_scan_tells_of_points_and_adds_its_hits(
    known: Floats,
    scan: tuple[tuple[float, float], Floats, Floats],
    few: int,
    place: tuple[float, float],
    far: float,
    oldest: float,
) -> None:
    """As the slow loop does; points between two beams, at the laser or straight behind it are not drawn."""
    laser, axes, distances = scan
    for x, y, _ in known.T.tolist():
        assume(abs(y - place[1]) > NEAR)
        turned = (math.atan2(y - place[1], x - place[0]) - laser[0]) / max(abs(laser[1]), 1e-6)
        assume(abs(turned - math.floor(turned) - 0.5) > NEAR * max(1.0, abs(turned)))
        assume(abs(math.hypot(x - place[0], y - place[1]) - far) > NEAR)
        assume((abs(np.nan_to_num(distances, posinf=9.0) + 0.05 - math.hypot(x - place[0], y - place[1])) > NEAR).all())
    beams = list(zip(*axes.tolist(), distances.tolist(), strict=True))
    expected = see_slowly(known.T.tolist(), beams, laser, few, place, far, 7.0, oldest)
    found = safety.see(known, axes, distances, laser, few, place, far, 7.0, oldest)
    assert found.shape == (3, len(expected))
    assert np.allclose(found.T, np.reshape(expected, (-1, 3)), rtol=0.0, atol=1e-12)


@given(
    arrays(np.float64, (3, 4), elements=odd), arrays(np.float64, 5, elements=odd), st.lists(odd, min_size=9, max_size=9)
)
def test_odd_numbers_give_defined_results(known: Floats, distances: Floats, n: list[float]) -> None:
    """No number, infinity or magnitude leads out of an array: what was seen is some of the points, a time no NaN."""
    axes = np.resize(known, (2, 5))
    seen = safety.see(known, axes, distances, (n[0], n[1]), 2, (n[2], n[3]), n[5], n[6], n[7])
    assert seen.shape[1] <= 4 + 3
    assert safety.see(known, axes, distances, (0.0, 0.1), 2**63 - 1, (0.0, 0.0), 9.0, 0.0, 0.0).shape[1] <= 4 + 1
    assert not math.isnan(limits_of(DEFAULT_BASE).kernel.meet((n[0], n[1], n[2]), n[3], known[:2], n[4]))
    assert not math.isnan(safety.look_along(axes, distances, n[0], n[1]))
    assert safety.first_clear(axes, distances, n[0], n[1], np.array(n)) < len(n)
    assert len(safety.see_poses(known.T.copy(), 1)) == 4
    nearest, silent = safety.read_ranges(distances, n[0], n[1])
    assert nearest >= 0.0
    assert silent == np.isnan(distances).sum()


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda a: safety.BaseKernel(a.T, a[:, :2], a[:2]), "planes"),
        (lambda a: limits_of(DEFAULT_BASE).kernel.meet((0.0, 0.0, 0.0), 1.0, a[:1]), "points"),
        (lambda a: safety.see_poses(a[:, :2], 0), "poses"),
        (lambda a: safety.see_poses(a[:, :3].copy(), 3), "own"),
        (lambda a: safety.see(a, a[:2], a[2], (0.0, 0.1), 0, (0.0, 0.0), 1.0, 0.0, 0.0), "few"),
        (lambda a: safety.see(a[:2], a[:2], a[2], (0.0, 0.1), 1, (0.0, 0.0), 1.0, 0.0, 0.0), "known"),
        (lambda a: safety.look_along(a, a[2], 0.1, 0.0), "axes"),
        (lambda a: safety.look_along(a[:2, ::2], a[2, ::2], 0.1, 0.0), "axes"),
        (lambda a: safety.first_clear(a[:2], a[2], 0.1, 1.0, a), "headings"),
        (lambda a: safety.find_moves(a, 0.3, (), 0, (), (), (), a, 0.05, (0.0, 0.0, 0.0)), "headings"),
        (lambda a: safety.find_moves(a, 0.3, (), 0, (), (), (), np.full((16, 5), 3.0), 0.05, (0.0, 0.0, 0.0)), "headings"),
    ],
)
def test_what_does_not_fit_is_refused(call: Any, name: str) -> None:
    """Wrong shapes and orders of arrays: the argument is named."""
    with pytest.raises(ValueError, match=f"^{name}: "):
        call(np.ones((3, 4)))


@pytest.mark.parametrize("kind", ["float32", "int16", "float16", ">f8", "object"])
def test_arrays_of_another_type_are_refused(kind: str) -> None:
    """Also of types that the kernels lack altogether, and with bytes in another order."""
    with pytest.raises((TypeError, ValueError), match=r"^poses: |'double \*'"):
        safety.see_poses(np.ones((4, 3), kind), 0)
