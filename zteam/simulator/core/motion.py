"""Bodies and the bases that move them: limits, wheels, what a contact leaves of a speed, odometry with its errors.

Here are the bodies that never touch, of the physics "stage" and "kinematic".
"""

import math
from collections.abc import Sequence
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from zteam.counter_random import gaussians, stream, streams
from zteam.geometry import Point2, Pose2
from zteam.kernels.simulator import Bases, Floats, follow, move_all
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


def _convex_parts(points: Sequence[Point2]) -> list[tuple[Point2, ...]]:
    from zteam.simulator.core.dynamic import convex_parts  # few worlds need pymunk

    return convex_parts(points)


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
        self._polygons = make_polygons(solid_groups(group_shapes(robots, obstacles), _convex_parts))
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


_STREAM = 100
"""Of odometry's errors, apart from the streams of the lasers' noise."""

JOINTS = {
    # Wheel rates are rows times (vx, vy, w), over the wheel's radius; lengths in halves of the separation. A mecanum
    # base is taken to be square.
    "diff": (("wheel_left_joint", (1.0, 0.0, -1.0)), ("wheel_right_joint", (1.0, 0.0, 1.0))),
    "car": (("rear_left_wheel_joint", (1.0, 0.0, -1.0)), ("rear_right_wheel_joint", (1.0, 0.0, 1.0))),
    "omni": (
        ("front_left_wheel_joint", (1.0, -1.0, -2.0)),
        ("front_right_wheel_joint", (1.0, 1.0, 2.0)),
        ("rear_left_wheel_joint", (1.0, 1.0, -2.0)),
        ("rear_right_wheel_joint", (1.0, -1.0, 2.0)),
    ),
}


def make_bases(robots: Sequence[Robot]) -> tuple[Bases, list[slice]]:
    """Bases of the robots, at rest, and which wheels are whose. Only omni drives go sideways; without limits
    acceleration has none."""
    limits = np.zeros((4, len(robots), 3))
    rows: list[tuple[float, float, float]] = []
    owner: list[int] = []
    for i, robot in enumerate(robots):
        limits[:2, i] = np.transpose((robot.velocity.x, robot.velocity.y, robot.velocity.yaw))
        if robot.drive != "omni":
            limits[:2, i, 1] = 0.0
        given = robot.acceleration
        limits[2:, i] = np.transpose((given.x, given.y, given.yaw) if given else ((-math.inf, math.inf),) * 3)
        radius, half = robot.wheel_radius, 0.5 * robot.wheel_separation
        rows += [(vx / radius, vy / radius, w * half / radius) for _, (vx, vy, w) in JOINTS[robot.drive]]
        owner += [i] * len(JOINTS[robot.drive])
    bases = Bases(
        limits,
        np.array([robot.drive == "car" for robot in robots], bool),
        np.array([robot.wheelbase for robot in robots], float),
        np.array([robot.pose for robot in robots], float).reshape(-1, 3),
        np.array(owner, np.int64),
        np.array(rows, float).reshape(-1, 3),
    )
    first = np.cumsum([0, *(len(JOINTS[robot.drive]) for robot in robots)]).tolist()
    return bases, list(map(slice, first, first[1:]))


def keep_what_is_left(is_car: NDArray[np.bool_], met: NDArray[np.bool_], velocity: Floats, setpoint: Floats) -> None:
    """Of the `setpoint` of robots that `met` something keep what they made of it, their `velocity`; both (robots, 3).

    So a robot that comes free gathers speed from there. A contact takes speed away and never adds any: what pushes a
    robot does not drive it. A car's turn shrinks with its speed.
    """
    told = setpoint[met]
    made = np.clip(velocity[met], np.minimum(told, 0.0), np.maximum(told, 0.0))
    cars = is_car[met] & (told[:, 0] != 0.0)
    made[cars, 2] = told[cars, 2] * made[cars, 0] / told[cars, 0]
    setpoint[met] = made


class WheelOdometry:
    """Odometry of all robots: `poses` (robots, 3) are x, y, yaw (not wrapped) in their `odom` frames. Without errors
    they are the true poses, seen from the place where odometry is zero."""

    def __init__(
        self, bases: Bases, robots: Sequence[Robot], ids: Sequence[int], alphas: tuple[float, ...] | None, seed: int
    ) -> None:
        # Stage's errors belong to its localization "odom"; its "gps" has none.
        bias = [robot.odom_error if robot.localization == "odom" else (0.0, 0.0, 0.0) for robot in robots]
        chosen = [alphas or robot.odom_alphas for robot in robots]
        self._wrong = [i for i, errors in enumerate(zip(bias, chosen, strict=True)) if any(sum(errors, ()))]
        """The robots that have errors, and what belongs to them in their order."""
        self._bias = np.array([bias[i] for i in self._wrong]).reshape(-1, 3)
        """Shares of x, y and yaw (Stage's odom_error)."""
        self._alphas = np.array([chosen[i] for i in self._wrong]).reshape(-1, 4)
        """Thrun's."""
        self._states = np.array([stream(seed, ids[i], _STREAM) for i in self._wrong], np.uint64)
        self._start, self.poses = bases.start, bases.odom
        self.counted = np.zeros_like(self.poses)
        """(robots, 3): what those with errors have counted so far."""

    def advance(self, before: Floats, after: Floats, tick: int) -> None:
        """One tick, by the arcs between the true poses `before` and `after`; `poses` are those without errors yet.

        Bias: each component counts 1 + e. Noise (Thrun, Burgard, Fox 2005, table 5.6): the way is a turn, a straight
        piece and a turn, each with its own variance; here both turns are half the arc's.
        """
        if not self._wrong:
            return
        draws = gaussians(streams(self._states, tick), 3)
        before, after = before[self._wrong], after[self._wrong]
        odom = self.counted[self._wrong]
        dx, dy, turn = (after - before).T
        half = 0.5 * turn
        # The chord, seen from half the turn.
        cos, sin = np.cos(before[:, 2] + half), np.sin(before[:, 2] + half)
        forward = (cos * dx + sin * dy) * (1.0 + self._bias[:, 0])
        left = (cos * dy - sin * dx) * (1.0 + self._bias[:, 1])
        half = half * (1.0 + self._bias[:, 2])
        a1, a2, a3, a4 = self._alphas.T
        way = forward * forward + left * left
        error = np.sqrt(a1 * half * half + a2 * way)
        first, second = half + error * draws[:, 0], half + error * draws[:, 1]
        # Along the way made; a turn on the spot has none, and errs ahead.
        length, stands = np.sqrt(way), way <= 1e-18
        share = np.sqrt(a3 * way + a4 * 2.0 * half * half) * draws[:, 2] / np.where(stands, 1.0, length)
        forward, left = forward + share * np.where(stands, 1.0, forward), left + share * np.where(stands, 0.0, left)
        cos, sin = np.cos(odom[:, 2] + first), np.sin(odom[:, 2] + first)
        odom += np.stack((cos * forward - sin * left, sin * forward + cos * left, first + second), axis=1)
        self.poses[self._wrong] = self.counted[self._wrong] = odom

    def carry(self, i: int, pose: Pose2) -> None:
        """Robot `i` is placed at `pose`: its wheels did not turn, so its `odom` frame moves along."""
        self._start[i] = pose.compose(Pose2(*self.poses[i].tolist()).inverse())
