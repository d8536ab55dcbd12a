"""Straight lines over a grid: what they cost, and whether they are free.

A line is followed through every cell that it touches, so it goes through no cell that a step could not enter. Its cost
is the integral of the weights along it. All is counted in whole numbers until the end, so the order does not matter.
"""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.planning.jit import compiled, plainly
from zteam.planning.search_kernels import Weights

Floats = NDArray[np.float64]
Cells = NDArray[np.int64]
"""(n, 2): column and row of each cell, as `weights` has them."""


@compiled
def measure_line(weights: Weights, columns: int, x0: int, y0: int, x1: int, y1: int, most: float) -> float:
    """Cost of the line from the middle of one cell to that of another: weight times cells; inf if it is blocked, or
    certainly costs more than `most`."""
    dx, dy = abs(x1 - x0), abs(y1 - y0)
    step_x, step_y = (1 if x1 > x0 else -1), (columns if y1 > y0 else -columns)
    # Along the line time runs in whole ticks: it crosses sides of cells every 2 dy and every 2 dx of them.
    every_x, every_y = 2 * max(dy, 1), 2 * max(dx, 1)
    if dx == 0:
        every_x, every_y = 0, 2
    total = every_x * dx if dx > 0 else 2 * dy
    length = math.sqrt(float(dx * dx + dy * dy))
    if total == 0:
        return 0.0
    bound = most / length * total * (1.0 + 1e-9) + 1.0
    next_x, next_y, now, ticks = every_x // 2, every_y // 2, 0, np.int64(0)
    cell = y0 * columns + x0
    left_x, left_y = dx, dy
    while left_x > 0 or left_y > 0:
        weight = np.int64(weights[cell])
        if weight == 0 or ticks > bound:
            return math.inf
        if left_y == 0 or (left_x > 0 and next_x < next_y):
            ticks += weight * (next_x - now)
            now = next_x
            next_x += every_x
            cell += step_x
            left_x -= 1
        elif left_x == 0 or next_y < next_x:
            ticks += weight * (next_y - now)
            now = next_y
            next_y += every_y
            cell += step_y
            left_y -= 1
        else:
            # Through a corner: as with steps, both cells beside it must be free.
            if weights[cell + step_x] == 0 or weights[cell + step_y] == 0:
                return math.inf
            ticks += weight * (next_x - now)
            now = next_x
            next_x += every_x
            next_y += every_y
            cell += step_x + step_y
            left_x -= 1
            left_y -= 1
    weight = np.int64(weights[cell])
    if weight == 0:
        return math.inf
    ticks += weight * (total - now)
    return length * (float(ticks) / float(total))


def measure_lines_numpy(weights: Weights, columns: int, begins: Cells, ends: Cells, out: Floats) -> None:
    """`measure_lines` with whole arrays: all places where lines cross sides of cells, in order."""
    delta = np.abs(ends - begins)
    dx, dy = delta[:, :1], delta[:, 1:]
    step_x = np.where(ends[:, :1] > begins[:, :1], 1, -1)
    step_y = np.where(ends[:, 1:] > begins[:, 1:], columns, -columns)
    total = np.where((dx > 0) & (dy > 0), 2 * dx * dy, 2 * (dx + dy))
    i, j = np.arange(max(1, delta[:, 0].max())), np.arange(max(1, delta[:, 1].max()))
    never = np.iinfo(np.int64).max
    along_x = np.where(i < dx, (2 * i + 1) * np.maximum(dy, 1), never)
    along_y = np.where(j < dy, (2 * j + 1) * np.maximum(dx, 1), never)
    ticks = np.concatenate((along_x, along_y), axis=1)
    # Those at the same tick keep their order: along x first.
    order = np.argsort(ticks, axis=1, kind="stable")
    ticks = np.take_along_axis(ticks, order, axis=1)
    steps = np.where(ticks == never, 0, np.where(order < len(i), step_x, step_y))
    first = begins[:, 1:] * columns + begins[:, :1]
    cells = np.concatenate((first, first + np.cumsum(steps, axis=1)), axis=1)
    times = np.minimum(np.concatenate((np.zeros_like(first), ticks, total), axis=1), total)
    passed = weights[cells].astype(np.int64)
    corner = (ticks[:, 1:] == ticks[:, :-1]) & (ticks[:, 1:] != never)
    beside = np.where(corner, cells[:, 2:] - step_x, first)
    blocked = (passed == 0).any(axis=1) | (corner & (weights[beside] == 0)).any(axis=1)
    costs = (passed * np.diff(times, axis=1)).sum(axis=1)
    total = total[:, 0]
    length = np.sqrt((delta * delta).sum(axis=1).astype(np.float64))
    share = costs.astype(np.float64) / np.maximum(total, 1)
    out[:] = np.where(total == 0, 0.0, np.where(blocked, math.inf, length * share))


@plainly(measure_lines_numpy)
@compiled
def measure_lines(weights: Weights, columns: int, begins: Cells, ends: Cells, out: Floats) -> None:
    """Cost of each line from the middle of a cell to that of another, to `out`; inf where it is blocked."""
    for i in range(begins.shape[0]):
        out[i] = measure_line(weights, columns, begins[i, 0], begins[i, 1], ends[i, 0], ends[i, 1], math.inf)
