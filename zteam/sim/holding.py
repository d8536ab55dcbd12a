"""Limits on the solver of contacts: no body is carried into a wall, and no two are pressed into each other.

A solver that iterates lets bodies sink into each other under pressure, and passes a thin wall in one step. So each
motion that it proposes is tested, exactly, at places along its way. The test takes a body's core: its polygon less a
rim. The solver alone handles contacts within the rim. A body goes as far as its core is free and stops there. A free
core stays free, so no body passes through another or through a wall.
"""

import math
from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam.kernels.binding import find_overlaps, hold
from zteam.sim.fields import Fields
from zteam.sim.grids import make_grids
from zteam.sim.polygons import NO_MOVER, Group, convex_solids, make_polygons
from zteam.world.model import Floorplan, Point2, Shape

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

class Cores:
    """The cores of all movers, and what they must stay out of: what stands still and, with `apart`, each other."""

    def __init__(
        self,
        groups: Sequence[Group],
        floorplans: Sequence[tuple[Floorplan, Fields]],
        poses: Floats,
        rim: float,
        apart: bool,
    ) -> None:
        """`poses` is (movers, 3); `rim` metres are taken off every polygon, less where it is narrow."""
        solid = [group._replace(shapes=convex_solids(group.shapes)) for group in groups]
        solid = [group for group in solid if group.shapes]
        widest = [max(half_width(shape.points) for shape in group.shapes) for group in solid]
        self._polygons = make_polygons(
            [
                group
                if group.owner == NO_MOVER
                else group._replace(shapes=[_core(shape, rim) for shape in group.shapes])
                for group in solid
            ]
        )
        self._core_half = np.array([max(0.5 * half, half - rim) for half in widest], float)
        self.half = np.full(len(poses), np.inf)
        """(movers): half the width of the widest part of a body; inf for one that collides with nothing."""
        for group, half in zip(solid, widest, strict=True):
            if group.owner != NO_MOVER:
                self.half[group.owner] = half
        self._grids = make_grids(floorplans)
        self._apart = apart
        self.in_wall, self._tangled = np.zeros((2, len(poses)), bool)
        """(movers): whether its core stands in something that stands still, from where no way is free."""
        self.stuck: list[int] = []
        """The movers of `in_wall`."""
        self.look(poses)

    def look(self, poses: Floats) -> None:
        """See which cores overlap what, after something has been put elsewhere."""
        self._polygons.move(poses)
        find_overlaps(self._polygons, self._grids, False, self.in_wall)
        find_overlaps(self._polygons, self._grids, self._apart, self._tangled)
        self.stuck = np.flatnonzero(self.in_wall).tolist()

    def hold(self, poses: Floats, ends: Floats, suspects: Flags) -> Floats:
        """Cut the ways of `suspects` from `poses` to `ends` (movers, 3) short; the shares (movers) that are left."""
        if self._apart and self._tangled.any():
            self.look(poses)
        self._polygons.move(poses)
        return hold(self._polygons, self._grids, self._core_half, poses, ends, suspects, self._tangled, self._apart)


def half_width(points: Sequence[Point2]) -> float:
    """The distance of a convex polygon's edges from the mean of its corners, at least: half the side of a square."""
    x, y = np.mean(points, axis=0)
    return float(min(_distance(a, b, (x, y)) for a, b in _edges(points)))


def _edges(points: Sequence[Point2]) -> list[tuple[Point2, Point2]]:
    pairs = zip(points, (*points[1:], points[0]), strict=True)
    return [(a, b) for a, b in pairs if math.dist(a, b) > 0.0]


def _distance(a: Point2, b: Point2, c: Point2) -> float:
    """Of point c from the line through a and b, positive on its left."""
    return ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / math.dist(a, b)


def _cores(group: Group, rim: float) -> Group:
    return group._replace(shapes=[_core(shape, rim) for shape in group.shapes])


def _core(shape: Shape, rim: float) -> Shape:
    """A convex shape less a rim, of at most half of its half width."""
    rim = min(rim, 0.5 * half_width(shape.points))
    left: list[Point2] = list(shape.points)
    for a, b in _edges(shape.points):
        inner = [_distance(a, b, point) - rim for point in left]
        kept: list[Point2] = []
        for (p, d), (q, e) in zip(zip(left, inner, strict=True), _turned(left, inner), strict=True):
            if d >= 0.0:
                kept.append(p)
            if (d >= 0.0) != (e >= 0.0):
                t = d / (d - e)
                kept.append((p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])))
        left = kept
    return msgspec.structs.replace(shape, points=tuple(left))


def _turned(points: Sequence[Point2], values: Sequence[float]) -> list[tuple[Point2, float]]:
    pairs = list(zip(points, values, strict=True))
    return [*pairs[1:], pairs[0]]
