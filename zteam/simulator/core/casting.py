"""A world as kernels take it, bitmaps and polygons in groups, and the rays that are cast at it.

A bitmap comes with the largest empty square at every cell, for each quadrant of directions. A ray that stands in a cell
may leap to the edge of the empty square that opens into the ray's quadrant; nothing can be hit before. The fields are
stored mirrored, so that every ray runs towards larger columns and rows.
"""

import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from zteam.geometry import Point2, Pose2, is_convex
from zteam.kernels import simulator as kernels
from zteam.kernels.binding import Floats
from zteam.simulator.world.model import Device, Floorplan, Obstacle, Robot, Shape

Plans = Sequence[tuple[Floorplan, kernels.Bitmap]]
"""Floor plans, each with its bitmap for kernels."""

NO_MOVER = -1
"""Owner of a group that stands still."""


def prepare_plans(floorplans: Sequence[Floorplan]) -> Plans:
    """The floor plans with their bitmaps; those of one bitmap share its fields."""
    bitmaps = {id(plan.occupied): plan.occupied for plan in floorplans}
    fields = {number: kernels.build_fields(occupied) for number, occupied in bitmaps.items()}
    return [(p, (fields[id(p.occupied)], *p.occupied.shape, *p.cell, *p.pose, p.z_min, p.z_max)) for p in floorplans]


def solid_bitmaps(plans: Plans) -> kernels.Bitmaps:
    return kernels.Bitmaps([bitmap for plan, bitmap in plans if plan.obstacle])


class Group(NamedTuple):
    """Shapes that move together."""

    owner: int
    """The mover that they belong to, or NO_MOVER."""
    source: int
    """The model: robots come first, then all obstacles."""
    shapes: Sequence[Shape]


def movers_of(robots: Sequence[Robot], obstacles: Sequence[Obstacle]) -> list[tuple[int, Robot | Obstacle]]:
    """All models, robots first, each with its mover: robots are movers 0, 1, …, what can be pushed comes after them."""
    numbers = itertools.count()
    models: list[Robot | Obstacle] = [*robots, *obstacles]
    return [(NO_MOVER if isinstance(m, Obstacle) and m.mass is None else next(numbers), m) for m in models]


def group_shapes(robots: Sequence[Robot], obstacles: Sequence[Obstacle]) -> list[Group]:
    """All shapes by mover; each shape that stands still is a group of its own."""
    groups = []
    for source, (mover, model) in enumerate(movers_of(robots, obstacles)):
        if mover == NO_MOVER:
            groups += [Group(NO_MOVER, source, [place_shape(model.pose, shape)]) for shape in model.shapes]
        else:
            groups.append(Group(mover, source, model.shapes))
    return groups


ConvexParts = Callable[[Sequence[Point2]], list[tuple[Point2, ...]]]
"""Cuts a simple polygon into convex ones."""


def solid_groups(groups: Sequence[Group], convex_parts: ConvexParts) -> list[Group]:
    """What collides, in convex parts; the groups of which something does."""
    solid = []
    for group in groups:
        parts: list[Shape] = []
        for shape in group.shapes:
            if shape.obstacle and is_convex(shape.points):
                parts.append(shape)
            elif shape.obstacle:
                parts += [replace(shape, points=points) for points in convex_parts(shape.points)]
        if parts:
            solid.append(group._replace(shapes=parts))
    return solid


def place_shape(pose: Pose2, shape: Shape) -> Shape:
    """A shape in `map` whose owner stands at `pose`."""
    return replace(shape, points=tuple(pose.compose(Pose2(x, y, 0.0))[:2] for x, y in shape.points))


def make_polygons(groups: Iterable[Group]) -> kernels.Polygons:
    """Arrays of the groups' shapes; groups without shapes are left out."""
    found = [(group.owner, [(s.points, s.z_min, s.z_max) for s in group.shapes]) for group in groups if group.shapes]
    return kernels.Polygons(found)


def mount_devices(owned: Sequence[tuple[int, Device]]) -> kernels.Rays:
    """Where the robots' devices are mounted in the base frames, by the robots' indexes."""
    x, y, z, yaw = np.array([(d.x, d.y, d.z, d.yaw) for _, d in owned], float).reshape(-1, 4).T
    return kernels.Rays(np.stack((x, y, yaw)), z.copy(), np.array([owner for owner, _ in owned], np.int64))


class Caster:
    """Casts rays at the surfaces that `sees` accepts. A hit is the index of a surface; no hit is `nothing`."""

    def __init__(self, plans: Plans, groups: Sequence[Group], sees: Callable[[Floorplan | Shape], bool]) -> None:
        seen = [group._replace(shapes=[shape for shape in group.shapes if sees(shape)]) for group in groups]
        shapes = [(group, shape) for group in seen for shape in group.shapes]
        plans = [(plan, bitmap) for plan, bitmap in plans if sees(plan)]
        self._bitmaps = kernels.Bitmaps([bitmap for _, bitmap in plans])
        self._polygons = make_polygons(seen)
        self.nothing = len(shapes)
        self.surfaces: list[Floorplan | Shape | None] = [*(shape for _, shape in shapes), None, *(p for p, _ in plans)]
        """What a hit is: a shape, None for no hit, a floor plan."""
        self.source_of = np.array([group.source for group, _ in shapes] + [-1] * (1 + len(plans)), np.int64)
        """(surfaces): the model that a hit belongs to (`Group.source`), or -1."""

    def move(self, poses: Floats) -> None:
        """Bring all movers to `poses` (movers; x, y, yaw in `map`)."""
        self._polygons.move(poses)

    def cast(self, fans: kernels.Fans) -> tuple[Floats, NDArray[np.int32]]:
        """The ranges in metres, and hits, (fans, beams); a ray that hits nothing is `limit` long."""
        fans.ranges.fill(fans.beams.limit)
        fans.hits.fill(self.nothing)
        kernels.cast_squares(self._bitmaps, fans, self.nothing + 1)
        kernels.cast_edges(self._polygons, fans)
        return fans.ranges, fans.hits


class SensedWorld:
    """What devices sense: the robots, all else, and casters of rays at both."""

    def __init__(self, robots: Sequence[Robot], obstacles: Sequence[Obstacle], plans: Plans) -> None:
        self.robots, self.models = robots, movers_of(robots, obstacles)
        self._plans, self._groups = plans, group_shapes(robots, obstacles)
        self.visible = self.caster(lambda surface: surface.ranger_return >= 0.0)
        """Moved once a tick, before all devices sense."""

    def caster(self, sees: Callable[[Floorplan | Shape], bool]) -> Caster:
        """A further caster, which the caller has to move."""
        return Caster(self._plans, self._groups, sees)
