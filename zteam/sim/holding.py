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

from zteam.sim.fields import Fields
from zteam.sim.grids import Grids, make_grids
from zteam.sim.jit import compiled
from zteam.sim.overlaps import NOTHING, convex_solids, find_overlap, most_corners, place_group
from zteam.sim.polygons import NO_MOVER, Group, Polygons, make_polygons, move_polygons
from zteam.world.model import Floorplan, Point2, Shape

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

_MAX_PLACES = 1000
"""Places along one way that are tested."""
_HALVINGS = 6
"""Of the piece of a way in which a core was stopped."""
_ROUNDS = 4
"""Rounds over all bodies: one that was stopped by another goes on when the other has gone."""


@compiled
def _go(o: Polygons, group: int, pose: Floats, end: Floats, share: float, out: Floats) -> None:
    """Place a group at this share of its way, and write the pose into `out`."""
    for axis in range(3):
        out[axis] = end[axis] if share == 1.0 else pose[axis] + share * (end[axis] - pose[axis])
    place_group(o, group, out[0], out[1], out[2])


@compiled
def _advance(
    o: Polygons, group: int, grids: Grids, slack: float, ignored: Flags, pose: Floats, end: Floats,
    share: float, places: int, out: Floats, px: Floats, py: Floats,
) -> float:  # fmt: skip
    """How far, from `share` on, a group's way is free; the group is placed there, its pose is `out`."""
    free, blocked = share, 2.0
    tested = halvings = 0
    # One call for both purposes: each is compiled once more into this function.
    while free < 1.0 and halvings < _HALVINGS:
        if blocked > 1.0:
            tested += 1
            at = 1.0 if tested == places else share + (1.0 - share) * tested / places
        else:
            halvings += 1
            at = 0.5 * (free + blocked)
        _go(o, group, pose, end, at, out)
        if find_overlap(o, group, grids, slack, ignored, px, py) == NOTHING:
            free = at
        else:
            blocked = at
    if free < 1.0:
        _go(o, group, pose, end, free, out)
    return free


@compiled
def _measure_ways(
    owner: NDArray[np.int64], centre: Floats, radius: Floats, half: Floats, poses: Floats, ends: Floats,
    suspects: Flags, places: Floats, shares: Floats,
) -> float:  # fmt: skip
    """Number the `places` to test along each suspect's way; the longest way of any point of a body in metres.

    `owner`, `centre` and `radius` are the groups'. `shares` is 0 for a way to be tested, 1 for any other. A way to a
    place that is not finite is none.
    """
    longest = 0.0
    for group in range(owner.shape[0]):
        i = owner[group]
        if i < 0:
            continue
        dx, dy, turn = ends[i, 0] - poses[i, 0], ends[i, 1] - poses[i, 1], ends[i, 2] - poses[i, 2]
        if not math.isfinite(dx + dy + turn):
            shares[i] = 0.0
            ends[i] = poses[i]
        elif suspects[i] and (dx != 0.0 or dy != 0.0 or turn != 0.0):
            arm = math.hypot(centre[group, 0], centre[group, 1])
            way = math.hypot(dx, dy) + (arm + radius[group]) * abs(turn)
            longest = max(longest, way)
            places[i] = 1.0 + min(float(_MAX_PLACES), way / half[group])
            shares[i] = 0.0
    return longest


@compiled
def hold(
    o: Polygons, grids: Grids, half: Floats, poses: Floats, ends: Floats, suspects: Flags, tangled: Flags, apart: bool,
    shares: Floats,
) -> None:  # fmt: skip
    """Cut the ways of the `suspects` from `poses` to `ends` (movers; x, y, yaw) to what is free; `shares` is how much.

    `half` (groups) is half the width of a core: no two places that are tested are farther apart. With `apart` cores
    stay out of each other too, unless both are `tangled`. All groups have been placed at `poses`.
    """
    movers = poses.shape[0]
    none, every = np.zeros(movers, np.bool_), np.ones(movers, np.bool_)
    size = most_corners(o)
    px, py, out = np.empty(size), np.empty(size), np.empty(3)
    shares[:] = 1.0
    places = np.zeros(movers)
    slack = _measure_ways(o.owner, o.local_centre, o.radius, half, poses, ends, suspects, places, shares)
    for _ in range(_ROUNDS):
        went = False
        # What is pushed goes before what pushes it: robots come first in the order of movers.
        for group in range(o.owner.shape[0] - 1, -1, -1):
            i = o.owner[group]
            if i < 0 or shares[i] >= 1.0 or places[i] == 0.0:
                continue
            ignored = every if not apart else tangled if tangled[i] else none
            way, share = int(places[i]), shares[i]
            shares[i] = _advance(o, group, grids, slack, ignored, poses[i], ends[i], share, way, out, px, py)
            went |= shares[i] > share
        if not went:
            break
    for i in range(movers):
        if places[i] > 0.0 and shares[i] < 1.0:
            for axis in range(3):
                ends[i, axis] = poses[i, axis] + shares[i] * (ends[i, axis] - poses[i, axis])


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
        o = self._polygons
        if not len(self._core_half):
            return
        move_polygons(o, poses)
        px, py = np.empty((2, most_corners(o)))
        for found, ignored in ((self.in_wall, True), (self._tangled, not self._apart)):
            uncounted = np.full(len(poses), ignored)
            for group in np.flatnonzero(o.owner != NO_MOVER).tolist():
                found[o.owner[group]] = find_overlap(o, group, self._grids, 0.0, uncounted, px, py) != NOTHING
        self.stuck = np.flatnonzero(self.in_wall).tolist()

    def hold(self, poses: Floats, ends: Floats, suspects: Flags) -> Floats:
        """Cut the ways of `suspects` from `poses` to `ends` (movers, 3) short; the shares (movers) that are left."""
        shares = np.ones(len(poses))
        if len(self._core_half):
            if self._apart and self._tangled.any():
                self.look(poses)
            move_polygons(self._polygons, poses)
            state = self._tangled, self._apart, shares
            hold(self._polygons, self._grids, self._core_half, poses, ends, suspects, *state)
        return shares


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
