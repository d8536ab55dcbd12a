"""Floor plans as what collides: which points and cells are occupied, and the outline of them all."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.sim.compiling import compiled
from zteam.sim.fields import Fields
from zteam.world.model import Floorplan

Floats = NDArray[np.float64]


class Grids(NamedTuple):
    """All bitmaps that collide, as numba takes them."""

    sides: NDArray[np.uint8]
    """Fields of quadrant 0, one after the other: a cell is occupied where its largest empty square is 0."""
    table: Floats
    """(bitmaps, 11): offset in `sides`, rows, columns, cell x, cell y, cos, sin, x, y, z_min, z_max."""


def make_grids(floorplans: Sequence[tuple[Floorplan, Fields]]) -> Grids:
    """Grids of the floor plans that are obstacles."""
    solid = [(plan, fields) for plan, fields in floorplans if plan.obstacle]
    offset, rows = 0, []
    for plan, fields in solid:
        turn = math.cos(plan.pose.yaw), math.sin(plan.pose.yaw)
        place = plan.pose.x, plan.pose.y, plan.z_min, plan.z_max
        rows.append([offset, fields.rows, fields.columns, *plan.cell, *turn, *place])
        offset += fields.rows * fields.columns
    sides = [fields.sides[0, :-1] for _, fields in solid]
    return Grids(np.concatenate(sides) if sides else np.zeros(1, np.uint8), np.array(rows, float).reshape(-1, 11))


@compiled
def _is_inside(grids: Grids, x: float, y: float) -> bool:
    for k in range(grids.table.shape[0]):
        cos, sin = grids.table[k, 5], grids.table[k, 6]
        dx, dy = x - grids.table[k, 7], y - grids.table[k, 8]
        column = math.floor((cos * dx + sin * dy) / grids.table[k, 3])
        row = math.floor((cos * dy - sin * dx) / grids.table[k, 4])
        rows, columns = int(grids.table[k, 1]), int(grids.table[k, 2])
        if (
            0 <= row < rows
            and 0 <= column < columns
            and grids.sides[int(grids.table[k, 0]) + row * columns + column] == 0
        ):
            return True
    return False


@compiled
def find_inside(grids: Grids, poses: Floats) -> NDArray[np.bool_]:
    """Which of the points `poses` (x and y in `map` come first) lie in an occupied cell, at whatever height."""
    inside = np.zeros(poses.shape[0], np.bool_)
    for i in range(poses.shape[0]):
        if math.isfinite(poses[i, 0]) and math.isfinite(poses[i, 1]):
            inside[i] = _is_inside(grids, poses[i, 0], poses[i, 1])
    return inside


def is_occupied(plan: Floorplan, x: float, y: float) -> bool:
    """Whether the point (metres in `map`) lies in an occupied cell."""
    cos, sin = math.cos(plan.pose.yaw), math.sin(plan.pose.yaw)
    dx, dy = x - plan.pose.x, y - plan.pose.y
    column = math.floor((cos * dx + sin * dy) / plan.cell[0])
    row = math.floor((cos * dy - sin * dx) / plan.cell[1])
    rows, columns = plan.occupied.shape
    return 0 <= row < rows and 0 <= column < columns and bool(plan.occupied[row, column])


def outline(occupied: NDArray[np.bool_]) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """The border of the occupied cells as maximal straight runs: ((x, y), (x, y)) in cells."""
    runs = [((x, a), (x, b)) for x, a, b in _runs(occupied.T)]
    return runs + [((a, y), (b, y)) for y, a, b in _runs(occupied)]


def _runs(occupied: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
    """Runs (line, begin, end) along axis 1 where occupied and free meet across axis 0."""
    rows, columns = occupied.shape
    padded = np.zeros((rows + 2, columns), bool)
    padded[1:-1] = occupied
    border = np.zeros((rows + 1, columns + 2), np.int8)
    border[:, 1:-1] = padded[1:] != padded[:-1]
    change = np.diff(border, axis=1)
    lines, begins = np.nonzero(change == 1)
    _, ends = np.nonzero(change == -1)
    return list(zip(lines.tolist(), begins.tolist(), ends.tolist(), strict=True))
