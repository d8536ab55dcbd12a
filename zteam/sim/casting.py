"""Rays against a world: bitmaps first, then polygons."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.sim.fields import Fields
from zteam.sim.kernels import cast_edges, cast_squares, finish
from zteam.sim.polygons import Group, make_polygons, move_polygons
from zteam.world.model import Floorplan, Shape

Floats = NDArray[np.float64]

__all__ = ["Beams", "Caster", "Rays", "cast_squares", "finish"]


class Beams(NamedTuple):
    """Directions of a scan's beams in the sensor's frame."""

    cos: Floats
    """(tables, beams): one row for all scans, or one for each."""
    sin: Floats
    angle_min: float
    increment: float
    limit: float
    """Nothing at this distance (metres) or beyond is seen."""
    jitter: float = 0.0
    """Increments that a beam may be off its place."""


class Rays(NamedTuple):
    """Where scans start, in `map`: arrays (scans)."""

    x: Floats
    y: Floats
    z: Floats
    yaw: Floats
    owner: NDArray[np.int64]
    """The mover that carries the sensor and that the sensor does not see, or NO_MOVER."""


class ScanBuffers(NamedTuple):
    """Arrays for results. A caller that casts every tick keeps its own, because new memory costs time."""

    ranges: Floats
    """(scans, beams), metres."""
    hit: NDArray[np.int32]
    """(scans, beams): indexes of surfaces."""


def make_buffers(scans: int, beams: Beams) -> ScanBuffers:
    """Buffers for `scans` scans of these beams."""
    shape = (scans, beams.cos.shape[1])
    return ScanBuffers(np.empty(shape), np.empty(shape, np.int32))


class _Plan(NamedTuple):
    fields: Fields
    plan: Floorplan
    cos: float
    sin: float


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
        self._plans = [
            _Plan(fields, plan, math.cos(plan.pose.yaw), math.sin(plan.pose.yaw))
            for plan, fields in floorplans
            if sees(plan)
        ]
        self._polygons = make_polygons(seen)
        self.nothing = len(shapes)
        surfaces: list[Floorplan | Shape | None] = [shape for _, shape in shapes]
        surfaces += [None, *(plan.plan for plan in self._plans)]
        self.surfaces = surfaces
        """What a hit is: a shape, None for no hit, a floor plan."""
        self.source_of = np.array([group.source for group, _ in shapes] + [-1] * (1 + len(self._plans)), np.int64)
        """(surfaces): the model that a hit belongs to (`Group.source`), or -1."""

    def move(self, poses: Floats) -> None:
        """Bring all movers to `poses` (movers; x, y, yaw in `map`)."""
        if len(self._polygons.owner):
            move_polygons(self._polygons, poses)

    def cast(self, rays: Rays, beams: Beams, buffers: ScanBuffers | None = None) -> ScanBuffers:
        """Ranges in metres and hits, (scans, beams), in `buffers` if given; a ray that hits nothing is `limit` long."""
        ranges, hit = buffers or make_buffers(len(rays.x), beams)
        ranges[:], hit[:] = beams.limit, self.nothing
        for number, (fields, plan, cos, sin) in enumerate(self._plans):
            seen = (rays.z >= plan.z_min) & (rays.z <= plan.z_max)
            dx, dy = rays.x - plan.pose.x, rays.y - plan.pose.y
            cast_squares(
                fields.sides, fields.rows, fields.columns, plan.cell[0], plan.cell[1],
                cos * dx + sin * dy, cos * dy - sin * dx, rays.yaw - plan.pose.yaw, seen,
                beams.cos, beams.sin, beams.limit, self.nothing + 1 + number, ranges, hit,
            )  # fmt: skip
        if len(self._polygons.owner):
            cast_edges(
                self._polygons, rays.x, rays.y, rays.z, rays.yaw, rays.owner,
                beams.cos, beams.sin, beams.angle_min, beams.increment, beams.jitter, ranges, hit,
            )  # fmt: skip
        return ScanBuffers(ranges, hit)
