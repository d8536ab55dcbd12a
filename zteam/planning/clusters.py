"""Where most particles are: those in bins that touch are one cluster, and the heaviest cluster is the estimate."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2, normalize_angle
from zteam.planning.jit import compiled, plainly
from zteam.planning.particles import (
    BIN_SIZE,
    EMPTY,
    STEP_X,
    STEP_Y,
    Bins,
    Floats,
    bin_of,
    bins_of,
    find_bin,
    make_table,
)

_BINS_OF_TURN = 36


def _label_numpy(poses: Floats, size: tuple[float, float, float], turns: int, labels: Bins) -> int:
    """The same without numba: numpy finds the bins, and only these are visited."""
    bins, first, bin_of_pose = np.unique(bins_of(poses, size), return_index=True, return_inverse=True)
    numbers = {key: number for number, key in enumerate(bins.tolist())}
    cluster = np.full(len(bins), -1)
    clusters = 0
    for key in bins[np.argsort(first)].tolist():
        if cluster[numbers[key]] >= 0:
            continue
        cluster[numbers[key]], stack = clusters, [key]
        while stack:
            place = stack.pop()
            for dx, dy, da in np.ndindex(3, 3, 3):
                turn = place % STEP_Y
                other = place - turn + (dx - 1) * STEP_X + (dy - 1) * STEP_Y + (turn + da - 1 + turns) % turns
                if other in numbers and cluster[numbers[other]] < 0:
                    cluster[numbers[other]] = clusters
                    stack.append(other)
        clusters += 1
    labels[:] = cluster[bin_of_pose]
    return clusters


@plainly(_label_numpy)
@compiled
def label_clusters(poses: Floats, size: tuple[float, float, float], turns: int, labels: Bins) -> int:
    """Give particles (n, 3) whose bins touch, if only at a corner, the same label; return how many labels there are.

    `turns`: bins of a full turn, where the last one touches the first.
    """
    count = poses.shape[0]
    table = make_table(count)
    cluster = np.full(table.shape[0], -1)
    row_of = np.empty(count, np.int64)
    stack = np.empty(count, np.int64)
    for i in range(count):
        key = bin_of(poses[i, 0], poses[i, 1], poses[i, 2], size)
        row_of[i] = find_bin(table, key)
        table[row_of[i]] = key
    clusters = 0
    for i in range(count):
        if cluster[row_of[i]] < 0:
            cluster[row_of[i]] = clusters
            stack[0], height = row_of[i], 1
            while height > 0:
                height -= 1
                place = table[stack[height]]
                for dx in range(-1, 2):
                    for dy in range(-1, 2):
                        for da in range(-1, 2):
                            turn = place % STEP_Y
                            other = place - turn + dx * STEP_X + dy * STEP_Y + (turn + da + turns) % turns
                            row = find_bin(table, other)
                            if table[row] != EMPTY and cluster[row] < 0:
                                cluster[row] = clusters
                                stack[height] = row
                                height += 1
            clusters += 1
        labels[i] = cluster[row_of[i]]
    return clusters


def _moments_numpy(poses: Floats, weights: Floats, about: Floats, sums: Floats) -> None:
    """The same without numba. A running sum adds in the order of the loop."""
    x, y, turn = (poses - about).T
    turn = turn - 2.0 * math.pi * np.rint(turn * (0.5 / math.pi))
    wx, wy, wa = weights * x, weights * y, weights * turn
    terms = (weights, wx, wy, wa, wx * x, wx * y, wx * turn, wy * y, wy * turn, wa * turn)
    sums[:] = [np.cumsum(term)[-1] for term in terms]


@plainly(_moments_numpy)
@compiled
def sum_moments(poses: Floats, weights: Floats, about: Floats, sums: Floats) -> None:
    """Sums over particles (n, 3) of 1, x, y, a, xx, xy, xa, yy, ya, aa, each times the weight, into `sums` (10).

    x, y and a (the turn, from -pi to pi) are counted from `about` (3).
    """
    total = sx = sy = sa = sxx = sxy = sxa = syy = sya = saa = 0.0
    for i in range(poses.shape[0]):
        x, y, turn = poses[i, 0] - about[0], poses[i, 1] - about[1], poses[i, 2] - about[2]
        turn = turn - 2.0 * math.pi * np.rint(turn * (0.5 / math.pi))
        weight = weights[i]
        wx, wy, wa = weight * x, weight * y, weight * turn
        total, sx, sy, sa = total + weight, sx + wx, sy + wy, sa + wa
        sxx, sxy, sxa = sxx + wx * x, sxy + wx * y, sxa + wx * turn
        syy, sya, saa = syy + wy * y, sya + wy * turn, saa + wa * turn
    sums[0], sums[1], sums[2], sums[3] = total, sx, sy, sa
    sums[4], sums[5], sums[6], sums[7], sums[8], sums[9] = sxx, sxy, sxa, syy, sya, saa


_SQUARES = np.array(((4, 5, 6), (5, 7, 8), (6, 8, 9)))
"""Where the covariance's elements are in the sums."""


def estimate_pose(poses: Floats, weights: Floats) -> tuple[Pose2, NDArray[np.float64]]:
    """The mean and covariance (3, 3) of the heaviest cluster of particles (n, 3)."""
    labels = np.empty(len(poses), np.int64)
    clusters = label_clusters(poses, BIN_SIZE, _BINS_OF_TURN, labels)
    if clusters > 1:
        chosen = labels == np.bincount(labels, weights, clusters).argmax()
        poses, weights = poses[chosen], weights[chosen]
    # A cluster lies about one of its particles, so its sums stay small, and so do its turns.
    about, sums = poses[weights.argmax()], np.empty(10)
    sum_moments(poses, weights, about, sums)
    sums /= sums[0]
    mean = sums[1:4]
    x, y, yaw = (about + mean).tolist()
    return Pose2(x, y, normalize_angle(yaw)), sums[_SQUARES] - np.outer(mean, mean)
