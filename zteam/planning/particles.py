"""Particles: how they move, and how the next ones are drawn."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2, normalize_angle
from zteam.kernels.binding import move_poses
from zteam.planning.grid import Frame

Floats = NDArray[np.float64]

BIN_SIZE = 0.5, 0.5, math.radians(10.0)
"""Of the histogram that says how spread out the particles are (amcl's pf_kdtree): metres, metres, radians."""


def move_differential(poses: Floats, before: Pose2, after: Pose2, alphas: tuple[float, ...], draws: Floats) -> None:
    """Move particles (n, 3) as odometry says that a differential base went, with its errors.

    amcl's DifferentialMotionModel (Thrun, Burgard, Fox 2005, table 5.6); `draws` (n, 3) are standard normal.
    """
    dx, dy = after.x - before.x, after.y - before.y
    way, turn = math.hypot(dx, dy), normalize_angle(after.yaw - before.yaw)
    # A turn on the spot has no direction of its own.
    first = normalize_angle(math.atan2(dy, dx) - before.yaw) if way >= 0.01 else 0.0
    second = normalize_angle(turn - first)
    # A robot that backs up turns by nearly half a turn before and after: that is no turn.
    small_first, small_second = (min(abs(a), abs(normalize_angle(a - math.pi))) for a in (first, second))
    a1, a2, a3, a4 = alphas[:4]
    squares = a1 * small_first**2 + a2 * way**2, a1 * small_second**2 + a2 * way**2
    ahead = math.sqrt(a3 * way**2 + a4 * (small_first**2 + small_second**2))
    move_poses(poses, (first, way, second, math.sqrt(squares[0]), ahead, math.sqrt(squares[1])), draws)


def move_omnidirectional(poses: Floats, before: Pose2, after: Pose2, alphas: tuple[float, ...], draws: Floats) -> None:
    """As `move_differential`, for a base that drives sideways too: amcl's OmniMotionModel."""
    dx, dy = after.x - before.x, after.y - before.y
    way, turn = math.hypot(dx, dy), normalize_angle(after.yaw - before.yaw)
    a1, a2, a3, a4, a5 = alphas
    along = math.sqrt(a3 * way**2 + a1 * turn**2)
    around = math.sqrt(a4 * turn**2 + a2 * way**2)
    aside = math.sqrt(a1 * turn**2 + a5 * way**2)
    bearing = (math.atan2(dy, dx) - before.yaw if way > 0.0 else 0.0) + poses[:, 2]
    cos, sin = np.cos(bearing), np.sin(bearing)
    forward, left = way + along * draws[:, 0], aside * draws[:, 1]
    poses[:, 0] += forward * cos + left * sin
    poses[:, 1] += forward * sin - left * cos
    poses[:, 2] += turn + around * draws[:, 2]


def kld_limits(least: int, most: int, error: float, quantile: float) -> NDArray[np.int64]:
    """Particles that are enough for a histogram with k bins, for k from 0 to `most` (Fox 2003; amcl's formula).

    With them the error of the distribution is below `error` in the share of cases of which `quantile` is the upper
    standard normal quantile.
    """
    k = np.maximum(np.arange(most + 1), 2) - 1.0
    b = 2.0 / (9.0 * k)
    cube = (1.0 - b + np.sqrt(b) * quantile) ** 3
    enough = np.clip(np.ceil(k / (2.0 * error) * cube), least, most).astype(np.int64)
    enough[:2] = most
    return enough


def spread_poses(frame: Frame, free: NDArray[np.int64], draws: Floats) -> Floats:
    """Poses (n, 3) in `map` all over the cells `free` (indexes), from uniform `draws` (n, 4). Raises ValueError."""
    if not len(free):
        raise ValueError("the map has no free cells: a robot can be nowhere on it")
    row, column = np.divmod(free[(draws[:, 0] * len(free)).astype(np.int64)], frame.columns)
    places = frame.points_from_cells(np.stack((column + draws[:, 1], row + draws[:, 2]), axis=1))
    return np.column_stack((places, 2.0 * math.pi * draws[:, 3] - math.pi))
