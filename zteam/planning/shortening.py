"""Any-angle ways: a way from cell to cell becomes one of straight lines that cost no more.

First the cheapest way along lines between cells of the given way (dynamic programming, over lines of bounded length).
Then its points move to the side, where that makes it cheaper: dynamic programming over a few places for each point.
"""

import math
from itertools import pairwise

import numpy as np

from zteam.kernels.binding import Bytes, Cells, measure_lines, shorten

STRIDE, REACH = 4, 320
"""Lines join every fourth cell of a way from cell to cell, to those up to 320 cells before."""
_SPACING = 20
"""Cells between the points that move to the side."""
_WIDTHS = (4, 2, 1)
"""Cells that they move at a time."""
_SIDES = np.arange(-3, 4)
"""Times that width, to either side."""


def make_any_angle(weights: Bytes, way: Cells, least: int) -> Cells:
    """The corners of a way of straight lines that costs no more than `way` (cells, each beside the one before)."""
    corners, cost = _join(weights, way, STRIDE, REACH, least)
    points = corners
    for width in _WIDTHS:
        points = _shift(weights, _space_out(points), width)
    moved, moved_cost = _join(weights, points, 1, REACH // _SPACING, least)
    return moved if moved_cost < cost else corners


def _join(weights: Bytes, way: Cells, stride: int, reach: int, least: int) -> tuple[Cells, float]:
    """The corners of the cheapest way along lines between points of `way`, and its cost."""
    best, before = shorten(weights, way, stride, reach, float(least))
    found = [len(way) - 1]
    while before[found[-1]] >= 0:
        found.append(int(before[found[-1]]))
    return _drop_straight(way[found[::-1]]), float(best[-1])


def _drop_straight(corners: Cells) -> Cells:
    """Without the points at which the way does not turn."""
    moved = (corners[1:] != corners[:-1]).any(axis=1)
    corners = corners[np.concatenate(([True], moved))]
    if len(corners) < 3:
        return corners
    to, on = corners[1:-1] - corners[:-2], corners[2:] - corners[1:-1]
    turns = (to[:, 0] * on[:, 1] != to[:, 1] * on[:, 0]) | ((to * on).sum(axis=1) < 0)
    return corners[np.concatenate(([True], turns, [True]))]


def _space_out(corners: Cells) -> Cells:
    """The corners, with points on the lines between them, at most _SPACING cells apart."""
    parts = []
    for begin, end in pairwise(corners):
        count = max(1, math.ceil(math.dist(begin, end) / _SPACING))
        parts.append(np.rint(begin + (end - begin) * (np.arange(count) / count)[:, None]).astype(np.int64))
    return np.concatenate([*parts, corners[-1:]])


def _shift(weights: Bytes, points: Cells, width: int) -> Cells:
    """The cheapest way through one place for each point: itself, or some widths to its side."""
    if len(points) < 3:
        return points
    along = (points[2:] - points[:-2]).astype(np.float64)
    along /= np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)[:, None]
    aside = np.stack((-along[:, 1], along[:, 0]), axis=1)
    sides = len(_SIDES)
    places = np.repeat(points[:, None], sides, axis=1)
    places[1:-1] += np.rint(aside[:, None] * (width * _SIDES)[None, :, None]).astype(np.int64)
    np.clip(places, 0, [weights.shape[1] - 1, weights.shape[0] - 1], out=places)
    count = len(points) - 1
    begins = np.repeat(places[:-1], sides, axis=1).reshape(-1, 2)
    ends = np.tile(places[1:], (1, sides, 1)).reshape(-1, 2)
    lines = measure_lines(weights, begins, ends).reshape(count, sides, sides)
    best, before = lines[0].min(axis=0), np.zeros((count + 1, sides), np.int64)
    for i in range(1, count):
        sums = best[:, None] + lines[i]
        before[i + 1] = sums.argmin(axis=0)
        best = sums.min(axis=0)
    at = int(best.argmin())
    chosen = [at]
    for i in range(count, 1, -1):
        at = int(before[i][at])
        chosen.append(at)
    chosen.append(sides // 2)
    return places[np.arange(count + 1), chosen[::-1]]
