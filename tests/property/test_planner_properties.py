"""The planner against Dijkstra, against all lines, and against small steps."""

import heapq
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studies.navigation.ways import cost_of, length_of, plain_field
from support import planning_references
from support.examples import examples
from support.planning_cases import random_cells, seeds, shares
from zteam.kernels.navigation import measure_lines, shift_points, shorten
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
@given(seeds, shares, st.integers(1, 5), st.integers(0, 30))
def test_lines_shorten_a_way_as_if_all_of_them_were_tried(seed: int, share: float, stride: int, reach: int) -> None:
    """On ways at random, some of them through blocked cells; the same costs to the bit."""
    rng = np.random.default_rng(seed)
    weights = rng.integers(1, 255, (20, 23)).astype(np.uint8)
    weights[rng.random(weights.shape) < 0.2 * share] = 0
    way = np.clip(np.cumsum(rng.integers(-1, 2, (40, 2)), axis=0) + 10, 0, 19)
    best, before = shorten(weights, way, stride, reach, float(weights[weights > 0].min()))
    expected, places = planning_references.shorten(weights, way, stride, reach)
    assert best.tolist() == expected
    assert [b for b, cost in zip(before.tolist(), expected, strict=True) if math.isfinite(cost)] == [
        b for b, cost in zip(places, expected, strict=True) if math.isfinite(cost)
    ]


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


@examples(20)
@given(seeds, st.integers(1, 4), st.integers(1, 3))
def test_points_move_aside_to_the_cheapest_places(seed: int, count: int, width: int) -> None:
    """No other choice of places costs less, and the ends stay."""
    rng = np.random.default_rng(seed)
    weights, points = rng.integers(1, 100, (12, 15), np.uint8), rng.integers(0, (15, 12), (count, 2))
    beside = [[point] for point in points]
    for i in range(1, count - 1):
        along = points[i + 1] - points[i - 1]
        aside = np.array((-along[1], along[0])) / max(np.hypot(*along), 1e-9)
        moved = [points[i] + np.rint(aside * side * width).astype(np.int64) for side in range(-3, 4)]
        beside[i] = [np.clip(place, 0, (14, 11)) for place in moved]
    costs = [measure_lines(weights, way[:-1], way[1:]).sum() for way in map(np.array, itertools.product(*beside))]
    way = shift_points(weights, points, width)
    assert np.array_equal(way[[0, -1]], points[[0, -1]])
    assert measure_lines(weights, way[:-1], way[1:]).sum() == pytest.approx(min(costs))
