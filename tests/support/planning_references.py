"""What kernels of planning are to give, found slowly and plainly."""

import math
from itertools import product

import numpy as np

from zteam.geometry import Pose2
from zteam.kernels.navigation import measure_lines


def trace_beams(costs: np.ndarray, x0: int, y0: int, ends: np.ndarray, marks: np.ndarray) -> None:
    """Clear the cells along beams, then mark some: at each step the nearest cell, of two the farther one."""
    rows, columns = costs.shape
    clear = []
    for x, y in ends.tolist():
        longest = max(abs(x - x0), abs(y - y0))
        for k in range(longest + 1):
            u, v = (abs(2 * k * (to - at)) + longest for to, at in ((x, x0), (y, y0)))
            share = max(1, 2 * longest)
            clear.append((x0 + int(np.sign(x - x0)) * (u // share), y0 + int(np.sign(y - y0)) * (v // share)))
    for cells, cost in ((clear, 0), (marks.tolist(), 254)):
        for x, y in cells:
            if 0 <= x < columns and 0 <= y < rows:
                costs[y, x] = cost


def inflate(costs: np.ndarray, table: np.ndarray, reach: int, unknown_from: int) -> np.ndarray:
    """All cells raised to the costs of their distances, which are found by looking at all lethal cells."""
    out, lethal = costs.copy(), np.argwhere(costs == 254)
    for cell in np.ndindex(costs.shape):
        square = min(((lethal - cell) ** 2).sum(axis=1), default=10**9)
        cost = int(table[square]) if square < (reach + 1) ** 2 else 0
        raised = cost >= unknown_from if costs[cell] == 255 else cost > costs[cell]
        out[cell] = cost if raised else costs[cell]
    return out


def shorten(weights: np.ndarray, way: np.ndarray, stride: int, reach: int) -> tuple[list[float], list[int]]:
    """The cheapest way along lines, by trying all of them."""
    best, before = [0.0], [-1]
    for i in range(1, len(way)):
        starts = [i - 1]
        if i % stride == 0 or i == len(way) - 1:
            starts += range(max(0, i - reach) // stride * stride, i - 1, stride)
        lines = measure_lines(weights, way[starts], np.repeat(way[[i]], len(starts), axis=0))
        costs = [best[j] + cost for j, cost in zip(starts, lines.tolist(), strict=True)]
        best.append(min(costs))
        before.append(starts[costs.index(min(costs))])
    return best, before


def sum_values(values: np.ndarray, place: tuple[float, ...], pose: Pose2, beams: np.ndarray) -> int:
    """Values of the cells in which the beams of a pose end, one after the other, with single precision."""
    x, y, yaw, cell = place
    at = Pose2(x, y, yaw).inverse().compose(pose)
    u, v = np.float32(at.x / cell + 1.0), np.float32(at.y / cell + 1.0)
    cos, sin = np.float32(math.cos(at.yaw)), np.float32(math.sin(at.yaw))
    total, (rows, columns) = 0, values.shape
    for along, aside in beams.T:
        column, row = u + (cos * along - sin * aside), v + (sin * along + cos * aside)
        total += int(values[int(min(max(row, 0), rows - 1)), int(min(max(column, 0), columns - 1))])
    return total


def climb(
    values: np.ndarray, place: tuple[float, ...], pose: np.ndarray, beams: np.ndarray, step: float, turn: float,
    halvings: int, most: int,
) -> np.ndarray:  # fmt: skip
    """Where a pattern search from a pose ends."""
    best = sum_values(values, place, Pose2(*pose.tolist()), beams)
    for _ in range(most):
        near = [pose + np.array((x * step, y * step, a * turn)) for a, x, y in product((-1, 0, 1), repeat=3)]
        sums = [sum_values(values, place, Pose2(*other.tolist()), beams) for other in near]
        if max(sums) > best:
            best, pose = max(sums), near[sums.index(max(sums))]
            continue
        halvings, step, turn = halvings - 1, 0.5 * step, 0.5 * turn
        if halvings < 0:
            break
    return pose


def label_clusters(poses: np.ndarray, size: tuple[float, float, float], turns: int) -> list[int]:
    """Labels of particles, by looking at all pairs of bins."""
    bins = np.floor(np.column_stack((poses[:, :2], poses[:, 2] % math.tau)) / size).astype(int)
    labels = [-1] * len(bins)
    for first in range(len(bins)):
        if labels[first] >= 0:
            continue
        label, stack = max(labels, default=-1) + 1, [first]
        while stack:
            one = stack.pop()
            labels[one] = label
            apart = np.abs(bins - bins[one])
            apart[:, 2] = np.minimum(apart[:, 2], turns - apart[:, 2])
            stack += [other for other in np.flatnonzero((apart <= 1).all(axis=1)).tolist() if labels[other] < 0]
    return labels
