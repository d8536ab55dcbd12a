"""Bodies that never touch: a move that would end in a collision is refused whole, and the robot stalls.

This is what Stage does (`stage`, with its own way of stepping), and the cheap way to move a crowd (`kinematic`).
Outlines are exact: bitmaps are tested cell by cell, polygons in convex parts. Robots move in the order of their ids.
"""

import math
from collections.abc import Callable, Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.sim.compiling import compiled
from zteam.sim.fields import Fields
from zteam.sim.grids import Grids, make_grids
from zteam.sim.outlines import Group, Outlines, bin_at, make_outlines, move_outlines
from zteam.world.model import Floorplan, Shape
from zteam.world.shapes import is_convex

Floats = NDArray[np.float64]

_STRIDE = 0.1
"""Metres, and radians, between the places along a move that are tested."""
_MAX_PLACES = 1000
_TOUCH = 1e-9
"""Metres that polygons may overlap and still only touch."""


@compiled
def _place_group(o: Outlines, group: int, x: float, y: float, yaw: float) -> None:
    cos, sin = math.cos(yaw), math.sin(yaw)
    u, v = o.local_centre[group, 0], o.local_centre[group, 1]
    o.centre_x[group], o.centre_y[group] = x + cos * u - sin * v, y + sin * u + cos * v
    for i in range(o.first_vertex[o.first_shape[group]], o.first_vertex[o.first_shape[group + 1]]):
        u, v = o.local_x[i], o.local_y[i]
        o.x[i], o.y[i] = x + cos * u - sin * v, y + sin * u + cos * v


@compiled
def _contains(px: Floats, py: Floats, begin: int, end: int, x: float, y: float) -> bool:
    """Even-odd rule."""
    inside = False
    j = end - 1
    for i in range(begin, end):
        if (py[i] > y) != (py[j] > y) and x < px[i] + (y - py[i]) * (px[j] - px[i]) / (py[j] - py[i]):
            inside = not inside
        j = i
    return inside


@compiled
def _is_beside(o: Outlines, a: int, b: int, c: int, d: int) -> bool:
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
def _shapes_overlap(o: Outlines, one: int, other: int) -> bool:
    """Whether two convex polygons overlap, for no edge parts them; touching is not overlapping."""
    a, b, c, d = o.first_vertex[one], o.first_vertex[one + 1], o.first_vertex[other], o.first_vertex[other + 1]
    return not _is_beside(o, a, b, c, d) and not _is_beside(o, c, d, a, b)


@compiled
def _groups_overlap(o: Outlines, one: int, other: int) -> bool:
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
def _shape_meets_grid(o: Outlines, shape: int, grids: Grids, k: int, px: Floats, py: Floats) -> bool:
    """Whether a polygon covers part of an occupied cell; `px, py` are room for its corners."""
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
                if _contains(px, py, 0, count, x + 0.5, y + 0.5):
                    return True
                j = count - 1
                for i in range(count):
                    if _edge_meets_box(px[j], py[j], px[i], py[i], x, y):
                        return True
                    j = i
    return False


@compiled
def _collides(o: Outlines, group: int, grids: Grids, slack: float, px: Floats, py: Floats) -> bool:
    """Whether a group, where it has been placed, overlaps anything; bins are up to `slack` metres out of date."""
    for shape in range(o.first_shape[group], o.first_shape[group + 1]):
        for k in range(grids.table.shape[0]):
            if (
                o.z_min[shape] < grids.table[k, 10]
                and grids.table[k, 9] < o.z_max[shape]
                and _shape_meets_grid(o, shape, grids, k, px, py)
            ):
                return True
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
            if other != group and _groups_overlap(o, group, other):
                return True
    return False


@compiled
def move_all(o: Outlines, grids: Grids, robots: int, poses: Floats, ends: Floats, refused: NDArray[np.bool_]) -> None:
    """Move the first `robots` movers from `poses` to `ends` where nothing is in the way, in order."""
    slack = 0.0
    for group in range(o.owner.shape[0]):
        i = o.owner[group]
        if 0 <= i < robots:
            way = math.hypot(ends[i, 0] - poses[i, 0], ends[i, 1] - poses[i, 1])
            # A turn about the base's origin swings the centre of the outline.
            swing = math.hypot(o.local_centre[group, 0], o.local_centre[group, 1]) * abs(ends[i, 2] - poses[i, 2])
            slack = max(slack, way + swing)
    size = 0
    for shape in range(o.z_min.shape[0]):
        size = max(size, o.first_vertex[shape + 1] - o.first_vertex[shape])
    px, py = np.empty(size), np.empty(size)
    for group in range(o.owner.shape[0]):
        i = o.owner[group]
        if i < 0 or i >= robots:
            continue
        dx, dy, turn = ends[i, 0] - poses[i, 0], ends[i, 1] - poses[i, 1], ends[i, 2] - poses[i, 2]
        refused[i] = False
        if dx == 0.0 and dy == 0.0 and turn == 0.0:
            continue
        arm = max(1.0, math.hypot(o.local_centre[group, 0], o.local_centre[group, 1]))
        places = min(_MAX_PLACES, 1 + int(max(math.hypot(dx, dy), arm * abs(turn)) / _STRIDE))
        for k in range(1, places + 1):
            share = k / places
            _place_group(o, group, poses[i, 0] + share * dx, poses[i, 1] + share * dy, poses[i, 2] + share * turn)
            if _collides(o, group, grids, slack, px, py):
                refused[i] = True
                break
        if refused[i]:
            _place_group(o, group, poses[i, 0], poses[i, 1], poses[i, 2])
        else:
            poses[i, 0], poses[i, 1], poses[i, 2] = ends[i, 0], ends[i, 1], ends[i, 2]


def _convex_solids(shapes: Sequence[Shape]) -> list[Shape]:
    """What collides of these shapes, in convex parts."""
    parts = []
    for shape in shapes:
        if shape.obstacle and is_convex(shape.points):
            parts.append(shape)
        elif shape.obstacle:
            from zteam.sim.physics import convex_parts  # pymunk's: only who has such a shape pays for it

            parts += [msgspec.structs.replace(shape, points=tuple(points)) for points in convex_parts(shape.points)]
    return parts


class RefusingBodies:
    """Robots that stall instead of touching; whatever else could be pushed stands still.

    `poses` is (movers, 3): x, y, yaw in `map`, robots first. `follow` says how a robot goes (`zteam.sim.motion`).
    """

    def __init__(
        self,
        robots: int,
        poses: Floats,
        floorplans: Sequence[tuple[Floorplan, Fields]],
        groups: Sequence[Group],
        follow: Callable[[Floats, Floats, float, Floats], None],
    ) -> None:
        self._robots = robots
        self._follow = follow
        self._grids = make_grids(floorplans)
        solid = [group._replace(shapes=_convex_solids(group.shapes)) for group in groups]
        self._outlines = make_outlines(solid)
        self._bodiless = np.setdiff1d(np.arange(robots), self._outlines.owner)
        self.poses = poses.copy()
        self.stalled = np.zeros(robots, bool)
        self._ends = np.empty((robots, 3))

    def step(self, seconds: float, velocity: Floats) -> None:
        """Advance by `seconds` with body velocities `velocity` (robots, 3): vx, vy in m/s, yaw rate in rad/s."""
        if not self._robots:
            return
        self._follow(self.poses, velocity, seconds, self._ends)
        if len(self._outlines.owner):
            move_outlines(self._outlines, self.poses)
            move_all(self._outlines, self._grids, self._robots, self.poses, self._ends, self.stalled)
        self.poses[self._bodiless] = self._ends[self._bodiless]

    def place(self, index: int, pose: Pose2) -> None:
        """Put a mover somewhere, at rest."""
        self.poses[index] = pose
        if index < self._robots:
            self.stalled[index] = False

    def adopt(self, old: "RefusingBodies", kept: Sequence[tuple[int, int]]) -> None:
        """Go on from another's motion, for pairs of movers (index here, index there)."""
        for here, there in kept:
            if here < self._robots:
                self.stalled[here] = old.stalled[there]
