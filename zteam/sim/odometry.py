"""Odometry: the way since the start, with the errors that the world file sets."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.counter_random import gaussians, stream, streams
from zteam.geometry import Pose2
from zteam.kernels.binding import Bases
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


def _integrate(before: Floats, after: Floats, noise: OdometryNoise, draws: Floats, odom: Floats) -> None:
    """Carry `odom` (robots; x, y, yaw) on by the arcs from `before` to `after` (robots; x, y, yaw), with errors.

    Bias: each component counts 1 + e. Noise (Thrun, Burgard, Fox 2005, table 5.6, `draws` (robots, 3) standard normal):
    the way is a turn, a straight piece and a turn, each with its own variance; here both turns are half the arc's.
    """
    dx, dy, turn = (after - before).T
    half = 0.5 * turn
    # The chord, seen from half the turn.
    cos, sin = np.cos(before[:, 2] + half), np.sin(before[:, 2] + half)
    forward = (cos * dx + sin * dy) * (1.0 + noise.bias[:, 0])
    left = (cos * dy - sin * dx) * (1.0 + noise.bias[:, 1])
    half = half * (1.0 + noise.bias[:, 2])
    a1, a2, a3, a4 = noise.alphas.T
    way = forward * forward + left * left
    error = np.sqrt(a1 * half * half + a2 * way)
    first, second = half + error * draws[:, 0], half + error * draws[:, 1]
    # Along the way made; a turn on the spot has none, and errs ahead.
    length, stands = np.sqrt(way), way <= 1e-18
    share = np.sqrt(a3 * way + a4 * 2.0 * half * half) * draws[:, 2] / np.where(stands, 1.0, length)
    forward, left = forward + share * np.where(stands, 1.0, forward), left + share * np.where(stands, 0.0, left)
    cos, sin = np.cos(odom[:, 2] + first), np.sin(odom[:, 2] + first)
    odom += np.stack((cos * forward - sin * left, sin * forward + cos * left, first + second), axis=1)


class Odometry:
    """Odometry of all robots: `poses` (robots, 3) are x, y, yaw (not wrapped) in their `odom` frames.

    Without errors they are the true poses, seen from the place where odometry is zero.
    """

    def __init__(
        self, bases: Bases, robots: Sequence[Robot], ids: Sequence[int], alphas: tuple[float, ...] | None, seed: int
    ) -> None:
        # Stage's errors belong to its localization "odom"; its "gps" has none.
        bias = [robot.odom_error if robot.localization == "odom" else (0.0, 0.0, 0.0) for robot in robots]
        chosen = [alphas or robot.odom_alphas for robot in robots]
        self._wrong = [i for i, errors in enumerate(zip(bias, chosen, strict=True)) if any(sum(errors, ()))]
        """The robots that have errors, and what belongs to them in their order."""
        self._noise = OdometryNoise(
            np.array([bias[i] for i in self._wrong]).reshape(-1, 3),
            np.array([chosen[i] for i in self._wrong]).reshape(-1, 4),
        )
        self._states = np.array([stream(seed, ids[i], _STREAM) for i in self._wrong], np.uint64)
        self._counted = np.zeros((len(self._wrong), 3))
        self._start, self.poses = bases.start, bases.odom

    def advance(self, before: Floats, after: Floats, tick: int) -> None:
        """One tick, from the true poses `before` to `after`; `poses` are those without errors yet."""
        if self._wrong:
            draws = gaussians(streams(self._states, tick), 3)
            _integrate(before[self._wrong], after[self._wrong], self._noise, draws, self._counted)
            self.poses[self._wrong] = self._counted

    def adopt(self, old: "Odometry", kept: Sequence[tuple[int, int]]) -> None:
        """Go on from another's state, for pairs (index here, index there)."""
        for here, there in kept:
            self.poses[here], self._start[here] = old.poses[there], old._start[there]
        self._counted = self.poses[self._wrong]

    def carry(self, i: int, pose: Pose2) -> None:
        """Robot `i` is placed at `pose`: its wheels did not turn, so its `odom` frame moves along."""
        self._start[i] = pose.compose(Pose2(*self.poses[i].tolist()).inverse())

    def start(self, i: int) -> Pose2:
        """The pose in `map` of robot `i`'s `odom` frame, as if its odometry were exact."""
        return Pose2(*self._start[i].tolist())
