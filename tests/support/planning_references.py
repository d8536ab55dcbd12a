"""What kernels of planning are to give, found slowly and plainly."""

import math
from itertools import pairwise, product

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


def straighten(weights: np.ndarray, way: np.ndarray, stride: int, reach: int, spacing: int) -> np.ndarray:
    """The corners of a way of straight lines, step by step."""

    def join(points: np.ndarray, stride: int, reach: int) -> tuple[np.ndarray, float]:
        best, before = shorten(weights, points, stride, reach)
        found = [len(points) - 1]
        while before[found[-1]] >= 0:
            found.append(before[found[-1]])
        corners = points[found[::-1]]
        corners = corners[[True, *np.diff(corners, axis=0).any(axis=1)]]
        to, on = np.diff(corners, axis=0)[:-1], np.diff(corners, axis=0)[1:]
        turns = (to[:, 0] * on[:, 1] != to[:, 1] * on[:, 0]) | ((to * on).sum(axis=1) < 0)
        return corners[[True, *turns, True][: len(corners)]], best[-1]

    def space_out(corners: np.ndarray) -> np.ndarray:
        lines = [np.linspace(a, b, max(1, math.ceil(math.dist(a, b) / spacing)), False) for a, b in pairwise(corners)]
        return np.rint(np.concatenate((*lines, corners[-1:]))).astype(int)

    def shift(points: np.ndarray, width: int) -> np.ndarray:
        along = np.pad(points[2:] - points[:-2], ((1, len(points) > 1), (0, 0))).astype(float)[: len(points)]
        left = along[:, ::-1] * (-1, 1) / np.maximum(np.sqrt((along**2).sum(axis=1)), 1e-9)[:, None]
        sides = points[:, None] + np.rint(left[:, None] * width * np.arange(-3, 4)[:, None]).astype(int)
        sides = np.clip(sides, 0, np.array(weights.shape)[::-1] - 1)
        ways = [(0.0, [place]) for place in sides[0]]
        for places in sides[1:]:
            begins = np.array([way[-1] for _, way in ways])
            lines = [measure_lines(weights, begins, np.tile(to, (7, 1))) for to in places]
            costs = [[cost + more for (cost, _), more in zip(ways, line.tolist(), strict=True)] for line in lines]
            chosen = [row.index(min(row)) for row in costs]
            ways = [(row[k], [*ways[k][1], to]) for row, k, to in zip(costs, chosen, places, strict=True)]
        return np.array(ways[0][1])

    corners, cost = join(way, stride, reach)
    points = corners
    for width in (4, 2, 1):
        points = shift(space_out(points), width)
    moved, moved_cost = join(points, 1, reach // spacing)
    return moved if moved_cost < cost else corners


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
