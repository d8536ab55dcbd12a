"""Odometry: the way since the start, with the errors that the world file sets, and the wheels' joints."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.counter_random import gaussians, stream, streams
from zteam.geometry import Pose2
from zteam.sim.jit import compiled
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


@compiled
def integrate(
    velocity: Floats, seconds: float, wrong: NDArray[np.bool_], noise: OdometryNoise, draws: Floats, odom: Floats
) -> None:
    """Carry the `odom` (robots; x, y, yaw) that is `wrong` on by what `velocity` (body frame) did in `seconds`.

    Bias: each component counts 1 + e. Noise, if any alpha is set (Thrun, Burgard, Fox 2005, table 5.6, `draws`
    (robots, 3) standard normal): the way is a turn, a straight piece and a turn, each with its own variance; here both
    turns are half the arc's.
    """
    for i in range(odom.shape[0]):
        if not wrong[i]:
            continue
        turn = velocity[i, 2] * seconds
        half = 0.5 * turn
        chord = seconds * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
        forward = velocity[i, 0] * chord * (1.0 + noise.bias[i, 0])
        left = velocity[i, 1] * chord * (1.0 + noise.bias[i, 1])
        half *= 1.0 + noise.bias[i, 2]
        first = second = half
        a1, a2, a3, a4 = noise.alphas[i, 0], noise.alphas[i, 1], noise.alphas[i, 2], noise.alphas[i, 3]
        if a1 + a2 + a3 + a4 > 0.0:
            length = math.hypot(forward, left)
            way = length * length
            first += math.sqrt(a1 * half * half + a2 * way) * draws[i, 0]
            second += math.sqrt(a1 * half * half + a2 * way) * draws[i, 1]
            # Along the way made; a turn on the spot has none, and errs ahead.
            ahead, aside = (forward / length, left / length) if length > 1e-9 else (1.0, 0.0)
            wrong_by = math.sqrt(a3 * way + a4 * 2.0 * half * half) * draws[i, 2]
            forward, left = forward + ahead * wrong_by, left + aside * wrong_by
        heading = odom[i, 2] + first
        cos, sin = math.cos(heading), math.sin(heading)
        odom[i, 0] += cos * forward - sin * left
        odom[i, 1] += sin * forward + cos * left
        odom[i, 2] += first + second


@compiled
def see_from_start(poses: Floats, start: Floats, wrong: NDArray[np.bool_], odom: Floats) -> None:
    """Where robots at `poses` are as seen from `start` (both in `map`), into `odom` but for those that are `wrong`."""
    for i in range(odom.shape[0]):
        if wrong[i]:
            continue
        cos, sin = math.cos(start[i, 2]), math.sin(start[i, 2])
        dx, dy = poses[i, 0] - start[i, 0], poses[i, 1] - start[i, 1]
        odom[i, 0], odom[i, 1], odom[i, 2] = cos * dx + sin * dy, cos * dy - sin * dx, poses[i, 2] - start[i, 2]


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
        self._wrong = np.array([any(row) for row in np.hstack(self._noise).tolist()], bool)
        self._is_wrong = bool(self._wrong.any())
        self._noisy = bool(self._noise.alphas.any())
        self._states = np.array([stream(seed, robot_id, _STREAM) for robot_id in ids], np.uint64)
        self._start = np.array([robot.pose for robot in robots], float).reshape(-1, 3)
        self.poses = np.zeros((len(robots), 3))

    def advance(self, after: Floats, velocity: Floats, seconds: float, tick: int) -> None:
        """One tick; `after` are the true poses at its end, `velocity` what the bases did in it."""
        see_from_start(after, self._start, self._wrong, self.poses)
        if self._is_wrong:
            draws = gaussians(streams(self._states, tick), 3) if self._noisy else np.zeros((len(after), 3))
            integrate(velocity, seconds, self._wrong, self._noise, draws, self.poses)

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


@compiled
def roll(
    owner: NDArray[np.int64], rows: Floats, velocity: Floats, seconds: float, angles: Floats, rates: Floats
) -> None:
    """Turn the wheels by the bases' velocities (robots, 3)."""
    for i in range(owner.shape[0]):
        robot = owner[i]
        rate = rows[i, 0] * velocity[robot, 0] + rows[i, 1] * velocity[robot, 1] + rows[i, 2] * velocity[robot, 2]
        rates[i] = rate
        angles[i] += rate * seconds
