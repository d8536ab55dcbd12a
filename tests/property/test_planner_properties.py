"""The planner against Dijkstra, against all lines, and against small steps."""

import heapq
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studies.navigation.ways import cost_of, length_of, plain_field
from support import planning_references
from support.examples import examples
from support.planning_cases import random_cells, seeds, shares
from zteam.kernels.navigation import lay_path, measure_lines, straighten
from zteam.navigation.planning.costmap import LETHAL_OBSTACLE
from zteam.navigation.planning.planner import Field


def dijkstra(free: np.ndarray, start: tuple[int, int]) -> dict[tuple[int, int], float]:
    """Octile distances without the cutting of corners."""
    found, queue = {}, [(0.0, start)]
    rows, columns = free.shape

    def is_free(row: int, column: int) -> bool:
        return 0 <= row < rows and 0 <= column < columns and bool(free[row, column])

    while queue:
        cost, (row, column) = heapq.heappop(queue)
        if (row, column) in found:
            continue
        found[row, column] = cost
        for dr in (-1, 0, 1):
            for dc in (-1, 0, 1):
                if is_free(row + dr, column + dc) and is_free(row + dr, column) and is_free(row, column + dc):
                    heapq.heappush(queue, (cost + math.hypot(dr, dc), (row + dr, column + dc)))
    return found


@examples(30)
@given(seeds, shares)
def test_the_search_finds_the_shortest_way_or_that_there_is_none(seed: int, share: float) -> None:
    """On maps at random its length is Dijkstra's."""
    free = ~random_cells(seed, share)
    rng = np.random.default_rng(seed)
    if not free.any():
        return
    cells = np.argwhere(free)
    start, goal = (tuple(cells[rng.integers(len(cells))].tolist()) for _ in range(2))
    expected = dijkstra(free, start).get(goal)
    field = plain_field(free)
    way = field.find_way(start, goal)
    assert (way is None) == (expected is None)
    if way is not None and expected is not None:
        assert length_of(way) == pytest.approx(expected, rel=1e-4)
        assert (way[0].tolist(), way[-1].tolist()) == ([start[1], start[0]], [goal[1], goal[0]])
        assert all(free[row, column] for column, row in way.tolist())
        assert np.abs(np.diff(way, axis=0)).max(initial=0) <= 1


@examples(30)
@given(seeds, shares, st.floats(0.0, 4.0))
def test_a_way_near_a_goal_ends_at_the_nearest_cell_that_can_be_reached(
    seed: int, share: float, tolerance: float
) -> None:
    """Whether the goal is blocked, cut off or outside."""
    free = ~random_cells(seed, share)
    rng = np.random.default_rng(seed)
    if not free.any():
        return
    cells = np.argwhere(free)
    start = tuple(cells[rng.integers(len(cells))].tolist())
    goal = tuple(rng.integers(-3, 27, 2).tolist())
    field = plain_field(free)
    near = min((math.dist(cell, goal) for cell in dijkstra(free, start)), default=math.inf)
    way = field.find_way(start, goal, tolerance)
    if near > tolerance:
        assert way is None
    else:
        assert way is not None
        assert math.dist(way[-1], (goal[1], goal[0])) == near


@examples(30)
@given(seeds, shares)
def test_straight_ways_cost_no_more_and_are_free(seed: int, share: float) -> None:
    """Any-angle ways join the same ends at most at the cost of the cells' way."""
    rng = np.random.default_rng(seed)
    costs = rng.integers(0, 254, (40, 40)).astype(np.uint8)
    costs[rng.random(costs.shape) < 0.6] = 0
    costs[rng.random(costs.shape) < 0.6 * share] = LETHAL_OBSTACLE
    field = Field(*costs.shape)
    field.set_costs(costs, allow_unknown=True)
    free = np.argwhere(costs < 253)
    start, goal = (tuple(free[rng.integers(len(free))].tolist()) for _ in range(2))
    way = field.find_way(start, goal)
    if way is None:
        return
    corners = field.shorten(way)
    assert cost_of(field, corners) <= cost_of(field, way) * (1.0 + 1e-9)
    assert np.array_equal(corners[[0, -1]], way[[0, -1]])


@examples(30)
@given(seeds, shares, st.integers(1, 5), st.integers(0, 30), st.integers(2, 20))
def test_a_way_is_straightened_as_if_all_lines_were_tried(
    seed: int, share: float, stride: int, reach: int, spacing: int
) -> None:
    """On ways at random, some of them through blocked cells; the same corners."""
    rng = np.random.default_rng(seed)
    weights = rng.integers(1, 255, (20, 23)).astype(np.uint8)
    weights[rng.random(weights.shape) < 0.2 * share] = 0
    way = np.clip(np.cumsum(rng.integers(-1, 2, (40, 2)), axis=0) + 10, 0, 19)
    corners = straighten(weights, way, stride, reach, spacing, int(weights[weights > 0].min()))
    expected = planning_references.straighten(weights, way, stride, reach, spacing)
    assert corners.tolist() == expected.tolist()


@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), min_size=1, max_size=6), st.floats(0.03, 3.0))
def test_a_path_leads_along_its_lines(corners: list[tuple[float, float]], spacing: float) -> None:
    """Through each corner, in equal steps, facing the next pose, and it ends with the heading that is asked for."""
    path = lay_path(np.array([*corners, corners[-1]]), 0.7, spacing)
    assert (path[0, :2].tolist(), path[-1].tolist()) == (pytest.approx(corners[0]), [*corners[-1], 0.7])
    assert all(np.abs(path[:, :2] - corner).max(axis=1).min() <= 1e-9 for corner in corners)
    for (x, y, yaw), (to_x, to_y, _) in pairwise(path.tolist()):
        away = math.dist((x, y), (to_x, to_y))
        assert 0.0 < away <= spacing * (1.0 + 1e-6)
        assert (to_x - x, to_y - y) == pytest.approx((away * math.cos(yaw), away * math.sin(yaw)), abs=1e-9)
    total = sum(max(1, math.ceil(math.dist(a, b) / spacing)) for a, b in pairwise(corners) if math.dist(a, b) > 2e-9)
    assert len(path) <= total + 1


@examples(30)
@given(seeds, shares)
def test_a_line_costs_the_integral_along_it(seed: int, share: float) -> None:
    """As a walk in a thousand small steps finds it; a line through a blocked cell costs inf."""
    rng = np.random.default_rng(seed)
    weights = rng.integers(1, 255, (14, 17)).astype(np.uint8)
    weights[rng.random(weights.shape) < 0.3 * share] = 0
    weights[[0, -1]] = weights[:, [0, -1]] = 0
    ends = rng.integers(1, 12, (20, 2, 2))
    begins, stops = np.ascontiguousarray(ends[:, 0]), np.ascontiguousarray(ends[:, 1])
    costs = measure_lines(weights, begins, stops).tolist()
    for (x0, y0), (x1, y1), cost in zip(begins.tolist(), stops.tolist(), costs, strict=True):
        share_of_way = (np.arange(4000) + 0.5) / 4000
        x, y = x0 + 0.5 + (x1 - x0) * share_of_way, y0 + 0.5 + (y1 - y0) * share_of_way
        passed = weights[np.floor(y).astype(int), np.floor(x).astype(int)].astype(float)
        if math.isfinite(cost):
            assert cost == pytest.approx(passed.mean() * math.dist((x0, y0), (x1, y1)), rel=0.02, abs=0.5)
        elif (passed > 0).all():
            # Through a corner between two cells, one of which is blocked.
            assert abs(x1 - x0) and abs(y1 - y0)


@pytest.mark.parametrize(("blocked", "cost"), [((0, 0), math.sqrt(2.0)), ((1, 2), math.inf), ((2, 1), math.inf)])
def test_a_line_through_a_corner_needs_both_cells_beside_it(blocked: tuple[int, int], cost: float) -> None:
    """In any direction."""
    weights = np.ones((4, 4), np.uint8)
    weights[blocked] = 0
    ends, mirrored = np.array(((1, 1), (2, 2))), np.array(((2, 1), (1, 2)))
    assert measure_lines(weights, ends, ends[::-1].copy()).tolist() == [cost, cost]
    assert measure_lines(weights[:, ::-1].copy(), mirrored, mirrored[::-1].copy()).tolist() == [cost, cost]
