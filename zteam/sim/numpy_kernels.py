"""The laser kernels on numpy, where numba is missing: the same method and results, slower.

Also the second implementation that the tests hold against the first.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_TINY = 1e-9
_EDGE = 1e-12


def cast_squares(
    sides: NDArray[np.uint8], rows: int, columns: int, cell_x: float, cell_y: float,
    x: Floats, y: Floats, yaw: Floats, seen: NDArray[np.bool_], cos: Floats, sin: Floats, limit: float, out: Floats,
) -> None:  # fmt: skip
    """See `zteam.sim.kernels.cast_squares`."""
    c0, s0 = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    dx = ((c0 * cos - s0 * sin) / cell_x).ravel()
    dy = ((s0 * cos + c0 * sin) / cell_y).ravel()
    px, py = (np.repeat(v, cos.shape[0]) for v in (x / cell_x, y / cell_y))
    left, down = dx < 0.0, dy < 0.0
    qx, qy = np.where(left, columns - px, px), np.where(down, rows - py, py)
    jx, jy = (
        np.where(left, columns - 1 - np.floor(px), np.floor(px)),
        np.where(down, rows - 1 - np.floor(py), np.floor(py)),
    )
    jx, jy = np.where((jx < 0) & (qx >= 0), 0, jx), np.where((jy < 0) & (qy >= 0), 0, jy)
    dx, dy = np.maximum(np.abs(dx), _TINY), np.maximum(np.abs(dy), _TINY)
    enter = np.maximum(0.0, np.maximum(-qx / dx, -qy / dy))
    outside, first_x = enter > 0.0, -qx / dx > -qy / dy
    jx = np.where(outside, np.where(first_x, 0, np.floor(qx + enter * dx)), jx).astype(np.int64)
    jy = np.where(outside, np.where(first_x, np.floor(qy + enter * dy), 0), jy).astype(np.int64)
    t = enter.copy()
    missed = (jx < 0) | (jy < 0) | (jx >= columns) | (jy >= rows) | (enter >= limit) | ~np.repeat(seen, cos.shape[0])
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
    out[:] = np.minimum(t, limit).reshape(out.shape)


def cast_edges(
    ax: Floats, ay: Floats, bx: Floats, by: Floats, first_edge: NDArray[np.int64], centre_x: Floats, centre_y: Floats,
    radius: Floats, z_min: Floats, z_max: Floats, owner: NDArray[np.int64],
    x: Floats, y: Floats, z: Floats, yaw: Floats, sensor_owner: NDArray[np.int64], cos: Floats, sin: Floats,
    angle_min: float, increment: float, ranges: Floats, hit: NDArray[np.int64],
) -> None:  # fmt: skip
    """See `zteam.sim.kernels.cast_edges`; here every beam meets every edge that the sensor may see."""
    for scan in range(len(x)):
        c0, s0 = np.cos(yaw[scan]), np.sin(yaw[scan])
        near = np.hypot(centre_x - x[scan], centre_y - y[scan]) - radius <= ranges[scan].max()
        for shape in np.flatnonzero(near & (owner != sensor_owner[scan]) & (z[scan] >= z_min) & (z[scan] <= z_max)):
            edges = slice(first_edge[shape], first_edge[shape + 1])
            u0, u1 = ax[edges] - x[scan], ay[edges] - y[scan]
            e0, e1 = bx[edges] - ax[edges], by[edges] - ay[edges]
            ux, uy, ex, ey = c0 * u0 + s0 * u1, c0 * u1 - s0 * u0, c0 * e0 + s0 * e1, c0 * e1 - s0 * e0
            denominator = np.outer(cos, ey) - np.outer(sin, ex)
            safe = np.where(np.abs(denominator) < 1e-15, np.inf, denominator)
            along = (ux * ey - uy * ex) / safe
            where = (np.outer(sin, ux) - np.outer(cos, uy)) / safe
            valid = np.isfinite(safe) & (along >= 0.0) & (where >= -_EDGE) & (where <= 1.0 + _EDGE)
            nearest = np.where(valid, along, np.inf).min(axis=1)
            shorter = nearest < ranges[scan]
            ranges[scan, shorter] = nearest[shorter]
            hit[scan, shorter] = shape
