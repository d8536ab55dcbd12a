"""What moves in a world, by the rules of one of the kinds of physics."""

from collections.abc import Sequence
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.sim.fields import Fields
from zteam.sim.kinematic import KinematicBodies
from zteam.sim.polygons import group_shapes
from zteam.world.model import Floorplan, Robot, World

Floats = NDArray[np.float64]


class Bodies(Protocol):
    """Everything that moves, and how it stops."""

    poses: Floats
    """(movers, 3): x, y, yaw in `map`; robots first, then what can be pushed."""
    stalled: NDArray[np.bool_]
    """(robots)"""
    met: NDArray[np.bool_]
    """(robots): whether something may have hindered it in the last step."""

    def step(self, seconds: float, velocity: Floats) -> None:
        """Advance by `seconds` with body velocities (robots, 3)."""

    def place(self, index: int, pose: Pose2) -> None:
        """Put a mover somewhere, at rest."""

    def adopt(self, old: Self, kept: Sequence[tuple[int, int]]) -> None:
        """Take over the motion of `old`, for pairs of movers (index here, index there); the poses are set already."""


def make_bodies(
    physics: str, robots: Sequence[Robot], poses: Floats, world: World, floorplans: Sequence[tuple[Floorplan, Fields]]
) -> Bodies:
    """The bodies of `physics` (`zteam.simulation_options.PHYSICS`), with all movers at `poses` (movers, 3)."""
    if physics == "dynamic":
        from zteam.sim.dynamic import DynamicBodies  # pymunk: imported only where it is used

        return DynamicBodies(robots, poses, floorplans, world.obstacles)
    groups = group_shapes(robots, world.obstacles)
    return KinematicBodies(len(robots), poses, floorplans, groups, tangents=physics == "stage")
