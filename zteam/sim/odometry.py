"""Odometry: the way since the start, with the errors that the world file sets, and the wheels' joints."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.counter_random import gaussians, stream, streams
from zteam.geometry import Pose2
from zteam.world.model import Robot

Floats = NDArray[np.float64]

_STREAM = 100
"""Apart from the streams of the lasers' noise."""


class OdometryNoise(NamedTuple):
    """The errors of all robots; a row of zeros is exact."""

    bias: Floats
    """(robots, 3): shares of x, y and yaw (Stage's odom_error)."""
    alphas: Floats
    """(robots, 4): Thrun's."""


def _integrate(velocity: Floats, seconds: float, noise: OdometryNoise, draws: Floats, odom: Floats) -> Floats:
    """The `odom` (robots; x, y, yaw) after what `velocity` (body frame) did in `seconds`.

    Bias: each component counts 1 + e. Noise (Thrun, Burgard, Fox 2005, table 5.6, `draws` (robots, 3) standard normal):
    the way is a turn, a straight piece and a turn, each with its own variance; here both turns are half the arc's.
    """
    half = 0.5 * seconds * velocity[:, 2]
    # np.sinc takes its angle in half turns: the chord of an arc is sin(half) / half long.
    chord = seconds * np.sinc(half / math.pi)
    forward, left = (velocity[:, axis] * chord * (1.0 + noise.bias[:, axis]) for axis in (0, 1))
    half = half * (1.0 + noise.bias[:, 2])
    a1, a2, a3, a4 = noise.alphas.T
    way = forward * forward + left * left
    wrong = np.sqrt(a1 * half * half + a2 * way)
    first, second = half + wrong * draws[:, 0], half + wrong * draws[:, 1]
    # Along the way made; a turn on the spot has none, and errs ahead.
    length = np.sqrt(way)
    stands = length <= 1e-9
    share = np.sqrt(a3 * way + a4 * 2.0 * half * half) * draws[:, 2] / np.where(stands, 1.0, length)
    forward, left = forward + share * np.where(stands, 1.0, forward), left + share * np.where(stands, 0.0, left)
    heading = odom[:, 2] + first
    cos, sin = np.cos(heading), np.sin(heading)
    moved: Floats = odom + np.column_stack((cos * forward - sin * left, sin * forward + cos * left, first + second))
    return moved


def _see_from_start(poses: Floats, start: Floats) -> Floats:
    """Where robots at `poses` are as seen from `start` (robots; x, y, yaw in `map`)."""
    cos, sin = np.cos(start[:, 2]), np.sin(start[:, 2])
    dx, dy, turn = (poses - start).T
    return np.column_stack((cos * dx + sin * dy, cos * dy - sin * dx, turn))


class Odometry:
    """Odometry of all robots: `poses` (robots, 3) are x, y, yaw (not wrapped) in their `odom` frames.

    Without errors they are the true poses, seen from the place where odometry is zero.
    """

    def __init__(
        self, robots: Sequence[Robot], ids: Sequence[int], alphas: tuple[float, ...] | None, seed: int
    ) -> None:
        # Stage's errors belong to its localization "odom"; its "gps" has none.
        bias = [robot.odom_error if robot.localization == "odom" else (0.0, 0.0, 0.0) for robot in robots]
        chosen = [alphas or robot.odom_alphas for robot in robots]
        self._noise = OdometryNoise(np.array(bias, float).reshape(-1, 3), np.array(chosen, float).reshape(-1, 4))
        self._wrong = np.hstack(self._noise).any(axis=1)
        self._states = np.array([stream(seed, robot_id, _STREAM) for robot_id in ids], np.uint64)
        self._start = np.array([robot.pose for robot in robots], float).reshape(-1, 3)
        self.poses = np.zeros((len(robots), 3))

    def advance(self, after: Floats, velocity: Floats, seconds: float, tick: int) -> None:
        """One tick; `after` are the true poses at its end, `velocity` what the bases did in it."""
        exact = _see_from_start(after, self._start)
        if self._wrong.any():
            draws = gaussians(streams(self._states, tick), 3)
            counted = _integrate(velocity, seconds, self._noise, draws, self.poses)
            exact[self._wrong] = counted[self._wrong]
        self.poses = exact

    def adopt(self, old: "Odometry", kept: Sequence[tuple[int, int]]) -> None:
        """Go on from another's state, for pairs (index here, index there)."""
        for here, there in kept:
            self.poses[here], self._start[here] = old.poses[there], old._start[there]

    def carry(self, i: int, pose: Pose2) -> None:
        """Robot `i` is placed at `pose`: its wheels did not turn, so its `odom` frame moves along."""
        self._start[i] = pose.compose(Pose2(*self.poses[i].tolist()).inverse())

    def start(self, i: int) -> Pose2:
        """The pose in `map` of robot `i`'s `odom` frame, as if its odometry were exact."""
        return Pose2(*self._start[i].tolist())


_JOINTS = {
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


class Wheels(NamedTuple):
    """All wheels of all robots, in the order of the robots."""

    names: list[tuple[str, ...]]
    """By robot."""
    first: list[int]
    """(robots + 1)"""
    owner: NDArray[np.int64]
    rows: Floats
    """(wheels, 3): radians a second for each unit of vx, vy, w."""
    angles: Floats
    """(wheels): since the start."""
    rates: Floats


def make_wheels(robots: Sequence[Robot]) -> Wheels:
    """Wheels at rest."""
    names, rows, owner, first = [], [], [], [0]
    for i, robot in enumerate(robots):
        joints = _JOINTS[robot.drive]
        names.append(tuple(name for name, _ in joints))
        half = 0.5 * robot.wheel_separation
        rows += [[vx / robot.wheel_radius, vy / robot.wheel_radius, w * half / robot.wheel_radius]
                 for _, (vx, vy, w) in joints]  # fmt: skip
        owner += [i] * len(joints)
        first.append(len(rows))
    count = len(rows)
    return Wheels(
        names, first, np.array(owner, np.int64), np.array(rows, float).reshape(-1, 3), np.zeros(count), np.zeros(count)
    )


def roll(wheels: Wheels, velocity: Floats, seconds: float) -> None:
    """Turn the wheels by the bases' velocities (robots, 3)."""
    np.add.reduce(wheels.rows * velocity.take(wheels.owner, axis=0), axis=1, out=wheels.rates)
    wheels.angles[:] += wheels.rates * seconds
