"""The walls beside places and about a robot are those that a look at each hit finds; odd costs are assigned too."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from zteam.kernels import formations

Floats = NDArray[np.float64]
BODY, NARROW, ACROSS, OPPOSITE, FACING = 0.45, 1.5, 1.9, 2.1, 2.6
ANGLES = np.linspace(-2.0, 2.0, 30)
AXES = np.array((np.cos(ANGLES), np.sin(ANGLES)))
odd = st.sampled_from([math.nan, math.inf, 0.0])
scans = arrays(np.float64, ANGLES.size, elements=st.floats(0.05, 3.0) | odd)
points = st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)), max_size=3)


def hits_of(distances: Floats, mates: list[tuple[float, float]], bound: float) -> list[tuple[float, float, float]]:
    """Angle, x and y of those nearer than `bound` that are on no mate."""
    found = zip(ANGLES, *(AXES * distances), distances, strict=True)
    return [
        (angle, x, y)
        for angle, x, y, distance in found
        if distance < bound and all(math.hypot(x - mate[0], y - mate[1]) > BODY for mate in mates)
    ]


@given(scans, points, points, st.floats(-4.0, 4.0))
def test_the_nearest_walls_beside_places(
    distances: Floats, mates: list[tuple[float, float]], places: list[tuple[float, float]], yaw: float
) -> None:
    """To the left and to the right, from 0.5 m behind to 1 m ahead, within 1.2 m."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    rows = [(x, y, cos, sin) for x, y in places]
    offs = [
        cos * (y - b) - sin * (x - a)
        for _, x, y in hits_of(distances, mates, 2.5)
        for a, b in places
        if -0.5 < cos * (x - a) + sin * (y - b) < 1.0
    ]
    left = min([off for off in offs if 0.0 < off < 1.2], default=math.inf)
    right = min([-off for off in offs if -1.2 < off < 0.0], default=math.inf)
    found = formations.find_sides(AXES, distances, mates, BODY, 2.5, rows, (0.5, 1.0, 1.2))
    assert found == pytest.approx((left, right))


@given(scans, points)
def test_walls_on_both_sides(distances: Floats, mates: list[tuple[float, float]]) -> None:
    """The nearest hit, and the nearest one across."""
    hits = hits_of(distances, mates, NARROW)
    expected = False
    if hits:
        ranges = [math.hypot(x, y) for _, x, y in hits]
        nearest = min(range(len(hits)), key=lambda i: round(ranges[i], 9))
        turns = [abs(math.remainder(angle - hits[nearest][0], math.tau)) for angle, _, _ in hits]
        across = [i for i, turn in enumerate(turns) if turn > ACROSS]
        if across:
            other = min(across, key=lambda i: round(ranges[i], 9))
            least = FACING if other in (0, len(hits) - 1) else OPPOSITE
            expected = ranges[nearest] + ranges[other] < NARROW and turns[other] > least
    found = formations.is_between(AXES, distances, mates, BODY, ANGLES, (NARROW, ACROSS, OPPOSITE, FACING))
    assert found == expected


@pytest.mark.parametrize("cost", [math.nan, math.inf, -math.inf, 1e308])
def test_costs_that_are_no_number_are_the_highest(cost: float) -> None:
    """The assignment avoids them where it can, and is one all the same."""
    assert formations.assign(np.array([[cost, 1.0], [1.0, 5.0]])) == [1, 0]
    assert sorted(formations.assign(np.full((3, 3), cost))) == [0, 1, 2]
    assert formations.assign(np.empty((0, 0))) == []
