"""Costmaps against distances found by looking at all cells."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support import planning_references
from support.examples import examples
from support.planning_cases import RESOLUTION, random_cells, seeds, shares
from zteam.geometry import Pose2, in_polygon
from zteam.kernels.navigation import fill_disc, fill_outline, inflate, observe
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


@examples(30)
@given(seeds, st.integers(0, 6))
def test_a_disc_fills_what_it_touches_and_an_outline_what_has_its_middle_inside(seed: int, corners: int) -> None:
    """Also beside the grid. The window holds all that has changed; an outline without corners is nowhere."""
    rng = np.random.default_rng(seed)
    (u, v, x, y), pose = rng.uniform(-5.0, 25.0, 4).tolist(), Pose2(*rng.uniform(-3.0, 20.0, 3).tolist())
    outline, reach = rng.uniform(-6.0, 6.0, (corners, 2)), float(rng.uniform(0.0, 9.0))
    row, column = np.indices((20, 18))
    costs = np.zeros((20, 18), np.uint8)
    fill_disc(costs, u, v, reach, 7)
    off = np.maximum(np.maximum(column - u, u - column - 1), 0.0), np.maximum(np.maximum(row - v, v - row - 1), 0.0)
    assert np.array_equal(costs == 7, np.hypot(*off) <= reach)
    costs[:] = 0
    window = fill_outline(costs, (x, y, 0.6, 0.8, 0.5), outline, pose, 7)
    places = np.array([pose.compose(Pose2(*corner, 0.0))[:2] for corner in outline]).reshape(-1, 2) - (x, y)
    points = np.column_stack((places @ (0.6, 0.8), places @ (-0.8, 0.6))) / 0.5
    assert np.array_equal(costs == 7, in_polygon(points, column + 0.5, row + 0.5))
    if window is not None:
        costs[window[0] : window[1], window[2] : window[3]] = 0
    assert not costs.any()


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-4, 4), st.floats(-50, 50), st.floats(-50, 50))
def test_cells_and_places_are_inverse(x: float, y: float, yaw: float, u: float, v: float) -> None:
    """For any origin and turn of a grid, for one point and for many."""
    frame = GridGeometry(3, 4, 0.05, Pose2(x, y, yaw))
    assert frame.to_cells(*frame.from_cells(u, v)) == pytest.approx((u, v), abs=1e-9)
    points = frame.points_from_cells(np.array([[u, v]]))
    assert points[0] == pytest.approx(frame.from_cells(u, v), abs=1e-12)
    assert frame.points_to_cells(points)[0] == pytest.approx((u, v), abs=1e-9)
