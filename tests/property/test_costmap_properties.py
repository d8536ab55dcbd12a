"""Costmaps against distances found by looking at all cells, and compiled kernels against plain ones."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.examples import examples
from support.planning_cases import RESOLUTION, both_ways, random_cells, seeds, shares
from zteam.compiling.takeover import prepare
from zteam.geometry import Pose2
from zteam.planning.costmap import CostmapOptions, make_costmap
from zteam.planning.costs import LETHAL_OBSTACLE, NO_INFORMATION, inflated_cost
from zteam.planning.footprint import make_circle
from zteam.planning.grid import Frame, make_map
from zteam.planning.inflation import inflate
from zteam.planning.jit import PLANNING
from zteam.planning.raytracing import trace_beams


@pytest.fixture(autouse=True, scope="module")
def _compiled() -> None:
    prepare(PLANNING)


@examples(30)
@given(seeds, shares, st.floats(0.05, 1.0), st.floats(0.0, 0.4), st.floats(0.5, 20.0), st.booleans())
def test_a_costmap_is_that_of_a_brute_force_distance_field(
    seed: int, share: float, radius: float, inscribed: float, scaling: float, unknown: bool
) -> None:
    """Every cell has Nav2's cost for its distance to the nearest obstacle, found by looking at all of them."""
    occupied = random_cells(seed, 0.2 * share)
    cells = np.where(occupied, 100, 0).astype(np.int8)
    cells[np.random.default_rng(seed + 1).random(cells.shape) < 0.2 * unknown] = -1
    options = CostmapOptions(inflation_radius=radius, cost_scaling_factor=scaling)
    costmap = make_costmap(make_map(cells, RESOLUTION), make_circle(max(inscribed, 0.01)), options)
    lethal = np.argwhere(cells == 100)
    reach = math.ceil(radius / RESOLUTION)
    for row, column in np.ndindex(cells.shape):
        square = min(((lethal - (row, column)) ** 2).sum(axis=1), default=10**9)
        cost = 0
        if square <= reach * reach:
            cost = inflated_cost(math.sqrt(square) * RESOLUTION, max(inscribed, 0.01), scaling)
        if cells[row, column] == -1 and cost < 253:
            cost = NO_INFORMATION
        assert costmap.costs[row, column] == cost


@examples(30)
@given(seeds, shares, st.integers(1, 12))
def test_a_window_is_inflated_as_the_whole(seed: int, share: float, reach: int) -> None:
    """An update of a part gives the cells that an update of all would, compiled and plain."""
    costs = np.where(random_cells(seed, 0.2 * share), 254, 0).astype(np.uint8)
    rng = np.random.default_rng(seed)
    table = np.sort(rng.integers(0, 254, (reach + 1) ** 2 + 1))[::-1].astype(np.uint8)
    table[0], table[-1] = 254, 0
    rows, columns = costs.shape
    whole = np.zeros_like(costs)
    inflate(costs, table, reach, (0, rows, 0, columns), 253, whole)
    r0, c0 = rng.integers(0, rows), rng.integers(0, columns)
    window = int(r0), int(rng.integers(r0, rows + 1)), int(c0), int(rng.integers(c0, columns + 1))
    for (part,) in both_ways(lambda out: inflate(costs, table, reach, window, 253, out), np.zeros_like(costs)):
        inside = np.zeros(costs.shape, bool)
        inside[window[0] : window[1], window[2] : window[3]] = True
        assert np.array_equal(part, np.where(inside, whole, 0))


@examples(30)
@given(seeds)
def test_beams_clear_and_mark_alike(seed: int) -> None:
    """Compiled and plain; every end that was marked is lethal, and the cell of the sensor is clear."""
    rng = np.random.default_rng(seed)
    ends, marks = rng.integers(-5, 25, (30, 2)), rng.integers(-5, 25, (5, 2))
    x0, y0 = rng.integers(-2, 22, 2).tolist()
    (first,), (second,) = both_ways(
        lambda costs: trace_beams(costs, x0, y0, ends, marks), np.full((20, 18), NO_INFORMATION, np.uint8)
    )
    assert np.array_equal(first, second)
    for x, y in marks.tolist():
        assert not (0 <= x < 18 and 0 <= y < 20) or first[y, x] == LETHAL_OBSTACLE
    if 0 <= x0 < 18 and 0 <= y0 < 20 and [x0, y0] not in marks.tolist():
        assert first[y0, x0] == 0


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-4, 4), st.floats(-50, 50), st.floats(-50, 50))
def test_cells_and_places_are_inverse(x: float, y: float, yaw: float, u: float, v: float) -> None:
    """For any origin and turn of a grid, for one point and for many."""
    frame = Frame(3, 4, 0.05, Pose2(x, y, yaw))
    assert frame.to_cells(*frame.from_cells(u, v)) == pytest.approx((u, v), abs=1e-9)
    points = frame.points_from_cells(np.array([[u, v]]))
    assert points[0] == pytest.approx(frame.from_cells(u, v), abs=1e-12)
    assert frame.points_to_cells(points)[0] == pytest.approx((u, v), abs=1e-9)
