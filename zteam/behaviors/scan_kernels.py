"""Kernels that look at every beam of a scan once. The plain ones on numpy give the same bits.

Distances are metres, (n,). A distance is NaN where a beam says nothing, and inf where it met nothing.
"""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.behaviors.jit import compiled, plainly

Floats = NDArray[np.float64]


def _interpret_numpy(ranges: Floats, at_least: float, at_most: float, no_hit: float) -> bool:
    # Both find a NaN first, and are several times as fast as `min` and `max`.
    low, high = ranges.item(ranges.argmin()), ranges.item(ranges.argmax())
    # A NaN among them fails the comparisons. Mostly every beam says something, and then no beam has to be looked at.
    all_speak: bool = low > 0.0 and low >= at_least and high <= at_most
    if all_speak:
        if high >= no_hit:
            np.putmask(ranges, ranges >= no_hit, np.inf)
        return True
    too_close = ranges == -np.inf
    # NaN fails both comparisons, and so says nothing either.
    in_range = (ranges >= at_least) & (ranges <= at_most)
    ranges[~((in_range | (ranges == np.inf)) & (ranges > 0.0))] = np.nan
    np.putmask(ranges, ranges >= no_hit, np.inf)
    ranges[too_close] = 0.0
    return False


@plainly(_interpret_numpy)
@compiled
def interpret(ranges: Floats, at_least: float, at_most: float, no_hit: float) -> bool:
    """Make of the ranges of a message, at least one, what they mean; whether each is in the laser's limits.

    Those from `no_hit` on become inf, -inf becomes 0 and what says nothing NaN. All numbers are metres.
    """
    speak = 0
    for i in range(ranges.size):
        distance = ranges[i]
        # Without branches: so it becomes vector code.
        in_range = (distance > 0.0) & (distance >= at_least) & (distance <= at_most)
        speak += in_range
        says_something = in_range | (distance == math.inf)
        silent = 0.0 if distance == -math.inf else math.nan
        met = math.inf if distance >= no_hit else distance
        ranges[i] = met if says_something else silent
    return speak == ranges.size


def _find_nearest_numpy(distances: Floats, size: int, nearest: Floats) -> None:
    nearest.fill(np.nan)
    for i in range(size):
        part = distances[i::size]
        # The smaller of two numbers; of a number and a NaN the number.
        np.fmin(nearest[: part.size], part, out=nearest[: part.size])


@plainly(_find_nearest_numpy)
@compiled
def find_nearest(distances: Floats, size: int, nearest: Floats) -> None:
    """The nearest of each group of `size` beams, side by side; the last group may be smaller. NaN if all are NaN."""
    for group in range(nearest.size):
        least = math.nan
        for i in range(group * size, min(distances.size, (group + 1) * size)):
            if not least <= distances[i] and not math.isnan(distances[i]):
                least = distances[i]
        nearest[group] = least


def _select_hits_numpy(distances: Floats, ends: Floats, axes: Floats, x: float, y: float, points: Floats) -> int:
    near = distances < ends
    if not np.count_nonzero(near):
        return 0
    at = near.nonzero()[0]
    points[:, : at.size] = axes.take(at, axis=1) * distances.take(at) + ((x,), (y,))
    return at.size


@plainly(_select_hits_numpy)
@compiled
def select_hits(distances: Floats, ends: Floats, axes: Floats, x: float, y: float, points: Floats) -> int:
    """Where the beams that end before `ends` (n,) meet something: into `points` (2, n); how many there are.

    `axes` (2, n) are the directions of the beams in the base frame, and (x, y) is the laser's place there.
    """
    count = 0
    for i in range(distances.size):
        if distances[i] < ends[i]:
            points[0, count] = axes[0, i] * distances[i] + x
            points[1, count] = axes[1, i] * distances[i] + y
            count += 1
    return count
