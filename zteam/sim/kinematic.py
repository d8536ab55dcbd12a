"""Bodies that never touch: a move that would end in a collision is not made at all, and the robot stalls.

This is what Stage does (`stage`, with its own way of stepping), and the cheap way to move a crowd (`kinematic`).
Polygons are exact: bitmaps are tested cell by cell, polygons in convex parts. Robots move in the order of their ids.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.sim.fields import Fields
from zteam.sim.grids import Grids, make_grids
from zteam.sim.jit import compiled
from zteam.sim.overlaps import NOTHING, convex_solids, find_overlap, most_corners, place_group
from zteam.sim.polygons import Group, Polygons, make_polygons, move_polygons
from zteam.world.model import Floorplan

Floats = NDArray[np.float64]

_STRIDE = 0.1
"""Metres, and radians, between the places along a move that are tested."""
_MAX_PLACES = 1000


@compiled
def move_all(o: Polygons, grids: Grids, robots: int, poses: Floats, ends: Floats, blocked: NDArray[np.bool_]) -> None:
    """Move the first `robots` movers, in order, from `poses` to `ends`; a move that meets something is `blocked`."""
    slack = 0.0
    for group in range(o.owner.shape[0]):
        i = o.owner[group]
        if 0 <= i < robots:
            way = math.hypot(ends[i, 0] - poses[i, 0], ends[i, 1] - poses[i, 1])
            # A turn about the base's origin swings the centre of the group.
            swing = math.hypot(o.local_centre[group, 0], o.local_centre[group, 1]) * abs(ends[i, 2] - poses[i, 2])
            slack = max(slack, way + swing)
    size = most_corners(o)
    px, py, ignored = np.empty(size), np.empty(size), np.zeros(poses.shape[0], np.bool_)
    for group in range(o.owner.shape[0]):
        i = o.owner[group]
        if i < 0 or i >= robots:
            continue
        dx, dy, turn = ends[i, 0] - poses[i, 0], ends[i, 1] - poses[i, 1], ends[i, 2] - poses[i, 2]
        blocked[i] = False
        if dx == 0.0 and dy == 0.0 and turn == 0.0:
            continue
        arm = max(1.0, math.hypot(o.local_centre[group, 0], o.local_centre[group, 1]))
        places = min(_MAX_PLACES, 1 + int(max(math.hypot(dx, dy), arm * abs(turn)) / _STRIDE))
        for k in range(1, places + 1):
            share = k / places
            place_group(o, group, poses[i, 0] + share * dx, poses[i, 1] + share * dy, poses[i, 2] + share * turn)
            if find_overlap(o, group, grids, slack, ignored, px, py) != NOTHING:
                blocked[i] = True
                break
        if blocked[i]:
            place_group(o, group, poses[i, 0], poses[i, 1], poses[i, 2])
        else:
            poses[i, 0], poses[i, 1], poses[i, 2] = ends[i, 0], ends[i, 1], ends[i, 2]


class KinematicBodies:
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
        solid = [group._replace(shapes=convex_solids(group.shapes)) for group in groups]
        self._polygons = make_polygons(solid)
        self._bodiless = np.setdiff1d(np.arange(robots), self._polygons.owner)
        self.poses = poses.copy()
        self.stalled = self.met = np.zeros(robots, bool)
        self._ends = np.empty((robots, 3))

    def step(self, seconds: float, velocity: Floats) -> None:
        """Advance by `seconds` with body velocities `velocity` (robots, 3): vx, vy in m/s, yaw rate in rad/s."""
        if not self._robots:
            return
        self._follow(self.poses, velocity, seconds, self._ends)
        if len(self._polygons.owner):
            move_polygons(self._polygons, self.poses)
            move_all(self._polygons, self._grids, self._robots, self.poses, self._ends, self.stalled)
        self.poses[self._bodiless] = self._ends[self._bodiless]

    def place(self, index: int, pose: Pose2) -> None:
        """Put a mover somewhere, at rest."""
        self.poses[index] = pose
        if index < self._robots:
            self.stalled[index] = False

    def adopt(self, old: "KinematicBodies", kept: Sequence[tuple[int, int]]) -> None:
        """Go on from another's motion, for pairs of movers (index here, index there)."""
        for here, there in kept:
            if here < self._robots:
                self.stalled[here] = old.stalled[there]
