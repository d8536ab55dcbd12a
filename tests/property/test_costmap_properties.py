"""Costmaps against distances found by looking at all cells."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from support import planning_references
from support.examples import examples
from support.planning_cases import RESOLUTION, random_cells, seeds, shares
from zteam.geometry import Pose2, in_polygon
from zteam.kernels.navigation import Layers, find_hits
from zteam.messages.laser import read_ranges
from zteam.navigation.planning.costmap import LETHAL_OBSTACLE, NO_INFORMATION, inflated_cost, place
from zteam.planning import (
    Costmap,
    CostmapOptions,
    GridGeometry,
    Scan,
    Teammate,
    make_circle,
    make_costmap,
    make_footprint,
    make_map,
)


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
    layers = Layers(costs.shape, np.zeros((3, 2)), 0.0, table, unknown_from)
    layers.fixed[:] = rng.choice((0, 100, NO_INFORMATION), costs.shape)
    layers.seen[:] = costs
    joined = np.where(costs == 255, layers.fixed, np.where(layers.fixed == 255, costs, np.maximum(layers.fixed, costs)))
    whole = planning_references.inflate(joined, table, reach, unknown_from)
    assert layers.update(()) == (0, costs.shape[0], 0, costs.shape[1])
    assert np.array_equal(layers.base, joined)
    assert np.array_equal(layers.costs, whole)
    assert layers.update(()) is None
    layers.costs[:] = 7
    x, y, radius = (rng.random(3) * (32.0, 32.0, 6.0) - (4.0, 4.0, 0.0)).tolist()
    layers.change((x, y, radius))
    window = layers.update(())
    expected = np.full_like(costs, 7)
    if window is not None:
        r0, r1, c0, c1 = window
        expected[r0:r1, c0:c1] = whole[r0:r1, c0:c1]
    assert np.array_equal(layers.costs, expected)
    for row, column in np.ndindex(costs.shape):
        if math.dist((column + 0.5, row + 0.5), (x, y)) <= radius:
            near = slice(max(0, row - reach), row + reach + 1), slice(max(0, column - reach), column + reach + 1)
            assert np.array_equal(layers.costs[near], whole[near])


@examples(30)
@given(seeds, st.integers(0, 30), st.integers(0, 40), st.integers(0, 2))
def test_beams_clear_and_mark_the_cells_of_the_reference(seed: int, beams: int, wanted: int, mates: int) -> None:
    """Wherever the sensor and the ends lie, on the grid or beside it; what is met on a teammate is not marked."""
    rng = np.random.default_rng(seed)
    ranges = rng.uniform(0.0, 12.0, beams).astype(np.float32)
    ranges[rng.random(beams) < 0.3] = rng.choice((np.nan, np.inf, -np.inf, 0.0, 40.0))
    sensor, base, origin = (Pose2(*(rng.uniform(-1, 1, 3) * (size, size, 3.0)).tolist()) for size in (0.5, 12.0, 4.0))
    scan = Scan(ranges, float(rng.uniform(-3, 0)), 0.11, 0.3, 11.0, sensor)
    others = [Teammate(*rng.uniform(-9.0, 9.0, 2).tolist(), float(rng.uniform(0.0, 3.0))) for _ in range(mates)]
    laser, far, clears, margin = base.compose(sensor), 8.0, float(rng.uniform(0.0, 8.0)), 0.2

    def end(i: int, length: float) -> tuple[float, float]:
        angle = laser.yaw + scan.angle_min + i * scan.angle_increment
        return laser.x + length * math.cos(angle), laser.y + length * math.sin(angle)

    def is_hit(i: int, distance: float) -> bool:
        return distance <= far and all(math.dist(end(i, distance), mate[:2]) > mate.radius + margin for mate in others)

    speaking = [(i, d) for i, d in enumerate(read_ranges(ranges, 0.3, 11.0).distances.tolist()) if d > 0.0]
    chosen = {k * (beams - 1) // max(1, min(wanted, beams) - 1) for k in range(min(wanted, beams))}
    hits = [end(i, d) for i, d in speaking if i in chosen and is_hit(i, d)]
    assert find_hits(scan, base, far, wanted, others, margin) == pytest.approx(np.reshape(hits, (-1, 2)), abs=1e-9)
    costmap = Costmap(GridGeometry(40, 36, 0.25, origin), make_circle(0.2), CostmapOptions(
        raytrace_max_range=clears, obstacle_max_range=far, teammate_margin=margin
    ))  # fmt: skip
    costmap.update()
    costmap.observe(scan, base, others)
    expected = np.full((40, 36), NO_INFORMATION, np.uint8)
    cells = [costmap.frame.cell_at(*end(i, min(d, far, clears)))[::-1] for i, d in speaking]
    marks = [costmap.frame.cell_at(*end(i, d + 0.25 * 0.25))[::-1] for i, d in speaking if is_hit(i, d)]
    if cells:
        place = costmap.frame.cell_at(laser.x, laser.y)[::-1]
        planning_references.trace_beams(expected, *place, np.array(cells), np.reshape(marks, (-1, 2)))
    assert np.array_equal(costmap.layers.seen, expected)
    window = costmap.update() or (0, 0, 0, 0)
    changed = np.argwhere(expected != NO_INFORMATION)
    assert all(window[0] <= row < window[1] and window[2] <= column < window[3] for row, column in changed.tolist())


def test_what_was_seen_keeps_its_place_in_a_costmap_that_moves() -> None:
    """Wherever it moves; what comes into the grid is unknown."""
    layers = Layers((7, 8), np.zeros((3, 2)), 0.0, np.zeros(2, np.uint8), 1)
    wide = np.pad(np.arange(56, dtype=np.uint8).reshape(7, 8), 9, constant_values=NO_INFORMATION)
    for rows, columns in product(range(-9, 10), repeat=2):
        layers.seen[:] = wide[9:16, 9:17]
        layers.move(rows, columns)
        assert np.array_equal(layers.seen, wide[9 + rows : 16 + rows, 9 + columns : 17 + columns])


@given(seeds)
def test_under_an_outline_what_was_seen_is_cleared(seed: int) -> None:
    """The cells whose middle lies in it, wherever the robot is."""
    rng = np.random.default_rng(seed)
    outline, frame = make_footprint(rng.uniform(-1.5, 1.5, (5, 2))), GridGeometry(20, 18, 0.2, Pose2(0.3, -0.2, 0.7))
    costmap, pose = Costmap(frame, outline), Pose2(*rng.uniform(-3.0, 4.0, 3).tolist())
    costmap.clear_footprint(pose)
    corners = frame.points_to_cells(place(outline, *pose))
    rows, columns = np.mgrid[:20, :18]
    assert np.array_equal(costmap.layers.seen == 0, in_polygon(corners, columns + 0.5, rows + 0.5))


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-4, 4), st.floats(-50, 50), st.floats(-50, 50))
def test_cells_and_places_are_inverse(x: float, y: float, yaw: float, u: float, v: float) -> None:
    """For any origin and turn of a grid, for one point and for many."""
    frame = GridGeometry(3, 4, 0.05, Pose2(x, y, yaw))
    assert frame.to_cells(*frame.from_cells(u, v)) == pytest.approx((u, v), abs=1e-9)
    points = frame.points_from_cells(np.array([[u, v]]))
    assert points[0] == pytest.approx(frame.from_cells(u, v), abs=1e-12)
    assert frame.points_to_cells(points)[0] == pytest.approx((u, v), abs=1e-9)
