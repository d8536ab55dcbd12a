"""Rays against a world: bitmaps first, then polygons."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.binding import Bitmaps, Fans, cast_edges, cast_squares
from zteam.sim.fields import Fields, bitmap_of
from zteam.sim.polygons import Group, make_polygons
from zteam.world.model import Floorplan, Shape

Floats = NDArray[np.float64]


class Caster:
    """Casts rays at the surfaces that `sees` accepts. A hit is the index of a surface; no hit is `nothing`."""

    def __init__(
        self,
        floorplans: Sequence[tuple[Floorplan, Fields]],
        groups: Sequence[Group],
        sees: Callable[[Floorplan | Shape], bool],
    ) -> None:
        seen = [group._replace(shapes=[shape for shape in group.shapes if sees(shape)]) for group in groups]
        shapes = [(group, shape) for group in seen for shape in group.shapes]
        plans = [(plan, fields) for plan, fields in floorplans if sees(plan)]
        self._bitmaps = Bitmaps([bitmap_of(plan, fields) for plan, fields in plans])
        self._polygons = make_polygons(seen)
        self.nothing = len(shapes)
        surfaces: list[Floorplan | Shape | None] = [shape for _, shape in shapes]
        surfaces += [None, *(plan for plan, _ in plans)]
        self.surfaces = surfaces
        """What a hit is: a shape, None for no hit, a floor plan."""
        self.source_of = np.array([group.source for group, _ in shapes] + [-1] * (1 + len(plans)), np.int64)
        """(surfaces): the model that a hit belongs to (`Group.source`), or -1."""

    def move(self, poses: Floats) -> None:
        """Bring all movers to `poses` (movers; x, y, yaw in `map`)."""
        self._polygons.move(poses)

    def cast(self, fans: Fans) -> tuple[Floats, NDArray[np.int32]]:
        """The ranges in metres, and hits, (fans, beams); a ray that hits nothing is `limit` long."""
        fans.ranges.fill(fans.beams.limit)
        fans.hits.fill(self.nothing)
        for index in range(self._bitmaps.count):
            cast_squares(self._bitmaps, index, fans, self.nothing + 1 + index)
        cast_edges(self._polygons, fans)
        return fans.ranges, fans.hits
