"""The kernels of the safety layer give what their formulas say, and whatever they are given is defined."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from support import safety_references as slow
from zteam.kernels import safety
from zteam.robot.safety.motion import Outline

Floats = NDArray[np.float64]
places, angles = st.floats(-2.0, 2.0), st.floats(-7.0, 7.0)
odd = st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -0.0, 1e-300, 1e300, -1e300]) | st.floats()
EVERYWHERE = 0.0, 0.0, math.inf
NEAR = 1e-9


@st.composite
def outlines(draw: st.DrawFn) -> Floats:
    """Half-planes of a convex outline."""
    corners = draw(st.lists(st.tuples(places, places), min_size=3, max_size=7, unique=True))
    middle = np.mean(corners, axis=0)
    assume(min(np.ptp(np.array(corners) @ (math.cos(a), math.sin(a))) for a in np.linspace(0.0, math.pi, 16)) > 0.1)
    return Outline(tuple((x - middle[0], y - middle[1]) for x, y in corners)).rows


def points(rows: int) -> st.SearchStrategy[Floats]:
    """(rows, n)."""
    return st.integers(0, 9).flatmap(lambda count: arrays(np.float64, (rows, count), elements=places))


@given(outlines(), points(2), places, places, st.sampled_from([0.0, 1e-7]) | st.floats(-3.0, 3.0), st.floats(0.01, 0.5))
def test_a_base_meets_points_when_the_formulas_say_so(
    planes: Floats, given_points: Floats, x: float, y: float, turn: float, margin: float
) -> None:
    """On any arc, among any points; where a touch is a matter of rounding, either counts."""
    seconds = 2.0

    def first(room: float) -> float:
        if abs(turn) * seconds < 1e-5:
            return min([slow.meet_straight(*p, rows, (x, y), room) for p in given_points.T.tolist()], default=math.inf)
        centre, side = (-y / turn, x / turn), math.copysign(1.0, turn)
        met = [slow.meet_turning(*p, rows, centre, side, room) for p in given_points.T.tolist()]
        return min(met, default=math.inf) / abs(turn)

    rows = planes.tolist()
    found = safety.meet(given_points, planes, (x, y, turn), seconds, margin, EVERYWHERE)
    expected = [first(margin + off) for off in (-1e-6, 0.0, 1e-6)]
    assume(max(expected) - min(expected) < 1e-3 or all(each > seconds for each in expected))
    expected = [each if each <= seconds else math.inf for each in expected]
    assert min(expected) - 1e-6 <= found <= max(expected) + 1e-6


@given(points(3), places, places, st.floats(-10.0, 10.0))
def test_points_are_told_in_another_frame(known: Floats, x: float, y: float, turn: float) -> None:
    """As with the sine and cosine of `math`; what else is known of a point stays."""
    moved, cos, sin = known.copy(), math.cos(turn), math.sin(turn)
    safety.move_points(moved, x, y, turn)
    ahead, aside = known[0] - x, known[1] - y
    assert np.allclose(moved, (cos * ahead + sin * aside, cos * aside - sin * ahead, known[2]), rtol=0.0, atol=1e-13)


LASERS = [(-2.356, 0.1, 48), (2.356, -0.1, 48), (-math.pi, math.tau / 36, 36), (0.3, 0.5, 40), (0.0, 0.0, 1)]
"""First angle, increment and number of beams: both ways round, a whole turn and more, one beam."""


@st.composite
def scans(draw: st.DrawFn) -> tuple[tuple[float, float], Floats, Floats]:
    """A laser, directions and distances."""
    start, step, count = draw(st.sampled_from(LASERS))
    directions = start + step * np.arange(count)
    distances = draw(arrays(np.float64, count, elements=st.floats(1e-6, 4.0) | st.sampled_from([math.nan, math.inf])))
    return (start, step), np.array((np.cos(directions), np.sin(directions))), distances


@given(points(3), scans(), st.integers(1, 5), st.tuples(places, places, angles), st.floats(0.0, 5.0), places)
def test_a_scan_tells_of_points_and_adds_its_hits(
    known: Floats,
    scan: tuple[tuple[float, float], Floats, Floats],
    few: int,
    pose: tuple[float, float, float],
    far: float,
    oldest: float,
) -> None:
    """As the slow loop does; points between two beams, at the laser or straight behind it are not drawn."""
    laser, axes, distances = scan
    for x, y, _ in known.T.tolist():
        assume(abs(y - pose[1]) > NEAR)
        turned = (math.atan2(y - pose[1], x - pose[0]) - pose[2] - laser[0]) / max(abs(laser[1]), 1e-6)
        assume(abs(turned - math.floor(turned) - 0.5) > NEAR * max(1.0, abs(turned)))
        assume(abs(math.hypot(x - pose[0], y - pose[1]) - far) > NEAR)
        assume((abs(np.nan_to_num(distances, posinf=9.0) + 0.05 - math.hypot(x - pose[0], y - pose[1])) > NEAR).all())
    beams = list(zip(*axes.tolist(), distances.tolist(), strict=True))
    expected = slow.see(known.T.tolist(), beams, laser, few, pose, far, 7.0, oldest)
    found = safety.see(known, axes, distances, laser, few, pose, far, 7.0, oldest)
    assert found.shape == (3, len(expected))
    assert np.allclose(found.T, np.reshape(expected, (-1, 3)), rtol=0.0, atol=1e-12)


@given(scans(), st.floats(0.01, 1.0), st.lists(angles, max_size=5), st.floats(-1.0, 3.0))
def test_a_corridor_is_clear_up_to_its_nearest_hit(
    scan: tuple[tuple[float, float], Floats, Floats], half_width: float, headings: list[float], reach: float
) -> None:
    """As the slow loop finds, but for hits on the very edge; of many headings the first clear one is found."""
    _, axes, distances = scan
    beams = list(zip(*axes.tolist(), distances.tolist(), strict=True))
    rooms = [safety.look_along(axes, distances, half_width, heading) for heading in headings]
    for heading, room in zip(headings, rooms, strict=True):
        wide, narrow = (slow.look_along(beams, half_width + off, heading) for off in (NEAR, -NEAR))
        # A hit that is exactly beside the laser may count as before it.
        assert wide - NEAR <= room <= narrow + NEAR or room <= NEAR
    clear = [i for i, room in enumerate(rooms) if room >= reach]
    assert safety.first_clear(axes, distances, half_width, reach, np.array(headings)) == (clear[0] if clear else -1)


@given(
    arrays(np.float64, (3, 4), elements=odd), arrays(np.float64, 5, elements=odd), st.lists(odd, min_size=9, max_size=9)
)
def test_odd_numbers_give_defined_results(known: Floats, distances: Floats, n: list[float]) -> None:
    """No number, infinity or magnitude leads out of an array: what was seen is some of the points, a time no NaN."""
    axes = np.resize(known, (2, 5))
    seen = safety.see(known, axes, distances, (n[0], n[1]), 2, (n[2], n[3], n[4]), n[5], n[6], n[7])
    assert seen.shape[1] <= 4 + 3
    assert safety.see(known, axes, distances, (0.0, 0.1), 2**63 - 1, (0.0, 0.0, 0.0), 9.0, 0.0, 0.0).shape[1] <= 4 + 1
    for planes in (known.T.copy(), np.empty((0, 3))):
        assert not math.isnan(safety.meet(known[:2], planes, (n[0], n[1], n[2]), n[3], n[4], (n[5], n[6], n[7])))
    assert not math.isnan(safety.look_along(axes, distances, n[0], n[1]))
    assert safety.first_clear(axes, distances, n[0], n[1], np.array(n)) < len(n)
    safety.move_points(known, n[0], n[1], n[2])


def test_a_million_points_and_beams() -> None:
    """Large arrays are no special case."""
    known, axes, distances = np.ones((3, 10**6)), np.ones((2, 10**6)), np.full(10**6, 2.0)
    assert safety.see(known, axes, distances, (0.0, 1e-6), 1, (0.0, 0.0, 0.0), 9.0, 5.0, 0.0).shape == (3, 10**6)
    planes = Outline(((0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5), (0.5, -0.5))).rows
    assert safety.meet(known[:2], planes, (0.0, 1.0, 0.0), 9.0, 0.6, EVERYWHERE) == math.inf
    assert safety.meet(known[:2] * 0.9, planes, (1.0, 1.0, 0.0), 9.0, 0.1, EVERYWHERE) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda a: safety.meet(a[:1], a.T.copy(), (0.0, 0.0, 0.0), 1.0, 0.1, EVERYWHERE), "points"),
        (lambda a: safety.meet(a[:2], a.T, (0.0, 0.0, 0.0), 1.0, 0.1, EVERYWHERE), "planes"),
        (lambda a: safety.move_points(a.astype(np.float32), 0.0, 0.0, 0.0), "points"),
        (lambda a: safety.see(a, a[:2], a[2], (0.0, 0.1), 0, (0.0, 0.0, 0.0), 1.0, 0.0, 0.0), "few"),
        (lambda a: safety.see(a[:2], a[:2], a[2], (0.0, 0.1), 1, (0.0, 0.0, 0.0), 1.0, 0.0, 0.0), "known"),
        (lambda a: safety.look_along(a, a[2], 0.1, 0.0), "axes"),
        (lambda a: safety.look_along(a[:2, ::2], a[2, ::2], 0.1, 0.0), "axes"),
        (lambda a: safety.first_clear(a[:2], a[2], 0.1, 1.0, a), "headings"),
    ],
)
def test_what_does_not_fit_is_refused(call: Any, name: str) -> None:
    """Wrong types, shapes and orders of arrays: the argument is named."""
    with pytest.raises(ValueError, match=f"^{name}: "):
        call(np.ones((3, 4)))
