"""Floor plans as what collides: which points and cells are occupied, and the outline of them all."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.sim.compiling import compiled
from zteam.sim.fields import Fields
from zteam.sim.outlines import Outlines
from zteam.world.model import Floorplan

Floats = NDArray[np.float64]
Line = tuple[tuple[int, int], tuple[int, int]]
"""From x, y to x, y in cells."""


class Grids(NamedTuple):
    """All bitmaps that collide, as numba takes them."""

    sides: NDArray[np.uint8]
    """Fields of quadrant 0, one after the other: a cell is occupied where its largest empty square is 0."""
    table: Floats
    """(bitmaps, 11): offset in `sides`, rows, columns, cell x, cell y, cos, sin, x, y, z_min, z_max."""


def make_grids(floorplans: Sequence[tuple[Floorplan, Fields]]) -> Grids:
    """Grids of the floor plans that are obstacles."""
    solid = [(plan, fields) for plan, fields in floorplans if plan.obstacle]
    sides: list[NDArray[np.uint8]] = []
    offsets: dict[int, int] = {}
    end, rows = 0, []
    for plan, fields in solid:
        # Floor plans of one bitmap share their cells.
        if id(fields.sides) not in offsets:
            offsets[id(fields.sides)] = end
            sides.append(fields.sides[0, :-1])
            end += fields.rows * fields.columns
        turn = math.cos(plan.pose.yaw), math.sin(plan.pose.yaw)
        place = plan.pose.x, plan.pose.y, plan.z_min, plan.z_max
        rows.append([offsets[id(fields.sides)], fields.rows, fields.columns, *plan.cell, *turn, *place])
    return Grids(np.concatenate(sides) if sides else np.zeros(1, np.uint8), np.array(rows, float).reshape(-1, 11))


@compiled
def _is_inside(grids: Grids, x: float, y: float, low: float, high: float) -> bool:
    for k in range(grids.table.shape[0]):
        if grids.table[k, 9] >= high or grids.table[k, 10] <= low:
            continue
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
def _crosses_edge(o: Outlines, ax: float, ay: float, bx: float, by: float, low: float, high: float) -> bool:
    """Whether a straight way crosses an edge of something that stands still."""
    for group in range(o.owner.shape[0]):
        far = o.radius[group] + abs(bx - ax) + abs(by - ay)
        if abs(o.centre_x[group] - ax) > far or abs(o.centre_y[group] - ay) > far:
            continue
        for shape in range(o.first_shape[group], o.first_shape[group + 1]):
            if o.z_min[shape] >= high or o.z_max[shape] <= low:
                continue
            j = o.first_vertex[shape + 1] - 1
            for i in range(o.first_vertex[shape], o.first_vertex[shape + 1]):
                ex, ey = o.x[i] - o.x[j], o.y[i] - o.y[j]
                s = ex * (ay - o.y[j]) - ey * (ax - o.x[j])
                t = ex * (by - o.y[j]) - ey * (bx - o.x[j])
                u = (bx - ax) * (o.y[j] - ay) - (by - ay) * (o.x[j] - ax)
                v = (bx - ax) * (o.y[i] - ay) - (by - ay) * (o.x[i] - ax)
                if s * t < 0.0 and u * v < 0.0:
                    return True
                j = i
    return False


@compiled
def find_leaks(
    grids: Grids, fixed: Outlines, before: Floats, after: Floats, heights: Floats, suspects: NDArray[np.bool_]
) -> None:
    """Leave of the `suspects` only those whose straight way from `before` to `after` (x, y, …) leads into a wall.

    Walls count that share heights with the suspect's, (points, 2). A place that is not finite is in a wall.
    """
    step = 1.0
    for k in range(grids.table.shape[0]):
        step = min(step, 0.5 * min(grids.table[k, 3], grids.table[k, 4]))
    for i in range(suspects.shape[0]):
        if not suspects[i]:
            continue
        low, high = heights[i, 0], heights[i, 1]
        ax, ay, bx, by = before[i, 0], before[i, 1], after[i, 0], after[i, 1]
        if not (math.isfinite(bx) and math.isfinite(by)):
            continue
        count = 1 + int(min(1e4, math.hypot(bx - ax, by - ay) / step))
        suspects[i] = _crosses_edge(fixed, ax, ay, bx, by, low, high)
        for k in range(1, count + 1):
            if not suspects[i]:
                suspects[i] = _is_inside(grids, ax + (bx - ax) * k / count, ay + (by - ay) * k / count, low, high)


def is_occupied(plan: Floorplan, x: float, y: float) -> bool:
    """Whether the point (metres in `map`) lies in an occupied cell."""
    cos, sin = math.cos(plan.pose.yaw), math.sin(plan.pose.yaw)
    dx, dy = x - plan.pose.x, y - plan.pose.y
    column = math.floor((cos * dx + sin * dy) / plan.cell[0])
    row = math.floor((cos * dy - sin * dx) / plan.cell[1])
    rows, columns = plan.occupied.shape
    return 0 <= row < rows and 0 <= column < columns and bool(plan.occupied[row, column])


def outline(occupied: NDArray[np.bool_], limit: int) -> list[Line] | None:
    """The border of the occupied cells as maximal straight runs; None if there are more than `limit`."""
    across, along = _runs(occupied), _runs(occupied.T)
    if len(across[0]) + len(along[0]) > limit:
        return None
    runs = [((x, a), (x, b)) for x, a, b in zip(*(values.tolist() for values in along), strict=True)]
    return runs + [((a, y), (b, y)) for y, a, b in zip(*(values.tolist() for values in across), strict=True)]


def _runs(occupied: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Runs (line, begin, end) along axis 1 where occupied and free meet across axis 0."""
    rows, columns = occupied.shape
    padded = np.zeros((rows + 2, columns), bool)
    padded[1:-1] = occupied
    border = np.zeros((rows + 1, columns + 2), np.int8)
    border[:, 1:-1] = padded[1:] != padded[:-1]
    change = np.diff(border, axis=1)
    lines, begins = np.nonzero(change == 1)
    _, ends = np.nonzero(change == -1)
    return lines, begins, ends
