"""Any-angle ways: a way from cell to cell becomes one of straight lines that cost no more.

First the cheapest way along lines between cells of the given way (dynamic programming, over lines of bounded length).
Then its points move to the side, where that makes it cheaper: dynamic programming over a few places for each point.
"""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from zteam.planning.jit import compiled, plainly
from zteam.planning.lines import Cells, Floats, measure_line, measure_lines, measure_lines_numpy
from zteam.planning.search_kernels import Weights

STRIDE, REACH = 4, 320
"""Lines join every fourth cell of a way from cell to cell, to those up to 320 cells before."""
_SPACING = 20
"""Cells between the points that move to the side."""
_WIDTHS = (4, 2, 1)
"""Cells that they move at a time."""
_SIDES = np.arange(-3, 4)
"""Times that width, to either side."""


def _shorten_numpy(
    weights: Weights, columns: int, way: Cells, stride: int, reach: int, least: float, best: Floats,
    before: NDArray[np.int64],
) -> None:  # fmt: skip
    """The same without numba: all lines to a cell at once."""
    count = len(way)
    steps = np.empty(count - 1)
    if count > 1:
        measure_lines_numpy(weights, columns, way[:-1], way[1:], steps)
    best[0], before[0] = 0.0, -1
    for i in range(1, count):
        best[i], before[i] = best[i - 1] + steps[i - 1], i - 1
        if i % stride != 0 and i != count - 1:
            continue
        from_ = np.arange(max(0, i - reach) // stride * stride, i - 1, stride)
        delta = (way[from_] - way[i]).astype(np.float64)
        from_ = from_[~(least * np.sqrt((delta * delta).sum(axis=1)) >= best[i] - best[from_])]
        if not len(from_):
            continue
        costs = np.empty(len(from_))
        measure_lines_numpy(weights, columns, way[from_], np.broadcast_to(way[i], (len(from_), 2)), costs)
        costs += best[from_]
        least_of_all = int(np.argmin(costs))
        if costs[least_of_all] < best[i]:
            best[i], before[i] = costs[least_of_all], from_[least_of_all]


@plainly(_shorten_numpy)
@compiled
def shorten(
    weights: Weights, columns: int, way: Cells, stride: int, reach: int, least: float, best: Floats,
    before: NDArray[np.int64],
) -> None:  # fmt: skip
    """The cheapest way along lines between cells of `way`, each a neighbour of the one before.

    Lines join every `stride`th cell, and the last, to such cells up to `reach` cells before. `best` becomes the cost of
    the way to each cell, `before` the index of the cell from which the last line comes. `least` is the least weight.
    """
    count = way.shape[0]
    best[0], before[0] = 0.0, -1
    for i in range(1, count):
        x, y = way[i, 0], way[i, 1]
        best[i] = best[i - 1] + measure_line(weights, columns, way[i - 1, 0], way[i - 1, 1], x, y, math.inf)
        before[i] = i - 1
        if i % stride != 0 and i != count - 1:
            continue
        for j in range(max(0, i - reach) // stride * stride, i - 1, stride):
            most = best[i] - best[j]
            dx, dy = float(way[j, 0] - x), float(way[j, 1] - y)
            if least * math.sqrt(dx * dx + dy * dy) >= most:
                continue
            cost = measure_line(weights, columns, way[j, 0], way[j, 1], x, y, most)
            if best[j] + cost < best[i]:
                best[i], before[i] = best[j] + cost, j


def make_any_angle(weights: Weights, columns: int, way: Cells, least: int) -> Cells:
    """The corners of a way of straight lines that costs no more than `way` (cells, each beside the one before)."""
    corners, cost = _join(weights, columns, way, STRIDE, REACH, least)
    points = corners
    for width in _WIDTHS:
        points = _shift(weights, columns, _space_out(points), width)
    moved, moved_cost = _join(weights, columns, points, 1, REACH // _SPACING, least)
    return moved if moved_cost < cost else corners


def _join(weights: Weights, columns: int, way: Cells, stride: int, reach: int, least: int) -> tuple[Cells, float]:
    """The corners of the cheapest way along lines between points of `way`, and its cost."""
    best, before = np.empty(len(way)), np.empty(len(way), np.int64)
    shorten(weights, columns, way, stride, reach, float(least), best, before)
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


def _shift(weights: Weights, columns: int, points: Cells, width: int) -> Cells:
    """The cheapest way through one place for each point: itself, or some widths to its side."""
    if len(points) < 3:
        return points
    along = (points[2:] - points[:-2]).astype(np.float64)
    along /= np.maximum(np.hypot(along[:, 0], along[:, 1]), 1e-9)[:, None]
    aside = np.stack((-along[:, 1], along[:, 0]), axis=1)
    sides = len(_SIDES)
    places = np.repeat(points[:, None], sides, axis=1)
    places[1:-1] += np.rint(aside[:, None] * (width * _SIDES)[None, :, None]).astype(np.int64)
    np.clip(places, 0, [columns - 1, len(weights) // columns - 1], out=places)
    count = len(points) - 1
    begins = np.repeat(places[:-1], sides, axis=1).reshape(-1, 2)
    ends = np.tile(places[1:], (1, sides, 1)).reshape(-1, 2)
    costs = np.empty(len(begins))
    measure_lines(weights, columns, begins, ends, costs)
    lines = costs.reshape(count, sides, sides)
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
