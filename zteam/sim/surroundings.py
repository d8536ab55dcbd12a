"""What devices sense: robots, all other things, and casters of rays at them."""

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from zteam.sim.casting import Caster
from zteam.sim.fields import Fields
from zteam.sim.polygons import group_shapes
from zteam.world.model import Floorplan, Obstacle, Robot, Shape

Floats = NDArray[np.float64]


class Surroundings:
    """What devices sense: the robots, all else, and casters of rays."""

    def __init__(
        self,
        robots: Sequence[Robot],
        obstacles: Sequence[Obstacle],
        floorplans: Sequence[tuple[Floorplan, Fields]],
    ) -> None:
        self.robots = robots
        self.obstacles = obstacles
        self._floorplans = floorplans
        self._groups = group_shapes(robots, obstacles)
        self._casters: list[Caster] = []

    @cached_property
    def visible(self) -> Caster:
        """Casts against what lasers see."""
        return self._caster(lambda surface: surface.ranger_return >= 0.0)

    @cached_property
    def solid(self) -> Caster:
        """Casts against what collides."""
        return self._caster(lambda surface: surface.obstacle)

    def move(self, poses: Floats) -> None:
        """Bring the movers to `poses` (movers; x, y, yaw in `map`), for the casters that are in use."""
        for caster in self._casters:
            caster.move(poses)

    def _caster(self, sees: Callable[[Floorplan | Shape], bool]) -> Caster:
        self._casters.append(Caster(self._floorplans, self._groups, sees))
        return self._casters[-1]
