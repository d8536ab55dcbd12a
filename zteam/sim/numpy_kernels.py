"""The inner loops of the laser kernels on numpy, for where nothing is compiled: slower, and the same to the last bit.

So every expression here is the one of `square_kernels` or `edge_kernels`, in the same order, and each kernel is one
function as there.
"""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

SECTOR = 8
"""Beams in a sector of a scan: the farthest range of each rejects what lies behind it."""
_TINY = 1e-9
_EDGE = 1e-12


def cast_squares(
    sides: NDArray[np.uint8], rows: int, columns: int, cell_x: float, cell_y: float,
    x: Floats, y: Floats, yaw: Floats, seen: NDArray[np.bool_], cos: Floats, sin: Floats, limit: float, mark: int,
    ranges: Floats, hit: Ints,
) -> None:  # fmt: skip
    """See `zteam.sim.square_kernels.cast_squares`."""
    # numpy's own sine and cosine of arrays may differ from the C library's in the last digit.
    c0, s0 = (np.array([[f(angle)] for angle in yaw.tolist()]).reshape(-1, 1) for f in (math.cos, math.sin))
    dx = (c0 / cell_x * cos - s0 / cell_x * sin).ravel()
    dy = (s0 / cell_y * cos + c0 / cell_y * sin).ravel()
    px, py = (np.repeat(v, cos.shape[1]) for v in (x / cell_x, y / cell_y))
    left, down = dx < 0.0, dy < 0.0
    qx, qy = np.where(left, columns - px, px), np.where(down, rows - py, py)
    jx = np.where(left, columns - 1 - np.floor(px), np.floor(px))
    jy = np.where(down, rows - 1 - np.floor(py), np.floor(py))
    jx, jy = np.where((jx < 0) & (qx >= 0), 0, jx), np.where((jy < 0) & (qy >= 0), 0, jy)
    dx, dy = np.maximum(np.abs(dx), _TINY), np.maximum(np.abs(dy), _TINY)
    ux, uy = 1.0 / dx, 1.0 / dy
    # Plus 0: a start on the border would enter after -0 metres.
    enter = np.maximum(0.0, np.maximum(-qx / dx, -qy / dy)) + 0.0
    outside, first_x = enter > 0.0, -qx / dx > -qy / dy
    jx = np.where(outside, np.where(first_x, 0, np.floor(qx + enter * dx)), jx).astype(np.int64)
    jy = np.where(outside, np.where(first_x, np.floor(qy + enter * dy), 0), jy).astype(np.int64)
    t = enter.copy()
    missed = (jx < 0) | (jy < 0) | (jx >= columns) | (jy >= rows) | (enter >= limit) | ~np.repeat(seen, cos.shape[1])
    t[missed] = limit
    base = (left + 2 * down.astype(np.int64)) * sides.shape[1]
    flat = sides.reshape(-1)
    going = np.flatnonzero(~missed)
    while going.size:
        side = flat[base[going] + jy[going] * columns + jx[going]].astype(np.int64)
        going, side = going[side > 0], side[side > 0]
        edge_x, edge_y = jx[going] + side, jy[going] + side
        tx, ty = (edge_x - qx[going]) * ux[going], (edge_y - qy[going]) * uy[going]
        by_x = tx <= ty
        step = np.where(by_x, tx, ty)
        along_x = np.clip((qx[going] + step * dx[going]).astype(np.int64), jx[going], edge_x - 1)
        along_y = np.clip((qy[going] + step * dy[going]).astype(np.int64), jy[going], edge_y - 1)
        next_x, next_y = np.where(by_x, edge_x, along_x), np.where(by_x, along_y, edge_y)
        gone = (next_x >= columns) | (next_y >= rows) | (step >= limit)
        jx[going], jy[going], t[going] = next_x, next_y, np.where(gone, limit, step)
        going = going[~gone]
    found = t.reshape(ranges.shape)
    nearer = found < ranges
    ranges[nearer] = found[nearer]
    hit[nearer] = mark


def cast_edge(
    ux: float, uy: float, ex: float, ey: float, cos: Floats, sin: Floats, begin: int, end: int, shape: int,
    ranges: Floats, hit: Ints,
) -> None:  # fmt: skip
    """See `zteam.sim.edge_kernels.cast_edge`."""
    if begin >= end:
        return
    c, s, found = cos[begin:end], sin[begin:end], ranges[begin:end]
    denominator = c * ey - s * ex
    # Comparisons with nan are false.
    denominator[np.abs(denominator) < 1e-15] = np.nan
    along = (ux * ey - uy * ex) / denominator
    where = (s * ux - c * uy) / denominator
    nearer = (along >= 0.0) & (along < found) & (where >= -_EDGE) & (where <= 1.0 + _EDGE)
    found[nearer] = along[nearer]
    hit[begin:end][nearer] = shape


def find_tops(ranges: Floats, tops: Floats) -> float:
    """See `zteam.sim.edge_kernels.find_tops`."""
    tops[:] = np.maximum(np.maximum.reduceat(ranges, np.arange(0, len(ranges), SECTOR)), 0.0)
    return float(tops.max())


def finish(
    ranges: Floats, hit: Ints, intensity: NDArray[np.float32], out: NDArray[np.float32], bright: NDArray[np.float32]
) -> None:
    """See `zteam.sim.edge_kernels.finish`."""
    out[:] = ranges
    bright[:] = intensity[hit]
