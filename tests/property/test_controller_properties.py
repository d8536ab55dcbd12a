"""The controller against outlines placed along arcs in small steps."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from support.examples import examples
from support.planning_cases import seeds
from zteam.geometry import Pose2, Velocity
from zteam.kernels.navigation import PathPlace
from zteam.navigation.planning.controller import BlockedError, RegulatedPurePursuit, time_to_collision
from zteam.navigation.planning.costmap import LETHAL_OBSTACLE, place
from zteam.planning import Costmap, CostmapOptions, make_circle, make_costmap, make_footprint, make_map


def touched(costmap: Costmap, pose: Pose2) -> set[tuple[int, int]]:
    """Lethal cells that the outline covers, found by points along it and within it: a cell's corner may lie between."""
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


def touched_at_all(costmap: Costmap, pose: Pose2) -> set[tuple[int, int]]:
    """Lethal cells that a convex outline overlaps, however little: no line separates the two."""
    corners = costmap.frame.points_to_cells(place(costmap.footprint, *pose))
    edges = np.roll(corners, -1, axis=0) - corners
    axes = np.concatenate((np.eye(2), np.stack((edges[:, 1], -edges[:, 0]), axis=1)))
    own = corners @ axes.T
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) @ axes.T
    rows, columns = costmap.costs.shape
    (left, low), (right, high) = np.floor(corners.min(axis=0)).astype(int), np.floor(corners.max(axis=0)).astype(int)
    found = set()
    for row, column in product(range(low, high + 1), range(left, right + 1)):
        cell = square + axes @ (column, row)
        overlaps = np.all((cell.min(axis=0) <= own.max(axis=0)) & (own.min(axis=0) <= cell.max(axis=0)))
        inside = 0 <= row < rows and 0 <= column < columns
        if overlaps and (not inside or costmap.costs[row, column] == LETHAL_OBSTACLE):
            found.add((row, column))
    return found


BOX = make_footprint([(0.125, 0.175), (-0.225, 0.175), (-0.225, -0.175), (0.125, -0.175)])
OUTLINES = st.sampled_from([make_circle(0.2), BOX])


def drive(pose: Pose2, velocity: Velocity, seconds: float) -> Pose2:
    """Along the exact arc."""
    half = 0.5 * velocity.turn * seconds
    chord = velocity.x * seconds * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
    return pose.compose(Pose2(chord * math.cos(half), chord * math.sin(half), 2.0 * half))


@examples(20)
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
        at_first = touched_at_all(costmap, pose)
        for part in (0.25, 0.5, 0.75, 1.0):
            assert touched(costmap, drive(pose, velocity, 0.1 * part)) <= at_first
        pose = drive(pose, velocity, 0.1)


@examples(25)
@given(seeds, OUTLINES)
@example(96639836, BOX)
def test_the_time_to_a_collision_is_that_of_small_steps(seed: int, outline: object) -> None:
    """The first touch along an arc comes when a walk in small steps finds it, within what two poses are apart."""
    rng = np.random.default_rng(seed)
    cells = np.where(rng.random((40, 40)) < 0.02, 100, 0).astype(np.int8)
    costmap = make_costmap(make_map(cells, 0.05), outline)  # type: ignore[arg-type]
    pose = Pose2(1.0, 1.0, float(rng.uniform(-3, 3)))
    velocity = Velocity(float(rng.uniform(-0.5, 0.5)), 0.0, float(rng.uniform(-1.5, 1.5)))
    at_first = touched_at_all(costmap, pose)
    moments = np.linspace(0.0, 1.0, 81)[1:]
    first = next((t for t in moments if not touched(costmap, drive(pose, velocity, t)) <= at_first), math.inf)
    found = time_to_collision(costmap, pose, velocity, 1.0)
    assert found <= first
    if math.isinf(first) and math.isfinite(found):
        # It keeps a twentieth of a cell, and cells that it merely comes near to count as well.
        near = make_footprint(costmap.footprint.corners, 0.006)
        wide = Costmap(costmap.frame, near)
        wide.costs[:] = costmap.costs
        assert not touched_at_all(wide, drive(pose, velocity, found + 0.03)) <= at_first


@given(seeds, st.integers(0, 30), st.floats(0.0, 9.0), st.floats(0.0, 4.0))
def test_a_place_on_a_path_is_that_of_a_look_at_all_poses(seed: int, count: int, ahead: float, reach: float) -> None:
    """The nearest pose in a stretch from the last one on, and the first one after it outside of a circle."""
    rng = np.random.default_rng(seed)
    path = np.cumsum(rng.normal(0.0, 0.5, (count + 1, 3)), axis=0)
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))))
    place, at = PathPlace(path, along), 0
    for x, y in rng.normal(0.0, 2.0, (5, 2)).tolist():
        away = [math.dist((x, y), pose[:2]) for pose in path.tolist()]
        last = next((i for i in range(at, count) if along[i] >= along[at] + ahead), count)
        place.advance(x, y, ahead)
        at = min(range(at, last + 1), key=away.__getitem__)
        assert place.at == at
        assert place.leave(x, y, reach) == next((i for i in range(at, count + 1) if away[i] >= reach), -1)


def test_outside_of_the_grid_is_lethal() -> None:
    """A robot that drives off the map touches what is beyond, and so does one that is nowhere, or gets there."""
    costmap = make_costmap(make_map(np.zeros((20, 20), np.int8), 0.05), make_circle(0.2))
    here, ahead = Pose2(0.5, 0.5, 0.0), Velocity(0.1)
    assert time_to_collision(costmap, here, ahead, 2.9) == math.inf
    assert time_to_collision(costmap, here, ahead, 3.1) == pytest.approx(2.96, abs=0.06)
    assert time_to_collision(costmap, here, Velocity(), 9.0) == math.inf
    for lost in (math.nan, math.inf, -1e300):
        assert time_to_collision(costmap, here._replace(x=lost), ahead, 1.0) <= 0.0
        assert time_to_collision(costmap, here, Velocity(0.0, lost), 1.0) == 0.0
