"""The laser kernels on numpy, where numba is missing: the same method and results, slower.

Also the second implementation that the tests hold against the first.
"""

import numpy as np
from numpy.typing import NDArray

from zteam.sim.outlines import NOBODY, Outlines, contains

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

_TINY = 1e-9
_EDGE = 1e-12


def cast_squares(
    sides: NDArray[np.uint8], rows: int, columns: int, cell_x: float, cell_y: float,
    x: Floats, y: Floats, yaw: Floats, seen: NDArray[np.bool_], cos: Floats, sin: Floats, limit: float, mark: int,
    ranges: Floats, hit: Ints,
) -> None:  # fmt: skip
    """See `zteam.sim.kernels.cast_squares`."""
    c0, s0 = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    dx = ((c0 * cos - s0 * sin) / cell_x).ravel()
    dy = ((s0 * cos + c0 * sin) / cell_y).ravel()
    px, py = (np.repeat(v, cos.shape[1]) for v in (x / cell_x, y / cell_y))
    left, down = dx < 0.0, dy < 0.0
    qx, qy = np.where(left, columns - px, px), np.where(down, rows - py, py)
    jx = np.where(left, columns - 1 - np.floor(px), np.floor(px))
    jy = np.where(down, rows - 1 - np.floor(py), np.floor(py))
    jx, jy = np.where((jx < 0) & (qx >= 0), 0, jx), np.where((jy < 0) & (qy >= 0), 0, jy)
    dx, dy = np.maximum(np.abs(dx), _TINY), np.maximum(np.abs(dy), _TINY)
    enter = np.maximum(0.0, np.maximum(-qx / dx, -qy / dy))
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
        tx, ty = (edge_x - qx[going]) / dx[going], (edge_y - qy[going]) / dy[going]
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


def cast_edges(
    o: Outlines, x: Floats, y: Floats, z: Floats, yaw: Floats, sensor_owner: NDArray[np.int64],
    cos: Floats, sin: Floats, angle_min: float, increment: float, jitter: float, ranges: Floats, hit: Ints,
) -> None:  # fmt: skip
    """See `zteam.sim.kernels.cast_edges`; here every beam meets every edge that the sensor may see."""
    shape_owner = np.repeat(o.owner, np.diff(o.first_shape))
    centre_x, centre_y, radius = (np.repeat(v, np.diff(o.first_shape)) for v in (o.centre_x, o.centre_y, o.radius))
    for scan in range(len(x)):
        row_cos, row_sin = (t[scan] if len(t) > 1 else t[0] for t in (cos, sin))
        c0, s0 = np.cos(yaw[scan]), np.sin(yaw[scan])
        distance = np.sqrt((centre_x - x[scan]) ** 2 + (centre_y - y[scan]) ** 2)
        near = distance - radius <= ranges[scan].max()
        foreign = (shape_owner != sensor_owner[scan]) | (sensor_owner[scan] == NOBODY)
        for shape in np.flatnonzero(near & foreign & (z[scan] >= o.z_min) & (z[scan] <= o.z_max)):
            begin, end = o.first_vertex[shape], o.first_vertex[shape + 1]
            if distance[shape] <= radius[shape] and contains(o.x, o.y, begin, end, x[scan], y[scan]):
                hit[scan, ranges[scan] > 0.0] = shape
                ranges[scan] = np.minimum(ranges[scan], 0.0)
                continue
            vertices = slice(begin, end)
            wx, wy = o.x[vertices] - x[scan], o.y[vertices] - y[scan]
            wx, wy = c0 * wx + s0 * wy, c0 * wy - s0 * wx
            ux, uy = np.roll(wx, 1), np.roll(wy, 1)
            ex, ey = wx - ux, wy - uy
            denominator = np.outer(row_cos, ey) - np.outer(row_sin, ex)
            safe = np.where(np.abs(denominator) < 1e-15, np.inf, denominator)
            along = (ux * ey - uy * ex) / safe
            where = (np.outer(row_sin, ux) - np.outer(row_cos, uy)) / safe
            valid = np.isfinite(safe) & (along >= 0.0) & (where >= -_EDGE) & (where <= 1.0 + _EDGE)
            nearest = np.where(valid, along, np.inf).min(axis=1)
            shorter = nearest < ranges[scan]
            ranges[scan, shorter] = nearest[shorter]
            hit[scan, shorter] = shape


def finish(
    ranges: Floats, hit: Ints, intensity: NDArray[np.float32], out: NDArray[np.float32], bright: NDArray[np.float32]
) -> None:
    """See `zteam.sim.kernels.finish`."""
    out[:] = ranges
    bright[:] = intensity[hit]
