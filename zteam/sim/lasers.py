"""All lasers of all robots at once: bitmaps first, then everything that has edges."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2, compose2
from zteam.sim.compiling import JIT
from zteam.sim.fields import Fields, build_fields
from zteam.world.model import Floorplan, Obstacle, Ranger, Robot, Shape

if JIT is not None:
    from zteam.sim.kernels import cast_edges, cast_squares
else:
    from zteam.sim.numpy_kernels import cast_edges, cast_squares

Floats = NDArray[np.float64]

NOBODY = -1
"""Owner of what stands still."""


class Mount(NamedTuple):
    """A ranger and the robot that carries it."""

    robot: int
    """Index of the robot in the engine's order."""
    place: int
    """Index of the ranger in the robot's list."""
    ranger: Ranger


class _Batch(NamedTuple):
    """Rangers of one kind: they share beams and range, so one kernel call serves them."""

    mounts: list[Mount]
    x: Floats
    y: Floats
    z: Floats
    yaw: Floats
    owner: NDArray[np.int64]
    cos: Floats
    sin: Floats
    angle_min: float
    increment: float
    range_max: float
    ranges: Floats
    hit: NDArray[np.int64]


class _Plan(NamedTuple):
    fields: Fields
    plan: Floorplan
    cos: float
    sin: float


class _Edges:
    """Polygons as arrays of edges in `map`, and how to move the ones that robots carry."""

    def __init__(self, carried: Sequence[tuple[int, Shape]], standing: Sequence[tuple[Pose2, Shape]]) -> None:
        shapes = [(owner, shape) for owner, shape in carried if shape.ranger_return >= 0.0]
        fixed = [(pose, shape) for pose, shape in standing if shape.ranger_return >= 0.0]
        every = [shape for _, shape in shapes] + [_placed(pose, shape) for pose, shape in fixed]
        counts = [len(shape.points) for shape in every]
        self.first_edge = np.concatenate(([0], np.cumsum(counts, dtype=np.int64))).astype(np.int64)
        starts = [point for shape in every for point in shape.points]
        ends = [point for shape in every for point in (*shape.points[1:], shape.points[0])]
        self.local_a = np.array(starts, float).reshape(-1, 2)
        self.local_b = np.array(ends, float).reshape(-1, 2)
        centres = [np.mean(np.array(shape.points), axis=0) for shape in every]
        self.local_centre = np.array(centres, float).reshape(-1, 2)
        self.radius = np.array(
            [max(math.dist(p, c) for p in s.points) for s, c in zip(every, centres, strict=True)], float
        )
        self.z_min = np.array([shape.z_min for shape in every], float)
        self.z_max = np.array([shape.z_max for shape in every], float)
        self.owner = np.array([owner for owner, _ in shapes] + [NOBODY] * len(fixed), np.int64)
        self.intensity = np.array([shape.ranger_return for shape in every], float)
        self.edge_owner = np.repeat(self.owner, counts)
        self.a, self.b, self.centre = self.local_a.copy(), self.local_b.copy(), self.local_centre.copy()

    def move(self, poses: Floats) -> None:
        """Bring the carried shapes to where their robots (rows x, y, yaw) are."""
        for local, world, owner in (
            (self.local_a, self.a, self.edge_owner),
            (self.local_b, self.b, self.edge_owner),
            (self.local_centre, self.centre, self.owner),
        ):
            moving = owner >= 0
            pose = poses[owner[moving]]
            cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
            x, y = local[moving, 0], local[moving, 1]
            world[moving, 0] = pose[:, 0] + cos * x - sin * y
            world[moving, 1] = pose[:, 1] + sin * x + cos * y


def _placed(pose: Pose2, shape: Shape) -> Shape:
    points = tuple(compose2(pose, Pose2(x, y, 0.0))[:2] for x, y in shape.points)
    return Shape(points, shape.z_min, shape.z_max, shape.ranger_return, shape.obstacle)


class Reading(NamedTuple):
    """What one ranger measured: metres and intensities (0 = no hit), both float32."""

    ranges: NDArray[np.float32]
    intensities: NDArray[np.float32]


class Lasers:
    """Every ranger of the world."""

    def __init__(self, robots: Sequence[Robot], floorplans: Sequence[Floorplan], obstacles: Sequence[Obstacle]) -> None:
        self._plans = [
            _Plan(build_fields(plan.occupied), plan, math.cos(plan.pose.yaw), math.sin(plan.pose.yaw))
            for plan in floorplans
            if plan.ranger_return >= 0.0
        ]
        self._edges = _Edges(
            [(i, shape) for i, robot in enumerate(robots) for shape in robot.shapes],
            [(obstacle.pose, shape) for obstacle in obstacles for shape in obstacle.shapes],
        )
        self._batches = _make_batches(robots)
        # hit = -1 - k is plan k, hit = k is shape k, and the last entry is nothing.
        self._intensity = np.concatenate(
            (self._edges.intensity, [0.0], [p.plan.ranger_return for p in reversed(self._plans)])
        )
        self._nothing = len(self._edges.intensity)

    def measure(self, poses: Floats) -> dict[tuple[int, int], Reading]:
        """Readings by (robot index, ranger index) with the robots at `poses` (rows x, y, yaw in `map`)."""
        self._edges.move(poses)
        readings = {}
        for batch in self._batches:
            self._cast(batch, poses)
            ranges = batch.ranges.astype(np.float32)
            intensities = self._intensity[batch.hit].astype(np.float32)
            for row, mount in enumerate(batch.mounts):
                readings[mount.robot, mount.place] = Reading(ranges[row], intensities[row])
        return readings

    def _cast(self, batch: _Batch, poses: Floats) -> None:
        pose = poses[batch.owner]
        cos, sin = np.cos(pose[:, 2]), np.sin(pose[:, 2])
        x = pose[:, 0] + cos * batch.x - sin * batch.y
        y = pose[:, 1] + sin * batch.x + cos * batch.y
        yaw = pose[:, 2] + batch.yaw
        batch.ranges[:] = batch.range_max
        batch.hit[:] = self._nothing
        for number, plan in enumerate(self._plans):
            self._cast_plan(batch, plan, number, x, y, yaw)
        edges = self._edges
        if len(edges.owner):
            cast_edges(
                edges.a[:, 0], edges.a[:, 1], edges.b[:, 0], edges.b[:, 1], edges.first_edge,
                edges.centre[:, 0], edges.centre[:, 1], edges.radius, edges.z_min, edges.z_max, edges.owner,
                x, y, batch.z, yaw, batch.owner, batch.cos, batch.sin, batch.angle_min, batch.increment,
                batch.ranges, batch.hit,
            )  # fmt: skip

    def _cast_plan(self, batch: _Batch, plan: _Plan, number: int, x: Floats, y: Floats, yaw: Floats) -> None:
        floor = plan.plan
        seen = (batch.z >= floor.z_min) & (batch.z <= floor.z_max)
        if not seen.any():
            return
        dx, dy = x - floor.pose.x, y - floor.pose.y
        ranges = np.empty_like(batch.ranges)
        cast_squares(
            plan.fields.sides, plan.fields.rows, plan.fields.columns, floor.cell[0], floor.cell[1],
            plan.cos * dx + plan.sin * dy, plan.cos * dy - plan.sin * dx, yaw - floor.pose.yaw, seen,
            batch.cos, batch.sin, batch.range_max, ranges,
        )  # fmt: skip
        nearer = ranges < batch.ranges
        batch.ranges[nearer] = ranges[nearer]
        batch.hit[nearer] = -1 - number


def _make_batches(robots: Sequence[Robot]) -> list[_Batch]:
    kinds: dict[tuple[int, float, float], list[Mount]] = {}
    for i, robot in enumerate(robots):
        for place, ranger in enumerate(robot.rangers):
            kinds.setdefault((ranger.samples, ranger.fov, ranger.range_max), []).append(Mount(i, place, ranger))
    return [_make_batch(mounts) for _, mounts in sorted(kinds.items())]


def _make_batch(mounts: list[Mount]) -> _Batch:
    ranger = mounts[0].ranger
    # A single ray looks straight ahead; several fill the field of view, its ends included.
    angle_min = -ranger.fov / 2 if ranger.samples > 1 else 0.0
    angles = angle_min + ranger.angle_increment * np.arange(ranger.samples)
    shape = (len(mounts), ranger.samples)
    return _Batch(
        mounts,
        np.array([m.ranger.x for m in mounts]),
        np.array([m.ranger.y for m in mounts]),
        np.array([m.ranger.z for m in mounts]),
        np.array([m.ranger.yaw for m in mounts]),
        np.array([m.robot for m in mounts], np.int64),
        np.cos(angles),
        np.sin(angles),
        angle_min,
        ranger.angle_increment,
        ranger.range_max,
        np.empty(shape),
        np.empty(shape, np.int64),
    )
