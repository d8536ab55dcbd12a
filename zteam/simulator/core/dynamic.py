"""Bodies and contacts, on pymunk (Chipmunk).

In free space a robot follows the exact arc of its velocity: its velocity is set. A robot that touches something is
driven by a force instead, which the solver may overrule.

A solver that iterates lets bodies sink into each other under pressure, and passes a thin wall in one step. So each
motion that it proposes is tested, exactly, at places along its way. The test takes a body's core: its polygon less a
rim. The solver alone handles contacts within the rim. A body goes as far as its core is free and stops there. A free
core stays free, so no body passes through another or through a wall.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import pymunk
import pymunk.autogeometry
from msgspec.structs import replace
from numpy.typing import NDArray
from pymunk import _chipmunk_cffi

from zteam.errors import UsageError
from zteam.geometry import Point2, Pose2
from zteam.kernels.simulator import CHIPMUNK, ChipmunkBodies, Floats, find_overlaps, hold
from zteam.simulator.core.casting import (
    NO_MOVER,
    Group,
    Plans,
    group_shapes,
    make_polygons,
    solid_bitmaps,
    solid_groups,
)
from zteam.simulator.world.model import Floorplan, Obstacle, Robot, Shape

Lines = NDArray[np.intp]
"""(lines, 4): from x, y to x, y in cells."""

MAX_WALLS = 400_000
"""Straight pieces of wall of all bitmaps: noise has more, and Chipmunk takes a kilobyte and 20 us for each."""

SUBSTEP = 0.02
"""Longest physics step in seconds; a single step a tick costs as much and sinks deeper into walls."""
_STRIDE = 0.1
"""Metres that no robot may go in one physics step; half the width of the smallest thing that can be pushed, if less."""
_MAX_SUBSTEPS = 1000
_SLOP = 0.001
"""Metres that bodies may overlap at rest."""
_RIM = 0.01
"""Metres that a body may sink into another at most, where there is something to push."""
_WIDE_RIM = 0.05
"""Likewise where nothing can be pushed: there the solver alone keeps robots out of walls but for rare leaps."""
_STILL = 1e-3
"""Speeds below this (m/s) are standing."""
_GRIP = 0.5 * 9.81
"""Deceleration in m/s² of something pushed that slides over the floor: a friction of 0.5."""
_LEVER = 0.94
"""Mean distance of a body's area from its middle, by its radius of gyration: of squares and discs; of a rod 0.87."""
_MAX_SLABS = 31
"""Layers of height that collisions tell apart: bits of Chipmunk's categories."""


def _address(pointer: Any) -> int:
    return int(_chipmunk_cffi.ffi.cast("uintptr_t", pointer))


def _find_functions() -> list[int]:
    """Addresses of Chipmunk's own functions: pymunk's properties cost far more than all that they do."""
    names = (f"cpBody{name.title().replace('_', '')}" for name in CHIPMUNK)
    return [_address(_chipmunk_cffi.ffi.addressof(_chipmunk_cffi.lib, name)) for name in names]


class _Builder:
    """Adds what collides to a space; bodies collide if they share a slab, a layer of height."""

    def __init__(self, space: pymunk.Space, shapes: Iterable[Shape]) -> None:
        self._space = space
        # Between the heights at which what collides begins or ends; the topmost are one if there are too many.
        heights = sorted({z for shape in shapes for z in (shape.z_min, shape.z_max)})
        self._slabs = list(itertools.pairwise([-math.inf, *heights[: _MAX_SLABS - 1], math.inf]))

    def add_walls(self, plan: Floorplan, lines: Lines) -> None:
        cos, sin = math.cos(plan.pose.yaw), math.sin(plan.pose.yaw)
        (u, v), (x, y) = plan.cell, plan.pose[:2]
        category, ground = self._filter(plan.z_min, plan.z_max), self._space.static_body
        i, j = lines[:, 0::2], lines[:, 1::2]
        ends = np.stack([x + cos * i * u - sin * j * v, y + sin * i * u + cos * j * v], axis=2)
        walls = [pymunk.Segment(ground, a, b, 0.0) for a, b in ends.tolist()]
        for wall in walls:
            wall.filter = category
        self._space.add(*walls)

    def add_shapes(self, body: pymunk.Body, shapes: Sequence[Shape]) -> None:
        for shape in shapes:
            poly = pymunk.Poly(body, shape.points)
            poly.filter, poly.friction = self._filter(shape.z_min, shape.z_max), 0.0
            self._space.add(poly)

    def add_body(self, mass: float, moment: float, shapes: Sequence[Shape], pose: Floats) -> pymunk.Body:
        body = pymunk.Body(mass, moment)
        x, y, yaw = pose.tolist()
        body.position, body.angle = (x, y), yaw
        self._space.add(body)
        self.add_shapes(body, shapes)
        return body

    def _filter(self, z_min: float, z_max: float) -> pymunk.ShapeFilter:
        """Collides with what shares a layer of height."""
        bits = sum(1 << i for i, (low, high) in enumerate(self._slabs) if z_min < high and z_max > low)
        return pymunk.ShapeFilter(categories=bits, mask=bits)


class Cores:
    """The cores of all movers, and what they must stay out of: what stands still and, with `apart`, each other."""

    def __init__(self, solid: Sequence[Group], plans: Plans, poses: Floats, rim: float, apart: bool) -> None:
        """`poses` is (movers, 3); `rim` metres are taken off every polygon, less where it is narrow."""
        widest = [max(_half_width(shape.points) for shape in group.shapes) for group in solid]
        self._polygons = make_polygons(
            group if group.owner == NO_MOVER else group._replace(shapes=[_core(shape, rim) for shape in group.shapes])
            for group in solid
        )
        self._core_half = np.array([max(0.5 * half, half - rim) for half in widest], float)
        self.half = np.full(len(poses), np.inf)
        """(movers): half the width of the widest part of a body; inf for one that collides with nothing."""
        for group, half in zip(solid, widest, strict=True):
            if group.owner != NO_MOVER:
                self.half[group.owner] = half
        self._bitmaps = solid_bitmaps(plans)
        self._apart = apart
        self.in_wall, self._tangled = np.zeros((2, len(poses)), bool)
        """(movers): whether its core stands in something that stands still, from where no way is free."""
        self.look(poses)

    def look(self, poses: Floats) -> None:
        """See which cores overlap what, after something has been put elsewhere."""
        self._polygons.move(poses)
        find_overlaps(self._polygons, self._bitmaps, False, self.in_wall)
        find_overlaps(self._polygons, self._bitmaps, self._apart, self._tangled)

    def hold(self, poses: Floats, ends: Floats, suspects: NDArray[np.bool_]) -> Floats:
        """Cut the ways of `suspects` from `poses` to `ends` (movers, 3) short; the shares (movers) that are left."""
        if self._apart and self._tangled.any():
            self.look(poses)
        self._polygons.move(poses)
        return hold(self._polygons, self._bitmaps, self._core_half, poses, ends, suspects, self._tangled, self._apart)


class DynamicBodies:
    """Robots and the things that they push. `poses` is (movers, 3): x, y, yaw in `map`, robots first."""

    def __init__(self, robots: Sequence[Robot], poses: Floats, plans: Plans, obstacles: Sequence[Obstacle]) -> None:
        self._space = pymunk.Space()
        self._space.collision_slop = _SLOP
        self._space.collision_bias = 1e-6
        pushed = [obstacle for obstacle in obstacles if obstacle.mass is not None]
        solid = solid_groups(group_shapes(robots, obstacles), convex_parts)
        builder = _Builder(self._space, itertools.chain(*(group.shapes for group in solid)))
        for plan, lines in _find_walls([plan for plan, _ in plans if plan.obstacle]):
            builder.add_walls(plan, lines)
        for group in solid:
            if group.owner == NO_MOVER:
                builder.add_shapes(self._space.static_body, group.shapes)
        shapes = {group.owner: group.shapes for group in solid}
        self.poses = poses.copy()
        # No contact turns a robot: its wheels hold it, and only the drive decides its yaw rate.
        masses = [(robot.mass, math.inf) for robot in robots]
        masses += [(thing.mass or 1.0, _moment(thing)) for thing in pushed]
        movers = enumerate(zip(masses, poses, strict=True))
        self._bodies = [builder.add_body(*mass, shapes.get(i, ()), pose) for i, (mass, pose) in movers]
        self._robots, self._pushed = self._bodies[: len(robots)], self._bodies[len(robots) :]
        self._inertia = [(body.mass, body.moment) for body in self._bodies]
        self._cores = Cores(solid, plans, self.poses, _RIM if pushed else _WIDE_RIM, apart=bool(pushed))
        self._least = float(self._cores.half[: len(robots)].min(initial=math.inf))
        self._stride = max(_RIM, float(self._cores.half[len(robots) :].min(initial=_STRIDE)))
        self._index = {body: i for i, body in enumerate(self._robots)}
        self._held, self._anchored = np.zeros((2, len(self._bodies)), bool)
        mass, there = np.array([robot.mass for robot in robots], float), [_address(body._body) for body in self._bodies]
        self._chipmunk = ChipmunkBodies(_find_functions(), there, mass, self._cores.in_wall, self._held)
        self.stalled, self.met, self._touching = self._chipmunk.stalled, self._chipmunk.met, self._chipmunk.touching
        self._anchor()
        self._space.on_collision(begin=self._on_begin)

    def _on_begin(self, arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: object) -> None:
        for body in arbiter.bodies:
            i = self._index.get(body)
            if i is not None:
                self._touching[i] = True

    def step(self, seconds: float, velocity: Floats) -> None:
        if not self._bodies:
            return
        before = self.poses
        length = self._chipmunk.plan(before, velocity, seconds)
        steps = min(max(1, math.ceil(seconds / SUBSTEP - 1e-9), math.ceil(length / self._stride)), _MAX_SUBSTEPS)
        share = min(1.0, self._stride * steps / length) if length else 1.0
        dt = seconds / steps
        self._held[:] = False
        for step in range(1, steps + 1):
            if self._pushed or step == 1:
                self._chipmunk.drive(share, seconds, dt, is_first=step == 1)
            for body in self._pushed:
                _slide(body, dt)
            self._space.step(dt)
            if self._pushed or step == steps:
                self._hold(length > self._least)
        self._chipmunk.judge(before, self.poses, share, _STILL * SUBSTEP)

    def _hold(self, leaps: bool) -> None:
        """Take over the bodies' new poses (in a new array), within the limits of the cores.

        Where nothing can be pushed, a robot that touches nothing is tested only if a robot `leaps`: it goes farther
        than half its width, and may have passed a wall without a contact.
        """
        start, self.poses = self.poses, self._chipmunk.poses()
        every = leaps or bool(self._pushed)
        if not every and not self._touching.any():
            return
        suspects = np.ones(len(self._bodies), bool) if every else self._touching
        shares = self._cores.hold(start, self.poses, suspects)
        cut = np.flatnonzero(shares < 1.0).tolist()
        self._held[cut] = True
        for i in cut:
            self._put(i, shares[i])

    def _put(self, index: int, share: float) -> None:
        """Put a body at its pose, with this share of its velocity."""
        body, (x, y, yaw) = self._bodies[index], self.poses[index].tolist()
        body.position, body.angle = (x, y), yaw
        body.velocity, body.angular_velocity = body.velocity * share, body.angular_velocity * share
        self._space.reindex_shapes_for_body(body)

    def _anchor(self) -> None:
        """Fix a body that stands in a wall: it stops others, and nothing moves it."""
        for i in np.flatnonzero(self._cores.in_wall != self._anchored).tolist():
            body = self._bodies[i]
            if self._anchored[i]:
                body.body_type = pymunk.Body.DYNAMIC
                body.mass, body.moment = self._inertia[i]
            else:
                body.body_type = pymunk.Body.KINEMATIC
        self._anchored[:] = self._cores.in_wall

    def place(self, index: int, pose: Pose2) -> None:
        self.poses[index] = pose
        self._put(index, 0.0)
        self._cores.look(self.poses)
        self._anchor()

    def adopt(self, old: "DynamicBodies", kept: Sequence[tuple[int, int]]) -> None:
        """Go on from another's motion, for pairs of movers (index here, index there); contacts are found anew."""
        for here, there in kept:
            body, other = self._bodies[here], old._bodies[there]
            body.velocity, body.angular_velocity = other.velocity, other.angular_velocity
            if here < len(self._robots):
                self.stalled[here], self._touching[here] = old.stalled[there], old._touching[there]


def _moment(obstacle: Obstacle) -> float:
    """Moment of inertia of something pushed: its mass spread evenly over its shapes' areas."""
    polygons = [shape.points for shape in obstacle.shapes if shape.obstacle]
    areas = [abs(pymunk.Poly(None, points).area) for points in polygons]
    shares = [(obstacle.mass or 1.0) * area / sum(areas) for area in areas]
    moments = [pymunk.moment_for_poly(mass, points) for mass, points in zip(shares, polygons, strict=True)]
    return float(sum(moments)) or 1.0


def _slide(body: pymunk.Body, dt: float) -> None:
    """Slow a body down by friction with the ground: dry friction, under all of it."""
    speed, turn = body.velocity.length, abs(body.angular_velocity)
    body.velocity = body.velocity * (max(0.0, 1.0 - _GRIP * dt / speed) if speed > 0.0 else 0.0)
    if turn > 0.0:
        grip = _LEVER * _GRIP / math.sqrt(body.moment / body.mass)
        body.angular_velocity *= max(0.0, 1.0 - grip * dt / turn)


def _half_width(points: Sequence[Point2]) -> float:
    """The distance of a convex polygon's edges from the mean of its corners, at least: half the side of a square."""
    x, y = np.mean(points, axis=0)
    return float(min(_distance(a, b, (x, y)) for a, b in _edges(points)))


def _edges(points: Sequence[Point2]) -> list[tuple[Point2, Point2]]:
    pairs = zip(points, (*points[1:], points[0]), strict=True)
    return [(a, b) for a, b in pairs if math.dist(a, b) > 0.0]


def _distance(a: Point2, b: Point2, c: Point2) -> float:
    """Of point c from the line through a and b, positive on its left."""
    return ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / math.dist(a, b)


def _core(shape: Shape, rim: float) -> Shape:
    """A convex shape less a rim, of at most half of its half width."""
    rim = min(rim, 0.5 * _half_width(shape.points))
    left: list[Point2] = list(shape.points)
    for a, b in _edges(shape.points):
        inner = [(point, _distance(a, b, point) - rim) for point in left]
        kept: list[Point2] = []
        for (p, d), (q, e) in zip(inner, [*inner[1:], inner[0]], strict=True):
            if d >= 0.0:
                kept.append(p)
            if (d >= 0.0) != (e >= 0.0):
                t = d / (d - e)
                kept.append((p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])))
        left = kept
    return replace(shape, points=tuple(left))


def _find_walls(plans: Sequence[Floorplan]) -> Iterator[tuple[Floorplan, Lines]]:
    """Each plan and its border; plans of one bitmap share it. Raises UsageError if there are more than MAX_WALLS."""
    bitmaps = {id(plan.occupied): plan.occupied for plan in plans}
    borders = {number: _find_border(occupied) for number, occupied in bitmaps.items()}
    left = MAX_WALLS
    for plan in plans:
        lines = borders[id(plan.occupied)]
        left -= len(lines)
        if left < 0:
            text = f"with the bitmap of {plan.name!r} this world has more than {MAX_WALLS} straight pieces of wall"
            raise UsageError(f"{text}: smooth it, or take the physics stage or kinematic")
        yield plan, lines


def _find_border(occupied: NDArray[np.bool_]) -> Lines:
    """The border of the occupied cells as maximal straight runs."""
    y, left, right = _runs(occupied)
    x, low, high = _runs(occupied.T)
    return np.concatenate([np.stack([x, low, x, high], axis=1), np.stack([left, y, right, y], axis=1)])


def _runs(occupied: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Runs (line, begin, end) along axis 1 where occupied and free meet across axis 0."""
    border = np.diff(occupied, axis=0, prepend=False, append=False)
    lines, ends = np.nonzero(np.diff(border, axis=1, prepend=False, append=False))
    return lines[::2], ends[::2], ends[1::2]


def convex_parts(points: Sequence[Point2]) -> list[tuple[Point2, ...]]:
    """A simple polygon, counter-clockwise, as convex ones: Chipmunk takes the hull of any other."""
    parts = pymunk.autogeometry.convex_decomposition([*points, points[0]], 0.0)
    # Chipmunk closes its polygons with their first corner.
    return [tuple((float(x), float(y)) for x, y in part[:-1]) for part in parts]
