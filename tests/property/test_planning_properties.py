"""Planning against plain definitions of what it computes, and compiled kernels against plain ones."""

import heapq
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from zteam.compiling.takeover import prepare
from zteam.geometry import Pose2
from zteam.planning.amcl import Amcl
from zteam.planning.amcl_options import AmclOptions
from zteam.planning.collisions import Velocity, find_hit, time_to_collision
from zteam.planning.controller import BlockedError, RegulatedPurePursuit
from zteam.planning.costmap import Costmap, CostmapOptions, make_costmap
from zteam.planning.costs import LETHAL_OBSTACLE, NO_INFORMATION, inflated_cost
from zteam.planning.footprint import make_circle, make_footprint, place
from zteam.planning.grid import Frame, make_map
from zteam.planning.inflation import inflate
from zteam.planning.jit import PLANNING
from zteam.planning.likelihood import make_likelihood_field, weigh_poses
from zteam.planning.lines import measure_line, measure_lines
from zteam.planning.matching import climb
from zteam.planning.raytracing import trace_beams
from zteam.planning.scans import Scan, Teammate
from zteam.planning.search import Field, length_of

RESOLUTION = 0.1
seeds = st.integers(0, 2**32 - 1)
shares = st.floats(0.0, 0.5)


@pytest.fixture(autouse=True, scope="module")
def _compiled() -> None:
    prepare(PLANNING)


def random_cells(seed: int, share: float, size: int = 24) -> np.ndarray:
    """Occupied cells, at random."""
    rng = np.random.default_rng(seed)
    return rng.random((rng.integers(1, size), rng.integers(1, size))) < share


def both_ways(call: object, *outputs: np.ndarray) -> list[tuple[np.ndarray, ...]]:
    """What `call` writes to `outputs`, compiled and plain."""
    found = []
    for use in (PLANNING.use_compiled, PLANNING.use_plain):
        use()
        made = tuple(array.copy() for array in outputs)
        call(*made)  # type: ignore[operator]
        found.append(made)
    PLANNING.use_compiled()
    return found


@settings(max_examples=30)
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


@settings(max_examples=30)
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


@settings(max_examples=30)
@given(seeds, shares)
def test_the_search_finds_the_shortest_way_or_that_there_is_none(seed: int, share: float) -> None:
    """On maps at random its length is Dijkstra's, compiled and plain alike."""
    free = ~random_cells(seed, share)
    rng = np.random.default_rng(seed)
    if not free.any():
        return
    cells = np.argwhere(free)
    start, goal = (tuple(cells[rng.integers(len(cells))].tolist()) for _ in range(2))
    expected = dijkstra(free, start).get(goal)
    field = Field(*free.shape)
    field.set_free(free)
    way = field.find_way(start, goal)
    PLANNING.use_plain()
    plain = field.find_way(start, goal)
    PLANNING.use_compiled()
    assert (way is None) == (plain is None) == (expected is None)
    if way is not None and plain is not None and expected is not None:
        assert np.array_equal(way, plain)
        assert length_of(way) == pytest.approx(expected, rel=1e-4)
        assert (way[0].tolist(), way[-1].tolist()) == ([start[1], start[0]], [goal[1], goal[0]])
        assert all(free[row, column] for column, row in way.tolist())
        assert np.abs(np.diff(way, axis=0)).max(initial=0) <= 1


@settings(max_examples=30)
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
    field = Field(*free.shape)
    field.set_free(free)
    near = min((math.dist(cell, goal) for cell in dijkstra(free, start)), default=math.inf)
    way = field.find_way(start, goal, tolerance)
    if near > tolerance:
        assert way is None
    else:
        assert way is not None
        assert math.dist(way[-1], (goal[1], goal[0])) == near


@settings(max_examples=30)
@given(seeds, shares)
def test_straight_ways_cost_no_more_and_are_free(seed: int, share: float) -> None:
    """Any-angle ways join the same ends at most at the cost of the cells' way, compiled and plain alike."""
    rng = np.random.default_rng(seed)
    costs = rng.integers(0, 254, (40, 40)).astype(np.uint8)
    costs[rng.random(costs.shape) < 0.6] = 0
    costs[rng.random(costs.shape) < 0.6 * share] = LETHAL_OBSTACLE
    field = Field(*costs.shape)
    field.set_costs(costs, 50, 0.8, allow_unknown=True)
    free = np.argwhere(costs < 253)
    start, goal = (tuple(free[rng.integers(len(free))].tolist()) for _ in range(2))
    way = field.find_way(start, goal)
    if way is None:
        return
    corners = field.shorten(way)
    assert field.cost_of(corners) <= field.cost_of(way) * (1.0 + 1e-9)
    assert np.array_equal(corners[[0, -1]], way[[0, -1]])
    PLANNING.use_plain()
    assert np.array_equal(field.shorten(way), corners)
    PLANNING.use_compiled()


@settings(max_examples=30)
@given(seeds, shares)
def test_a_line_costs_the_integral_along_it(seed: int, share: float) -> None:
    """As a walk in a thousand small steps finds it; a line through a blocked cell costs inf."""
    rng = np.random.default_rng(seed)
    weights = rng.integers(1, 255, (14, 17)).astype(np.uint8)
    weights[rng.random(weights.shape) < 0.3 * share] = 0
    weights[[0, -1]] = weights[:, [0, -1]] = 0
    ends = rng.integers(1, 12, (20, 2, 2))
    begins, stops = np.ascontiguousarray(ends[:, 0]), np.ascontiguousarray(ends[:, 1])
    flat = weights.reshape(-1)
    first, second = both_ways(lambda out: measure_lines(flat, 17, begins, stops, out), np.empty(20))
    assert np.array_equal(first, second)
    for (x0, y0), (x1, y1), cost in zip(begins.tolist(), stops.tolist(), first[0].tolist(), strict=True):
        share_of_way = (np.arange(4000) + 0.5) / 4000
        x, y = x0 + 0.5 + (x1 - x0) * share_of_way, y0 + 0.5 + (y1 - y0) * share_of_way
        passed = weights[np.floor(y).astype(int), np.floor(x).astype(int)].astype(float)
        if math.isfinite(cost):
            assert cost == pytest.approx(passed.mean() * math.dist((x0, y0), (x1, y1)), rel=0.02, abs=0.5)
        elif (passed > 0).all():
            # Through a corner between two cells, one of which is blocked.
            assert abs(x1 - x0) and abs(y1 - y0)
        assert measure_line(flat, 17, x0, y0, x1, y1, math.inf) == cost


@settings(max_examples=30)
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


@settings(max_examples=30)
@given(seeds, st.integers(1, 40), st.integers(0, 30))
def test_weights_are_those_of_the_formula(seed: int, poses: int, beams: int) -> None:
    """1 plus the sum of (z_hit exp(-d²/2σ²) + z_rand/range_max)³, d by looking at all cells; compiled and plain."""
    rng = np.random.default_rng(seed)
    cells = np.where(random_cells(seed, 0.1, 30), 100, 0).astype(np.int8)
    grid = make_map(cells, RESOLUTION)
    field = make_likelihood_field(grid, z_hit=0.5, z_rand=0.5, sigma_hit=0.2, max_dist=1.0, range_max=10.0)
    given = np.column_stack((rng.uniform(-3, 33, (poses, 2)), rng.uniform(-4, 4, poses)))
    u, v = rng.uniform(-20, 20, (2, beams))
    (first,), (second,) = both_ways(lambda out: weigh_poses(field.values, given, u, v, out), np.ones(poses))
    assert first.tobytes() == second.tobytes()
    lethal = np.argwhere(cells == 100)
    x, y, yaw = given[0]
    total = 1.0
    for beam_u, beam_v in zip(u, v, strict=True):
        # The field has a border of one cell.
        column = math.floor(x + math.cos(yaw) * beam_u - math.sin(yaw) * beam_v) - 1
        row = math.floor(y + math.sin(yaw) * beam_u + math.cos(yaw) * beam_v) - 1
        inside = 0 <= row < cells.shape[0] and 0 <= column < cells.shape[1]
        square = min(((lethal - (row, column)) ** 2).sum(axis=1), default=10**9) if inside else 10**9
        d = min(1.0, math.sqrt(square) * RESOLUTION)
        total += (0.5 * math.exp(-d * d / 0.08) + 0.05) ** 3
    assert first[0] == pytest.approx(total, rel=1e-5)


@settings(max_examples=30)
@given(seeds)
def test_a_match_is_never_worse_and_the_same_both_ways(seed: int) -> None:
    """Poses climb; compiled and plain give the same bits."""
    rng = np.random.default_rng(seed)
    values = rng.random((20, 22)).astype(np.float32)
    u, v = rng.uniform(-8, 8, (2, 12))
    poses = np.column_stack((rng.uniform(3, 17, (6, 2)), rng.uniform(-3, 3, 6)))
    (first, sums), (second, others) = both_ways(
        lambda places, out: climb(values, places, u, v, (2.0, 0.1), out), poses, np.zeros(6)
    )
    assert first.tobytes() == second.tobytes()
    assert sums.tobytes() == others.tobytes()
    before = np.ones(6)
    weigh_poses(values, poses, u, v, before)
    assert (sums + 1.0 >= before - 1e-9).all()


@settings(max_examples=3)
@given(seeds)
def test_the_same_seed_gives_the_same_particles(seed: int) -> None:
    """Bit for bit, compiled and plain; another seed gives others."""
    rng = np.random.default_rng(seed)
    grid = make_map(np.where(random_cells(seed, 0.05, 60), 100, 0).astype(np.int8), RESOLUTION)
    scans = [
        Scan(rng.uniform(0.1, 6.0, 40).astype(np.float32), -2.0, 0.1, 0.0, 5.0, Pose2(0.1, 0.0, 0.0)) for _ in range(4)
    ]

    def run(number: int) -> bytes:
        options = AmclOptions(
            min_particles=20, max_particles=60, recovery_alpha_slow=0.001, recovery_alpha_fast=0.5, global_particles=50
        )
        localiser = Amcl(grid, options, seed=number)
        localiser.set_pose(Pose2(1.0, 1.0, 0.0))
        odom = Pose2(0.0, 0.0, 0.0)
        for scan in scans:
            odom = odom.compose(Pose2(0.3, 0.0, 0.1))
            assert localiser.update(odom, scan, [Teammate(1.0, 0.0, 0.3)])
        if (grid.cells == 0).any():
            localiser.localize_globally()
            localiser.update(odom, scans[0])
        return localiser.particles.tobytes() + repr(localiser.pose).encode()

    compiled = run(1)
    assert run(1) == compiled
    PLANNING.use_plain()
    assert run(1) == compiled
    PLANNING.use_compiled()
    assert run(2) != compiled


def touched(costmap: Costmap, pose: Pose2) -> set[tuple[int, int]]:
    """Lethal cells that the outline covers, found by points along it and within it."""
    corners = place(costmap.footprint, *pose)
    ends = np.roll(corners, -1, axis=0)
    share = np.linspace(0.0, 1.0, 60)[:, None]
    outline = np.concatenate([a + share * (b - a) for a, b in zip(corners, ends, strict=True)])
    # The outlines of this test are convex and hold the origin: shrunk ones fill them.
    points = np.concatenate([np.array(pose[:2]) + scale * (outline - pose[:2]) for scale in np.linspace(0, 1, 9)])
    found = np.unique(np.floor(costmap.frame.points_to_cells(points)).astype(int), axis=0)
    rows, columns = costmap.costs.shape
    return {
        (row, column)
        for column, row in found.tolist()
        if not (0 <= row < rows and 0 <= column < columns) or costmap.costs[row, column] == LETHAL_OBSTACLE
    }


OUTLINES = st.sampled_from(
    [make_circle(0.2), make_footprint([(0.125, 0.175), (-0.225, 0.175), (-0.225, -0.175), (0.125, -0.175)])]
)


def drive(pose: Pose2, velocity: Velocity, seconds: float) -> Pose2:
    """Along the exact arc."""
    half = 0.5 * velocity.turn * seconds
    chord = velocity.x * seconds * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    return pose.compose(Pose2(chord * math.cos(half), chord * math.sin(half), 2.0 * half))


@settings(max_examples=20)
@given(seeds, OUTLINES, st.floats(0.0, 0.03))
def test_no_command_takes_the_robot_into_a_lethal_cell(seed: int, outline: object, share: float) -> None:
    """Whatever the path, the place and the speed: while a command holds, the outline enters no lethal cell."""
    rng = np.random.default_rng(seed)
    cells = np.where(rng.random((40, 40)) < share, 100, 0).astype(np.int8)
    costmap = make_costmap(make_map(cells, 0.05), outline, CostmapOptions(inflation_radius=0.4))  # type: ignore[arg-type]
    pose = Pose2(*rng.uniform(0.4, 1.6, 2).tolist(), float(rng.uniform(-3, 3)))
    turns = np.cumsum(rng.normal(0.0, 0.2, 40))
    steps = 0.05 * np.stack((np.cos(turns), np.sin(turns)), axis=1)
    path = np.column_stack((np.array(pose[:2]) + rng.normal(0, 0.1, 2) + np.cumsum(steps, axis=0), turns))
    controller = RegulatedPurePursuit()
    controller.set_path(path)
    velocity = Velocity(float(rng.uniform(0, 0.5)), 0.0, float(rng.uniform(-1.8, 1.8)))
    for _ in range(8):
        try:
            velocity = controller.command(costmap, pose, velocity, 0.1)
        except BlockedError:
            return
        at_first = touched(costmap, pose)
        for part in (0.25, 0.5, 0.75, 1.0):
            assert touched(costmap, drive(pose, velocity, 0.1 * part)) <= at_first
        pose = drive(pose, velocity, 0.1)


@settings(max_examples=25)
@given(seeds, OUTLINES)
def test_the_time_to_a_collision_is_that_of_small_steps(seed: int, outline: object) -> None:
    """The first touch along an arc comes when a walk in small steps finds it, within what two poses are apart."""
    rng = np.random.default_rng(seed)
    cells = np.where(rng.random((40, 40)) < 0.02, 100, 0).astype(np.int8)
    costmap = make_costmap(make_map(cells, 0.05), outline)  # type: ignore[arg-type]
    pose = Pose2(1.0, 1.0, float(rng.uniform(-3, 3)))
    velocity = Velocity(float(rng.uniform(-0.5, 0.5)), 0.0, float(rng.uniform(-1.5, 1.5)))
    at_first = touched(costmap, pose)
    moments = np.linspace(0.0, 1.0, 81)[1:]
    first = next((t for t in moments if not touched(costmap, drive(pose, velocity, t)) <= at_first), math.inf)
    found = time_to_collision(costmap, pose, velocity, 1.0)
    assert found <= first
    if math.isinf(first) and math.isfinite(found):
        # It keeps a twentieth of a cell, and cells that it merely comes near to count as well.
        near = make_footprint(costmap.footprint.corners, 0.006)
        wide = Costmap(costmap.frame, near)
        wide.costs = costmap.costs
        assert not touched(wide, drive(pose, velocity, found + 0.03)) <= at_first


def test_outside_of_the_grid_is_lethal() -> None:
    """A robot on the edge of the map touches what is beyond."""
    costs = np.zeros((10, 10), np.uint8)
    corners = make_circle(0.2).corners / 0.05
    assert find_hit(costs, corners, 5.0, 5.0, 0.0, np.zeros(3), 0) == -1
    assert find_hit(costs, corners, 2.0, 5.0, 0.0, np.zeros(3), 0) == 0


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-4, 4), st.floats(-50, 50), st.floats(-50, 50))
def test_cells_and_places_are_inverse(x: float, y: float, yaw: float, u: float, v: float) -> None:
    """For any origin and turn of a grid, for one point and for many."""
    frame = Frame(3, 4, 0.05, Pose2(x, y, yaw))
    assert frame.to_cells(*frame.from_cells(u, v)) == pytest.approx((u, v), abs=1e-9)
    points = frame.points_from_cells(np.array([[u, v]]))
    assert points[0] == pytest.approx(frame.from_cells(u, v), abs=1e-12)
    assert frame.points_to_cells(points)[0] == pytest.approx((u, v), abs=1e-9)
