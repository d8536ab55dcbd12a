"""What moves in a world, by the rules of one of the kinds of physics; here those of bodies that never touch."""

from collections.abc import Sequence
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.kernels.simulator import Floats, follow, move_all
from zteam.simulator.core.casting import Plans, group_shapes, make_polygons, solid_bitmaps, solid_groups
from zteam.simulator.world.model import Obstacle, Robot


class Bodies(Protocol):
    """Everything that moves, and how it stops."""

    poses: Floats
    """(movers, 3): x, y, yaw in `map`; robots first, then what can be pushed."""
    stalled: NDArray[np.bool_]
    """(robots)"""
    met: NDArray[np.bool_]
    """(robots): whether something may have hindered it in the last step."""

    def step(self, seconds: float, velocity: Floats) -> None:
        """Advance by `seconds` with body velocities (robots, 3): vx, vy in m/s, yaw rate in rad/s."""

    def place(self, index: int, pose: Pose2) -> None:
        """Put a mover somewhere, at rest."""

    def adopt(self, old: Self, kept: Sequence[tuple[int, int]]) -> None:
        """Take over the motion of `old`, for pairs of movers (index here, index there); the poses are set already."""


def make_bodies(
    physics: str, robots: Sequence[Robot], poses: Floats, obstacles: Sequence[Obstacle], plans: Plans
) -> Bodies:
    """The bodies of `physics` (`zteam.config.simulation_options.PHYSICS`), with all movers at `poses` (movers, 3)."""
    if physics == "dynamic":
        from zteam.simulator.core.dynamic import DynamicBodies  # pymunk: imported only where it is used

        return DynamicBodies(robots, poses, plans, obstacles)
    return KinematicBodies(robots, poses, plans, obstacles, tangents=physics == "stage")


class KinematicBodies:
    """Robots that stall instead of touching: a move that would end in a collision is not made at all.

    This is what Stage does (with `tangents`, its own way of stepping), and the cheap way to move a crowd. Whatever else
    could be pushed stands still. Polygons are exact: bitmaps are tested cell by cell, polygons in convex parts. Robots
    move in the order of their ids.
    """

    def __init__(
        self, robots: Sequence[Robot], poses: Floats, plans: Plans, obstacles: Sequence[Obstacle], *, tangents: bool
    ) -> None:
        self._robots = len(robots)
        self._tangents = tangents
        self._bitmaps = solid_bitmaps(plans)
        self._polygons = make_polygons(solid_groups(group_shapes(robots, obstacles)))
        self._bodiless = np.setdiff1d(np.arange(self._robots), self._polygons.owner)
        self.poses = poses.copy()
        self.stalled = self.met = np.zeros(self._robots, bool)

    def step(self, seconds: float, velocity: Floats) -> None:
        if not self._robots:
            return
        ends = follow(self.poses[: self._robots], velocity, seconds, tangents=self._tangents)
        self._polygons.move(self.poses)
        move_all(self._polygons, self._bitmaps, self.poses, ends, self.stalled)
        self.poses[self._bodiless] = ends[self._bodiless]

    def place(self, index: int, pose: Pose2) -> None:
        self.poses[index] = pose
        if index < self._robots:
            self.stalled[index] = False

    def adopt(self, old: "KinematicBodies", kept: Sequence[tuple[int, int]]) -> None:
        for here, there in kept:
            if here < self._robots:
                self.stalled[here] = old.stalled[there]
