"""The compiled laser kernel for bitmaps: rays leap from empty square to empty square.

Method and figures: docs/benchmarks.md. Rays of one scan start at one point; `cos` and `sin` (tables, beams) are the
beams' directions in the sensor's frame, one row for all scans or one for each. Distances stay metric although a
bitmap's cells may be unequal along x and y: the ray is scaled into cells, its parameter is not.
"""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.sim import numpy_kernels
from zteam.sim.jit import compiled, plainly, vectorized

_LANES = 64
"""Beams that advance together, so that the loops over them become vector code; 32, 96 and 128 were slower."""
_GROUP = 16
"""Lanes that rest together, once all of them have arrived. Loops over 8 do not become vector code."""
_TINY = 1e-9
"""Direction components are kept off zero, so that no division gives inf; 30 m away that is 30 nm."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

# Rows of the table of lanes. All of a lane's state lies in one array: with one base pointer the compiler can prove that
# the lanes do not touch each other, which it gives up on with a dozen arrays.
_OX, _OY = 0, 1 * _LANES
_DX, _DY = 2 * _LANES, 3 * _LANES
_UX, _UY = 4 * _LANES, 5 * _LANES
_IX, _IY = 6 * _LANES, 7 * _LANES
_T, _BASE = 8 * _LANES, 9 * _LANES
_STATES = 10 * _LANES


@vectorized
def _look(lanes: Floats, index: Ints, flat: NDArray[np.uint8], columns: float) -> int:
    """Find the side of the square at every lane: 0 in an occupied cell, and where the lane is parked."""
    for i in range(_LANES):
        index[i] = np.int32(lanes[_BASE + i] + lanes[_IY + i] * columns + lanes[_IX + i])
    moving = 0
    for group in range(_LANES // _GROUP):
        some = 0
        for j in range(_GROUP):
            i = group * _GROUP + j
            # Without a sign: an index that may be negative is compared with 0 first, which costs as much again.
            side_of_cell = flat[np.uint32(index[i])]
            some |= side_of_cell
            index[_LANES + i] = side_of_cell
        index[2 * _LANES + group] = some
        moving |= some
    return moving


@vectorized
def _advance(
    lanes: Floats, index: Ints, flat: NDArray[np.uint8], rows: float, columns: float, park: float, limit: float
) -> None:
    """Leap from empty square to empty square until every lane stands in an occupied cell or is parked.

    `index` has room for every lane's place in `flat`, for the side of the square there, and for each group's sides.
    """
    while True:
        if _look(lanes, index, flat, columns) == 0:
            return
        for group in range(_LANES // _GROUP):
            if index[2 * _LANES + group] == 0:
                continue
            for j in range(_GROUP):
                i = group * _GROUP + j
                side, ix, iy = float(index[_LANES + i]), lanes[_IX + i], lanes[_IY + i]
                ox, oy, dx, dy = lanes[_OX + i], lanes[_OY + i], lanes[_DX + i], lanes[_DY + i]
                edge_x, edge_y = ix + side, iy + side
                tx, ty = (edge_x - ox) * lanes[_UX + i], (edge_y - oy) * lanes[_UY + i]
                by_x = tx <= ty
                t = tx if by_x else ty
                # Where the other coordinate has got to; rounding must not carry it out of the square.
                along_x, along_y = np.floor(ox + t * dx), np.floor(oy + t * dy)
                along_x = along_x if along_x > ix else ix
                along_x = along_x if along_x < edge_x - 1.0 else edge_x - 1.0
                along_y = along_y if along_y > iy else iy
                along_y = along_y if along_y < edge_y - 1.0 else edge_y - 1.0
                next_x = edge_x if by_x else along_x
                next_y = along_y if by_x else edge_y
                gone = (next_x >= columns) | (next_y >= rows) | (t >= limit)
                next_x, next_y, t = park if gone else next_x, 0.0 if gone else next_y, limit if gone else t
                lanes[_IX + i] = next_x if side > 0.0 else ix
                lanes[_IY + i] = next_y if side > 0.0 else iy
                lanes[_T + i] = t if side > 0.0 else lanes[_T + i]


@compiled
def _enter(lanes: Floats, rows: float, columns: float, park: float, limit: float) -> None:
    """Bring lanes that start outside the bitmap to where they enter it; park those that never do."""
    for i in range(_LANES):
        qx, qy, dx, dy = lanes[_OX + i], lanes[_OY + i], lanes[_DX + i], lanes[_DY + i]
        jx, jy = lanes[_IX + i], lanes[_IY + i]
        # On the far outer face itself the cell is the outermost one.
        jx = 0.0 if jx < 0.0 <= qx else jx
        jy = 0.0 if jy < 0.0 <= qy else jy
        tx, ty = -qx / dx, -qy / dy
        t = max(0.0, max(tx, ty))
        if t > 0.0:
            jx, jy = (0.0, math.floor(qy + t * dy)) if tx > ty else (math.floor(qx + t * dx), 0.0)
        if jx < 0.0 or jy < 0.0 or jx >= columns or jy >= rows or t >= limit:
            jx, jy, t = park, 0.0, limit
        lanes[_IX + i], lanes[_IY + i], lanes[_T + i] = jx, jy, t


@plainly(numpy_kernels.cast_squares)
@vectorized
def cast_squares(
    sides: NDArray[np.uint8], rows: int, columns: int, cell_x: float, cell_y: float,
    x: Floats, y: Floats, yaw: Floats, seen: NDArray[np.bool_], cos: Floats, sin: Floats, limit: float, mark: int,
    ranges: Floats, hit: Ints,
) -> None:  # fmt: skip
    """Shorten `ranges` (scans, beams) to the bitmap's occupied cells, and set `hit` to `mark` where it is nearer.

    `x, y, yaw` (scans) are metres from the bitmap's lower left corner. Nothing at or beyond `limit` counts. A scan that
    does not see the bitmap (`seen`) is left alone. A start inside an occupied cell gives 0.
    """
    beams = cos.shape[1]
    wide, high = float(columns), float(rows)
    park, stride = wide * high, float(sides.shape[1])
    flat = sides.reshape(-1)
    # On a cache line's border: a vector that lies across two costs twice, and where numpy puts an array is chance.
    room = np.empty(_STATES + 8)
    skip = -(room.ctypes.data // 8) % 8
    lanes, index = room[skip : skip + _STATES], np.empty(2 * _LANES + _LANES // _GROUP, np.int32)
    # The beams' directions, padded to whole blocks: plain loads, no choice of a beam within the loop.
    padded_cos, padded_sin = np.ones(beams + _LANES), np.zeros(beams + _LANES)
    padded_cos[:beams], padded_sin[:beams] = cos[0], sin[0]
    for scan in range(x.shape[0]):
        if not seen[scan]:
            continue
        if cos.shape[0] > 1:
            padded_cos[:beams], padded_sin[:beams] = cos[scan], sin[scan]
        row_ranges, row_hit = ranges[scan], hit[scan]
        px, py = x[scan] / cell_x, y[scan] / cell_y
        jx, jy = math.floor(px), math.floor(py)
        inside = 0.0 <= px < wide and 0.0 <= py < high
        cx, sx = math.cos(yaw[scan]) / cell_x, math.sin(yaw[scan]) / cell_x
        cy, sy = math.cos(yaw[scan]) / cell_y, math.sin(yaw[scan]) / cell_y
        for first in range(0, beams, _LANES):
            count = min(_LANES, beams - first)
            for i in range(_LANES):
                dx = cx * padded_cos[first + i] - sx * padded_sin[first + i]
                dy = sy * padded_cos[first + i] + cy * padded_sin[first + i]
                left, down = dx < 0.0, dy < 0.0
                # The fields are mirrored by quadrant, so that every ray runs towards larger x and y.
                lanes[_OX + i], lanes[_IX + i] = wide - px if left else px, wide - 1.0 - jx if left else jx
                lanes[_OY + i], lanes[_IY + i] = high - py if down else py, high - 1.0 - jy if down else jy
                lanes[_BASE + i] = (stride if left else 0.0) + (2.0 * stride if down else 0.0)
                dx, dy = abs(dx), abs(dy)
                dx, dy = dx if dx > _TINY else _TINY, dy if dy > _TINY else _TINY
                lanes[_DX + i], lanes[_DY + i], lanes[_UX + i], lanes[_UY + i] = dx, dy, 1.0 / dx, 1.0 / dy
                lanes[_T + i] = 0.0
            for i in range(count, _LANES):
                lanes[_IX + i], lanes[_IY + i] = park, 0.0
            if not inside:
                _enter(lanes, high, wide, park, limit)
            _advance(lanes, index, flat, high, wide, park, limit)
            for i in range(count):
                nearer = lanes[_T + i] < row_ranges[first + i]
                row_ranges[first + i] = lanes[_T + i] if nearer else row_ranges[first + i]
                row_hit[first + i] = mark if nearer else row_hit[first + i]
