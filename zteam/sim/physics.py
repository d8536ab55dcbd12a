"""Bodies and contacts, on pymunk (Chipmunk). The only module that imports it.

In free space a robot follows the exact arc of its commanded velocity. Chipmunk moves bodies by the velocity that the
solver left at the end of the step before, so a robot that touches something is driven by a force (which the solver
may overrule), and one that touches nothing gets its velocity set outright.
"""

import math
from collections.abc import Sequence

import numpy as np
import pymunk
import pymunk.autogeometry
from numpy.typing import NDArray

from zteam.geometry import Pose2, compose2
from zteam.world.model import Floorplan, Obstacle, Robot

Floats = NDArray[np.float64]

SUBSTEP = 0.02
"""Longest physics step in seconds; a single step a tick costs as much and sinks deeper into walls."""
_SLOP = 0.001
"""Metres that bodies may overlap at rest."""
_BLOCKED = 0.5
"""A robot stalls when it touches something and makes less than this share of the speed it was told."""
_STILL = 1e-3
"""Speeds below this (m/s) are standing."""


class Physics:
    """All bodies. `poses` is (robots, 3): x, y, yaw in `map`."""

    def __init__(self, robots: Sequence[Robot], floorplans: Sequence[Floorplan], obstacles: Sequence[Obstacle]) -> None:
        self._space = pymunk.Space()
        self._space.collision_slop = _SLOP
        self._space.collision_bias = 1e-6
        self._floorplans = [plan for plan in floorplans if plan.obstacle]
        low = min((s.z_min for r in robots for s in r.shapes if s.obstacle), default=0.0)
        high = max((s.z_max for r in robots for s in r.shapes if s.obstacle), default=0.0)
        for plan in self._floorplans:
            if plan.z_min <= high and plan.z_max >= low:
                self._add_plan(plan)
        for obstacle in obstacles:
            self._add_obstacle(obstacle, low, high)
        self.poses = np.array([robot.pose for robot in robots], float).reshape(-1, 3)
        self._bodies = [self._add_robot(robot) for robot in robots]
        self.stalled = np.zeros(len(robots), bool)
        self._touching = np.zeros(len(robots), bool)

    def _add_plan(self, plan: Floorplan) -> None:
        for a, b in outline(plan.occupied):
            ends = [compose2(plan.pose, Pose2(x * plan.cell[0], y * plan.cell[1], 0.0))[:2] for x, y in (a, b)]
            self._add_static(pymunk.Segment(self._space.static_body, ends[0], ends[1], 0.0))

    def _add_obstacle(self, obstacle: Obstacle, low: float, high: float) -> None:
        for shape in obstacle.shapes:
            if shape.obstacle and shape.z_min <= high and shape.z_max >= low:
                points = [compose2(obstacle.pose, Pose2(x, y, 0.0))[:2] for x, y in shape.points]
                for part in convex_parts(points):
                    self._add_static(pymunk.Poly(self._space.static_body, part))

    def _add_static(self, shape: pymunk.Shape) -> None:
        shape.friction = 0.0
        self._space.add(shape)

    def _add_robot(self, robot: Robot) -> pymunk.Body:
        # No contact turns a robot: its wheels hold it, and only the drive decides its yaw rate.
        body = pymunk.Body(robot.mass, math.inf)
        body.position, body.angle = (robot.pose.x, robot.pose.y), robot.pose.yaw
        parts = [part for shape in robot.shapes if shape.obstacle for part in convex_parts(shape.points)]
        shapes = [pymunk.Poly(body, part) for part in parts]
        for shape in shapes:
            shape.friction = 0.0
        self._space.add(body, *shapes)
        return body

    def step(self, seconds: float, velocities: Floats) -> None:
        """Advance by `seconds` with body velocities `velocities` (robots, 3): vx, vy in m/s, yaw rate in rad/s."""
        before = self.poses.copy()
        count = max(1, math.ceil(seconds / SUBSTEP - 1e-9))
        dt = seconds / count
        for _ in range(count):
            self._substep(dt, velocities)
        self._refuse_tunnels(before)
        moved = np.hypot(*(self.poses - before)[:, :2].T) / seconds
        told = np.hypot(velocities[:, 0], velocities[:, 1])
        self.stalled = self._touching & (told > _STILL) & (moved < _BLOCKED * told)

    def _substep(self, dt: float, velocities: Floats) -> None:
        bodies, poses = self._bodies, self.poses
        # The chord of the arc that the robot drives in dt: sin(wdt/2)/(wdt/2) long, half the turn to the side.
        half = 0.5 * dt * velocities[:, 2]
        heading = poses[:, 2] + half
        chord = np.sinc(half / math.pi)
        cos, sin = np.cos(heading) * chord, np.sin(heading) * chord
        vx = cos * velocities[:, 0] - sin * velocities[:, 1]
        vy = sin * velocities[:, 0] + cos * velocities[:, 1]
        for i, body in enumerate(bodies):
            body.angular_velocity = velocities[i, 2]
            if self._touching[i]:
                v = body.velocity
                body.force = (body.mass * (vx[i] - v[0]) / dt, body.mass * (vy[i] - v[1]) / dt)
            else:
                body.velocity = (vx[i], vy[i])
        self._space.step(dt)
        for i, body in enumerate(bodies):
            x, y = body.position
            poses[i] = x, y, body.angle
            touching = False

            def note(_arbiter: pymunk.Arbiter) -> None:
                nonlocal touching
                touching = True

            body.each_arbiter(note)
            self._touching[i] = touching

    def _refuse_tunnels(self, before: Floats) -> None:
        """A centre that came to lie inside a wall goes back to where it was: walls are lines, and lines leak."""
        for i in np.flatnonzero(self._touching):
            x, y, yaw = self.poses[i]
            if not (math.isfinite(x) and math.isfinite(y)) or self._in_wall(x, y):
                self.place(int(i), Pose2(before[i, 0], before[i, 1], yaw if math.isfinite(yaw) else before[i, 2]))

    def _in_wall(self, x: float, y: float) -> bool:
        return any(is_occupied(plan, x, y) for plan in self._floorplans)

    def place(self, index: int, pose: Pose2) -> None:
        """Put a robot somewhere, at rest."""
        body = self._bodies[index]
        body.position, body.angle, body.velocity = (pose.x, pose.y), pose.yaw, (0.0, 0.0)
        self._space.reindex_shapes_for_body(body)
        self.poses[index] = pose


def convex_parts(points: Sequence[tuple[float, float]]) -> list[list[tuple[float, float]]]:
    """A simple polygon, counter-clockwise, as convex ones: Chipmunk takes the hull of any other."""
    count = len(points)
    turns = (
        (points[i][0] - points[i - 1][0]) * (points[(i + 1) % count][1] - points[i][1])
        - (points[i][1] - points[i - 1][1]) * (points[(i + 1) % count][0] - points[i][0])
        for i in range(count)
    )
    if all(turn >= 0.0 for turn in turns):
        return [list(points)]
    closed = [*points, points[0]]
    parts = pymunk.autogeometry.convex_decomposition(closed, 0.0)
    return [[(float(x), float(y)) for x, y in part] for part in parts]


def is_occupied(plan: Floorplan, x: float, y: float) -> bool:
    """Whether the point (metres in `map`) lies in an occupied cell."""
    cos, sin = math.cos(plan.pose.yaw), math.sin(plan.pose.yaw)
    dx, dy = x - plan.pose.x, y - plan.pose.y
    column = math.floor((cos * dx + sin * dy) / plan.cell[0])
    row = math.floor((cos * dy - sin * dx) / plan.cell[1])
    rows, columns = plan.occupied.shape
    return 0 <= row < rows and 0 <= column < columns and bool(plan.occupied[row, column])


def outline(occupied: NDArray[np.bool_]) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """The border of the occupied cells as maximal straight runs: ((x, y), (x, y)) in cells."""
    runs = [((x, a), (x, b)) for x, a, b in _runs(occupied.T)]
    return runs + [((a, y), (b, y)) for y, a, b in _runs(occupied)]


def _runs(occupied: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
    """Runs (line, begin, end) along axis 1 where occupied and free meet across axis 0."""
    rows, columns = occupied.shape
    padded = np.zeros((rows + 2, columns), bool)
    padded[1:-1] = occupied
    border = np.zeros((rows + 1, columns + 2), np.int8)
    border[:, 1:-1] = padded[1:] != padded[:-1]
    change = np.diff(border, axis=1)
    lines, begins = np.nonzero(change == 1)
    _, ends = np.nonzero(change == -1)
    return list(zip(lines.tolist(), begins.tolist(), ends.tolist(), strict=True))
