"""Rays against a world: bitmaps first, then polygons."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.sim.edge_kernels import cast_edges, finish
from zteam.sim.fields import Fields
from zteam.sim.jit import compiled
from zteam.sim.polygons import Group, Polygons, make_polygons, move_polygons
from zteam.sim.square_kernels import cast_squares
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


class _Frame(NamedTuple):
    """Where a bitmap lies in `map`: its lower left corner, its heading, and the heights that it is seen at."""

    x: float
    y: float
    yaw: float
    cos: float
    sin: float
    z_min: float
    z_max: float


def _frame_of(plan: Floorplan) -> _Frame:
    x, y, yaw = map(float, plan.pose)
    return _Frame(x, y, yaw, math.cos(yaw), math.sin(yaw), float(plan.z_min), float(plan.z_max))


@compiled
def enter_frame(
    frame: _Frame, x: Floats, y: Floats, z: Floats, yaw: Floats, local: Floats, seen: NDArray[np.bool_]
) -> None:
    """Poses in `map` as seen from a bitmap's frame, into the rows x, y, yaw of `local`; and which of them see it."""
    for i in range(x.shape[0]):
        dx, dy = x[i] - frame.x, y[i] - frame.y
        local[0, i] = frame.cos * dx + frame.sin * dy
        local[1, i] = frame.cos * dy - frame.sin * dx
        local[2, i] = yaw[i] - frame.yaw
        seen[i] = frame.z_min <= z[i] <= frame.z_max


class Job(NamedTuple):
    """Rays against one bitmap and polygons. The arrays stay the same, their contents change from tick to tick."""

    sides: NDArray[np.uint8]
    rows: int
    columns: int
    cell_x: float
    cell_y: float
    frame: _Frame
    local: Floats
    """(3, scans): room for the rays in the bitmap's frame."""
    seen: NDArray[np.bool_]
    polygons: Polygons
    has_polygons: bool
    rays: Rays
    cos: Floats
    sin: Floats
    angle_min: float
    increment: float
    limit: float
    nothing: int
    ranges: Floats
    hit: NDArray[np.int32]


@compiled
def cast_part(job: Job, begin: int, end: int) -> None:
    """Do a part of a job: the scans from `begin` to `end`."""
    x, y, z, yaw = job.rays.x[begin:end], job.rays.y[begin:end], job.rays.z[begin:end], job.rays.yaw[begin:end]
    local, seen, ranges, hit = job.local[:, begin:end], job.seen[begin:end], job.ranges[begin:end], job.hit[begin:end]
    ranges[:] = job.limit
    hit[:] = job.nothing
    enter_frame(job.frame, x, y, z, yaw, local, seen)
    cast_squares(
        job.sides, job.rows, job.columns, job.cell_x, job.cell_y, job.local[0, begin:end], job.local[1, begin:end],
        job.local[2, begin:end], seen, job.cos, job.sin, job.limit, job.nothing + 1, ranges, hit,
    )  # fmt: skip
    if job.has_polygons:
        cast_edges(
            job.polygons, x, y, z, yaw, job.rays.owner[begin:end],
            job.cos, job.sin, job.angle_min, job.increment, 0.0, ranges, hit,
        )  # fmt: skip


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
        self._plans = [(plan, fields, _frame_of(plan)) for plan, fields in floorplans if sees(plan)]
        self._polygons = make_polygons(seen)
        self._has_polygons = len(self._polygons.owner) > 0
        self.nothing = len(shapes)
        surfaces: list[Floorplan | Shape | None] = [shape for _, shape in shapes]
        surfaces += [None, *(plan for plan, _, _ in self._plans)]
        self.surfaces = surfaces
        """What a hit is: a shape, None for no hit, a floor plan."""
        self.source_of = np.array([group.source for group, _ in shapes] + [-1] * (1 + len(self._plans)), np.int64)
        """(surfaces): the model that a hit belongs to (`Group.source`), or -1."""

    def move(self, poses: Floats) -> None:
        """Bring all movers to `poses` (movers; x, y, yaw in `map`)."""
        if self._has_polygons:
            move_polygons(self._polygons, poses)

    def make_job(self, rays: Rays, beams: Beams, buffers: ScanBuffers) -> "Job | None":
        """What `cast` does, for arrays that stay the same; None if the world has no bitmap, or several."""
        if len(self._plans) != 1:
            return None
        plan, fields, frame = self._plans[0]
        local, seen = np.empty((3, len(rays.x))), np.empty(len(rays.x), bool)
        return Job(
            fields.sides, fields.rows, fields.columns, *plan.cell, frame, local, seen, self._polygons,
            self._has_polygons, rays, beams.cos, beams.sin, beams.angle_min, beams.increment, beams.limit, self.nothing,
            *buffers,
        )  # fmt: skip

    def cast(self, rays: Rays, beams: Beams, buffers: ScanBuffers | None = None) -> ScanBuffers:
        """Ranges in metres and hits, (scans, beams), in `buffers` if given; a ray that hits nothing is `limit` long."""
        ranges, hit = buffers or make_buffers(len(rays.x), beams)
        ranges.fill(beams.limit)
        hit.fill(self.nothing)
        local, seen = np.empty((3, len(rays.x))), np.empty(len(rays.x), bool)
        for number, (plan, fields, frame) in enumerate(self._plans, self.nothing + 1):
            enter_frame(frame, rays.x, rays.y, rays.z, rays.yaw, local, seen)
            cast_squares(
                fields.sides, fields.rows, fields.columns, plan.cell[0], plan.cell[1], local[0], local[1], local[2],
                seen, beams.cos, beams.sin, beams.limit, number, ranges, hit,
            )  # fmt: skip
        if self._has_polygons:
            cast_edges(
                self._polygons, rays.x, rays.y, rays.z, rays.yaw, rays.owner,
                beams.cos, beams.sin, beams.angle_min, beams.increment, beams.jitter, ranges, hit,
            )  # fmt: skip
        return ScanBuffers(ranges, hit)
