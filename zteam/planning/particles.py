"""Particles: how they move, how the next ones are drawn, and where most of them are."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2, normalize_angle
from zteam.planning.grid import Frame
from zteam.planning.jit import compiled

Floats = NDArray[np.float64]
Bins = NDArray[np.int64]

BIN_SIZE = 0.5, 0.5, math.radians(10.0)
"""Of the histogram that says how spread out the particles are (amcl's pf_kdtree): metres, metres, radians."""
_EMPTY = -1


def move_differential(poses: Floats, before: Pose2, after: Pose2, alphas: tuple[float, ...], draws: Floats) -> None:
    """Move particles (n, 3) as odometry says that a differential base went, with its errors.

    amcl's DifferentialMotionModel (Thrun, Burgard, Fox 2005, table 5.6); `draws` (n, 3 or more) are standard normal.
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
    begun = poses[:, 2] + (first - math.sqrt(squares[0]) * draws[:, 0])
    length = way - ahead * draws[:, 1]
    poses[:, 0] += length * np.cos(begun)
    poses[:, 1] += length * np.sin(begun)
    poses[:, 2] = begun + (second - math.sqrt(squares[1]) * draws[:, 2])


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


@compiled
def _find(table: Bins, x: int, y: int, turn: int) -> int:
    """The place of a bin in the table: its own, or the empty one where it belongs."""
    mask = table.shape[0] - 1
    place = (x * 73856093 ^ y * 19349663 ^ turn * 83492791) & mask
    while table[place, 3] != _EMPTY and (table[place, 0] != x or table[place, 1] != y or table[place, 2] != turn):
        place = (place + 1) & mask
    return int(place)


@compiled
def _bin_of(value: float, size: float) -> int:
    return math.floor(value / size)


@compiled
def resample(
    poses: Floats, sums: Floats, draws: Floats, strangers: Floats, share: float, enough: NDArray[np.int64],
    size: tuple[float, float, float], out: Floats,
) -> int:  # fmt: skip
    """Draw particles from `poses` (n, 3) into `out` until there are `enough` for the bins that they fill; how many.

    `sums` are the running sums of the weights, up to 1. `draws` (m, 2) are uniform: the first says which particle, the
    second, if below `share`, that a row of `strangers` (m, 3) comes instead.
    """
    room = 4
    while room < 2 * out.shape[0]:
        room *= 2
    table = np.full((room, 4), _EMPTY)
    bins = 0
    last = poses.shape[0] - 1
    for i in range(out.shape[0]):
        if draws[i, 1] < share:
            out[i] = strangers[i]
        else:
            low, high = 0, last
            while low < high:
                middle = (low + high) // 2
                if sums[middle] > draws[i, 0]:
                    high = middle
                else:
                    low = middle + 1
            out[i] = poses[low]
        turn = out[i, 2] - 2.0 * math.pi * math.floor(out[i, 2] / (2.0 * math.pi))
        x, y, a = _bin_of(out[i, 0], size[0]), _bin_of(out[i, 1], size[1]), _bin_of(turn, size[2])
        place = _find(table, x, y, a)
        if table[place, 3] == _EMPTY:
            table[place, 0], table[place, 1], table[place, 2], table[place, 3] = x, y, a, bins
            bins += 1
        if i + 1 >= enough[min(bins, enough.shape[0] - 1)]:
            return i + 1
    return int(out.shape[0])


@compiled
def label_clusters(poses: Floats, size: tuple[float, float, float], turns: int, labels: Bins) -> int:
    """Give particles (n, 3) whose bins touch, if only at a corner, the same label; return how many labels there are.

    `turns`: bins of a full turn, where the last one touches the first.
    """
    count = poses.shape[0]
    room = 4
    while room < 2 * count:
        room *= 2
    table = np.full((room, 4), _EMPTY)
    cluster = np.full(room, _EMPTY)
    place_of = np.empty(count, np.int64)
    stack = np.empty(count, np.int64)
    for i in range(count):
        turn = poses[i, 2] - 2.0 * math.pi * math.floor(poses[i, 2] / (2.0 * math.pi))
        x, y, a = _bin_of(poses[i, 0], size[0]), _bin_of(poses[i, 1], size[1]), _bin_of(turn, size[2])
        place = _find(table, x, y, a)
        table[place, 0], table[place, 1], table[place, 2], table[place, 3] = x, y, a, 0
        place_of[i] = place
    clusters = 0
    for i in range(count):
        if cluster[place_of[i]] == _EMPTY:
            cluster[place_of[i]] = clusters
            stack[0], height = place_of[i], 1
            while height > 0:
                height -= 1
                place = stack[height]
                for dx in range(-1, 2):
                    for dy in range(-1, 2):
                        for da in range(-1, 2):
                            a = (table[place, 2] + da + turns) % turns
                            other = _find(table, table[place, 0] + dx, table[place, 1] + dy, a)
                            if table[other, 3] != _EMPTY and cluster[other] == _EMPTY:
                                cluster[other] = clusters
                                stack[height] = other
                                height += 1
            clusters += 1
        labels[i] = cluster[place_of[i]]
    return clusters


_BINS_OF_TURN = 36


def estimate_pose(poses: Floats, weights: Floats) -> tuple[Pose2, Floats]:
    """The mean and covariance (3, 3) of the heaviest cluster of particles (n, 3)."""
    labels = np.empty(len(poses), np.int64)
    clusters = label_clusters(poses, BIN_SIZE, _BINS_OF_TURN, labels)
    if clusters > 1:
        chosen = labels == np.bincount(labels, weights, clusters).argmax()
        poses, weights = poses[chosen], weights[chosen]
    weights = weights / weights.sum()
    x, y = float(weights @ poses[:, 0]), float(weights @ poses[:, 1])
    # Headings of a cluster lie about one of them: that is cheaper than the mean of sines and cosines.
    first = float(poses[weights.argmax(), 2])
    yaw = normalize_angle(first + float(weights @ _wrapped(poses[:, 2] - first)))
    away = poses - np.array((x, y, yaw))
    away[:, 2] = _wrapped(away[:, 2])
    return Pose2(x, y, yaw), (away * weights[:, None]).T @ away


def _wrapped(angles: Floats) -> Floats:
    """The equivalent angles from -pi to pi."""
    return angles - 2.0 * math.pi * np.rint(angles * (0.5 / math.pi))


def spread_poses(frame: Frame, free: NDArray[np.int64], draws: Floats) -> Floats:
    """Poses (n, 3) in `map` all over the cells `free` (indexes), from uniform `draws` (n, 4). Raises ValueError."""
    if not len(free):
        raise ValueError("the map has no free cells: a robot can be nowhere on it")
    row, column = np.divmod(free[(draws[:, 0] * len(free)).astype(np.int64)], frame.columns)
    places = frame.points_from_cells(np.stack((column + draws[:, 1], row + draws[:, 2]), axis=1))
    return np.column_stack((places, 2.0 * math.pi * draws[:, 3] - math.pi))
