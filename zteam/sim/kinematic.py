"""Bodies that never touch: a move that would end in a collision is not made at all, and the robot stalls.

This is what Stage does (`stage`, with its own way of stepping), and the cheap way to move a crowd (`kinematic`).
Polygons are exact: bitmaps are tested cell by cell, polygons in convex parts. Robots move in the order of their ids.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.kernels.binding import follow, move_all
from zteam.sim.fields import Fields
from zteam.sim.grids import make_grids
from zteam.sim.polygons import Group, convex_solids, make_polygons
from zteam.world.model import Floorplan

Floats = NDArray[np.float64]


class KinematicBodies:
    """Robots that stall instead of touching; whatever else could be pushed stands still.

    `poses` is (movers, 3): x, y, yaw in `map`, robots first. With `tangents` a robot goes as Stage steps.
    """

    def __init__(
        self,
        robots: int,
        poses: Floats,
        floorplans: Sequence[tuple[Floorplan, Fields]],
        groups: Sequence[Group],
        tangents: bool,
    ) -> None:
        self._robots = robots
        self._tangents = tangents
        self._grids = make_grids(floorplans)
        solid = [group._replace(shapes=convex_solids(group.shapes)) for group in groups]
        self._polygons = make_polygons(solid)
        self._bodiless = np.setdiff1d(np.arange(robots), self._polygons.owner)
        self.poses = poses.copy()
        self.stalled = self.met = np.zeros(robots, bool)

    def step(self, seconds: float, velocity: Floats) -> None:
        """Advance by `seconds` with body velocities `velocity` (robots, 3): vx, vy in m/s, yaw rate in rad/s."""
        if not self._robots:
            return
        ends = follow(self.poses[: self._robots], velocity, seconds, tangents=self._tangents)
        self._polygons.move(self.poses)
        move_all(self._polygons, self._grids, self.poses, ends, self.stalled)
        self.poses[self._bodiless] = ends[self._bodiless]

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
