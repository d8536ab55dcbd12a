"""Which polygons overlap: polygons in convex parts against each other, and against the cells of bitmaps, exactly."""

import math
from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam.sim.grids import Grids
from zteam.sim.jit import compiled
from zteam.sim.polygons import NO_MOVER, Polygons, bin_at, contains
from zteam.world.model import Shape
from zteam.world.shapes import is_convex

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

NOTHING = -1
"""What `find_overlap` gives where nothing overlaps; -2 - k is bitmap k."""
_TOUCH = 1e-9
"""Metres that polygons may overlap and still only touch."""


@compiled
def place_group(o: Polygons, group: int, x: float, y: float, yaw: float) -> None:
    cos, sin = math.cos(yaw), math.sin(yaw)
    u, v = o.local_centre[group, 0], o.local_centre[group, 1]
    o.centre_x[group], o.centre_y[group] = x + cos * u - sin * v, y + sin * u + cos * v
    for i in range(o.first_vertex[o.first_shape[group]], o.first_vertex[o.first_shape[group + 1]]):
        u, v = o.local_x[i], o.local_y[i]
        o.x[i], o.y[i] = x + cos * u - sin * v, y + sin * u + cos * v


@compiled
def _is_beside(o: Polygons, a: int, b: int, c: int, d: int) -> bool:
    """Whether an edge of the convex polygon of vertices a to b has all vertices c to d on its outer side."""
    j = b - 1
    for i in range(a, b):
        ex, ey = o.x[i] - o.x[j], o.y[i] - o.y[j]
        inner = _TOUCH * math.hypot(ex, ey)
        beside = inner > 0.0
        for k in range(c, d):
            if ex * (o.y[k] - o.y[j]) - ey * (o.x[k] - o.x[j]) > inner:
                beside = False
                break
        if beside:
            return True
        j = i
    return False


@compiled
def _shapes_overlap(o: Polygons, one: int, other: int) -> bool:
    """Whether two convex polygons overlap, for no edge parts them; touching is not overlapping."""
    a, b, c, d = o.first_vertex[one], o.first_vertex[one + 1], o.first_vertex[other], o.first_vertex[other + 1]
    return not _is_beside(o, a, b, c, d) and not _is_beside(o, c, d, a, b)


@compiled
def _groups_overlap(o: Polygons, one: int, other: int) -> bool:
    dx, dy = o.centre_x[one] - o.centre_x[other], o.centre_y[one] - o.centre_y[other]
    reach = o.radius[one] + o.radius[other]
    if dx * dx + dy * dy >= reach * reach:
        return False
    for i in range(o.first_shape[one], o.first_shape[one + 1]):
        for j in range(o.first_shape[other], o.first_shape[other + 1]):
            if o.z_min[i] < o.z_max[j] and o.z_min[j] < o.z_max[i] and _shapes_overlap(o, i, j):
                return True
    return False


@compiled
def _edge_meets_box(ax: float, ay: float, bx: float, by: float, left: float, bottom: float) -> bool:
    """Whether a line passes through the open unit square at `left, bottom` (Liang and Barsky's clipping)."""
    first, last = 0.0, 1.0
    for axis in range(2):
        start, way, low = (ax, bx - ax, left) if axis == 0 else (ay, by - ay, bottom)
        if way == 0.0:
            if start <= low or start >= low + 1.0:
                return False
            continue
        t, u = (low - start) / way, (low + 1.0 - start) / way
        first, last = max(first, min(t, u)), min(last, max(t, u))
    return first < last


@compiled
def _shape_meets_grid(o: Polygons, shape: int, grids: Grids, k: int, px: Floats, py: Floats) -> bool:
    """Whether a polygon covers part of an occupied cell; `px, py` are buffers for its corners."""
    rows, columns = int(grids.table[k, 1]), int(grids.table[k, 2])
    cell_x, cell_y, cos, sin = grids.table[k, 3], grids.table[k, 4], grids.table[k, 5], grids.table[k, 6]
    begin = o.first_vertex[shape]
    count = o.first_vertex[shape + 1] - begin
    left = bottom = 1e18
    right = top = -1e18
    for i in range(count):
        dx, dy = o.x[begin + i] - grids.table[k, 7], o.y[begin + i] - grids.table[k, 8]
        px[i], py[i] = (cos * dx + sin * dy) / cell_x, (cos * dy - sin * dx) / cell_y
        left, right, bottom, top = min(left, px[i]), max(right, px[i]), min(bottom, py[i]), max(top, py[i])
    if right <= 0.0 or top <= 0.0 or left >= columns or bottom >= rows:
        return False
    first_x, last_x = max(0, math.floor(left)), min(columns - 1, math.floor(right))
    first_y, last_y = max(0, math.floor(bottom)), min(rows - 1, math.floor(top))
    offset = int(grids.table[k, 0])
    if grids.sides[offset + first_y * columns + first_x] > max(last_x - first_x, last_y - first_y):
        return False
    for y in range(first_y, last_y + 1):
        for x in range(first_x, last_x + 1):
            if grids.sides[offset + y * columns + x] == 0:
                if contains(px, py, 0, count, x + 0.5, y + 0.5):
                    return True
                j = count - 1
                for i in range(count):
                    if _edge_meets_box(px[j], py[j], px[i], py[i], x, y):
                        return True
                    j = i
    return False


@compiled
def find_overlap(o: Polygons, group: int, grids: Grids, slack: float, ignored: Flags, px: Floats, py: Floats) -> int:
    """What a group overlaps where it has been placed: another group, NOTHING, or -2 - k for bitmap k.

    Movers that are `ignored` (movers) do not count. Bins are up to `slack` metres out of date; `px, py` are buffers for
    the corners of a shape (`most_corners`).
    """
    for shape in range(o.first_shape[group], o.first_shape[group + 1]):
        for k in range(grids.table.shape[0]):
            if (
                o.z_min[shape] < grids.table[k, 10]
                and grids.table[k, 9] < o.z_max[shape]
                and _shape_meets_grid(o, shape, grids, k, px, py)
            ):
                return -2 - k
    x, y = o.centre_x[group], o.centre_y[group]
    reach = o.radius[group] + o.reach[0] + slack
    first_column, last_column = bin_at(o, x - reach, o.bin_x[0], 0), bin_at(o, x + reach, o.bin_x[0], 0)
    first_row, last_row = bin_at(o, y - reach, o.bin_y[0], 1), bin_at(o, y + reach, o.bin_y[0], 1)
    for row in range(first_row, last_row + 2):
        first, last = row * o.bins[0] + first_column, row * o.bins[0] + last_column
        if row > last_row:
            first = last = o.bins[0] * o.bins[1]
        for slot in range(o.bin_start[first], o.bin_start[last + 1]):
            other = o.in_bin[slot]
            owner = o.owner[other]
            if other != group and (owner == NO_MOVER or not ignored[owner]) and _groups_overlap(o, group, other):
                return int(other)
    return NOTHING


@compiled
def most_corners(o: Polygons) -> int:
    """Corners of the shape that has the most: the size of the buffers of `find_overlap`."""
    size = 0
    for shape in range(o.z_min.shape[0]):
        size = max(size, o.first_vertex[shape + 1] - o.first_vertex[shape])
    return size


def convex_solids(shapes: Sequence[Shape]) -> list[Shape]:
    """What collides of these shapes, in convex parts."""
    parts = []
    for shape in shapes:
        if shape.obstacle and is_convex(shape.points):
            parts.append(shape)
        elif shape.obstacle:
            from zteam.sim.dynamic import convex_parts  # pymunk: imported only for such a shape

            parts += [msgspec.structs.replace(shape, points=tuple(points)) for points in convex_parts(shape.points)]
    return parts
