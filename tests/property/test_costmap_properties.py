"""Costmaps against distances found by looking at all cells."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support import planning_references
from support.examples import examples
from support.planning_cases import RESOLUTION, random_cells, seeds, shares
from zteam.geometry import Pose2
from zteam.kernels.navigation import inflate, observe
from zteam.navigation.planning.costmap import LETHAL_OBSTACLE, NO_INFORMATION, inflated_cost
from zteam.planning import CostmapOptions, GridGeometry, make_circle, make_costmap, make_map


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
@given(seeds, shares, st.integers(0, 12), st.sampled_from([1, 253]))
def test_a_window_is_inflated_as_the_whole(seed: int, share: float, reach: int, unknown_from: int) -> None:
    """An update of a part, empty ones too, gives the cells that the reference gives of all, and changes no other."""
    rng = np.random.default_rng(seed)
    costs = np.where(random_cells(seed, 0.2 * share), LETHAL_OBSTACLE, 0).astype(np.uint8)
    costs[rng.random(costs.shape) < 0.1] = NO_INFORMATION
    table = np.sort(rng.integers(0, 254, (reach + 1) ** 2 + 1))[::-1].astype(np.uint8)
    table[0], table[-1] = LETHAL_OBSTACLE, 0
    whole = planning_references.inflate(costs, table, reach, unknown_from)
    r0, c0 = (int(rng.integers(0, size + 1)) for size in costs.shape)
    r1, c1 = (int(rng.integers(low, size + 1)) for low, size in zip((r0, c0), costs.shape, strict=True))
    part = np.full_like(costs, 7)
    inflate(costs, table, reach, (r0, r1, c0, c1), unknown_from, part)
    expected = np.full_like(costs, 7)
    expected[r0:r1, c0:c1] = whole[r0:r1, c0:c1]
    assert np.array_equal(part, expected)


@examples(30)
@given(seeds, st.integers(0, 30), st.integers(0, 2))
def test_beams_clear_and_mark_the_cells_of_the_reference(seed: int, beams: int, mates: int) -> None:
    """Wherever the sensor and the ends lie, on the grid or beside it; what is met on a teammate is not marked."""
    rng = np.random.default_rng(seed)
    ends, met, others = rng.integers(-5, 25, (beams, 2)), rng.random(beams) < 0.5, rng.uniform(0.0, 20.0, (mates, 3))
    laser = rng.integers(-2, 22, 2)
    costs = np.full((20, 18), NO_INFORMATION, np.uint8)
    expected, frame = costs.copy(), (0.0, 0.0, 1.0, 0.0, 1.0)
    low, high, left, right = observe(
        costs, frame, (laser + 0.5).tolist(), ends + 0.5, met, others.tolist(), (math.inf, math.inf, 0.0)
    )
    marked = met & (np.hypot(*(ends[:, None] + 0.5 - others[:, :2]).T) > others[:, 2:]).all(axis=0)
    planning_references.trace_beams(expected, *laser.tolist(), ends, ends[marked])
    assert np.array_equal(costs, expected)
    assert all(left <= column < right and low <= row < high for column, row in (laser.tolist(), *ends.tolist()))


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-4, 4), st.floats(-50, 50), st.floats(-50, 50))
def test_cells_and_places_are_inverse(x: float, y: float, yaw: float, u: float, v: float) -> None:
    """For any origin and turn of a grid, for one point and for many."""
    frame = GridGeometry(3, 4, 0.05, Pose2(x, y, yaw))
    assert frame.to_cells(*frame.from_cells(u, v)) == pytest.approx((u, v), abs=1e-9)
    points = frame.points_from_cells(np.array([[u, v]]))
    assert points[0] == pytest.approx(frame.from_cells(u, v), abs=1e-12)
    assert frame.points_to_cells(points)[0] == pytest.approx((u, v), abs=1e-9)
