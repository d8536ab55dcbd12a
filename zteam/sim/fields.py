"""A bitmap prepared for exact ray casting: the largest empty square at every cell, for each quadrant of directions.

A ray that stands in a cell may leap to the edge of the empty square that opens into the ray's quadrant; nothing can
be hit before. The fields are stored mirrored, so that every ray runs towards larger columns and rows.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.sim.jit import compiled, plainly

_CAP = 254
"""Sides are bytes; a larger square is left in several leaps."""


class Fields(NamedTuple):
    """`sides[q]` is the flattened field of quadrant q = (dx < 0) + 2 (dy < 0); its last entry is a parking place."""

    sides: NDArray[np.uint8]
    rows: int
    columns: int


def _fill_squares_numpy(free: NDArray[np.bool_], out: NDArray[np.uint8]) -> None:
    """The same without numba: anti-diagonals are independent, so each is one vector operation."""
    rows, columns = free.shape
    sides = np.full((rows + 1, columns + 1), _CAP, np.int16)
    for diagonal in range(rows + columns - 2, -1, -1):
        y = np.arange(max(0, diagonal - columns + 1), min(rows, diagonal + 1))
        x = diagonal - y
        side = np.minimum(np.minimum(sides[y, x + 1], sides[y + 1, x]), sides[y + 1, x + 1]) + 1
        sides[y, x] = np.where(free[y, x], np.minimum(side, _CAP), 0)
    out[:] = sides[:rows, :columns].ravel().astype(np.uint8)


@plainly(_fill_squares_numpy)
@compiled
def _fill_squares(free: NDArray[np.bool_], out: NDArray[np.uint8]) -> None:
    # One pass from the far corner: a square is one larger than the smallest of its three neighbours'. Beyond the
    # bitmap all is free.
    rows, columns = free.shape
    for y in range(rows - 1, -1, -1):
        for x in range(columns - 1, -1, -1):
            side = 0
            if free[y, x]:
                side = 254
                if x + 1 < columns:
                    side = min(side, out[y * columns + x + 1] + 1)
                if y + 1 < rows:
                    side = min(side, out[(y + 1) * columns + x] + 1)
                if x + 1 < columns and y + 1 < rows:
                    side = min(side, out[(y + 1) * columns + x + 1] + 1)
            out[y * columns + x] = side


def build_fields(occupied: NDArray[np.bool_]) -> Fields:
    """Fields of a bitmap (rows, columns), row 0 at the bottom."""
    rows, columns = occupied.shape
    sides = np.zeros((4, rows * columns + 1), np.uint8)
    for quadrant in range(4):
        view = occupied[:, ::-1] if quadrant & 1 else occupied
        view = view[::-1] if quadrant & 2 else view
        _fill_squares(np.ascontiguousarray(~view), sides[quadrant, :-1])
    return Fields(sides, rows, columns)
