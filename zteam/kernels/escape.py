"""The kernel by which a robot gets free (escape.c). As `binding.py` says."""

import numpy as np
from numpy.typing import ArrayLike

from zteam.kernels.binding import Floats, check_within, empty, ffi, lib, memory


def find_moves(
    planes: Floats, radius: float, points: ArrayLike, hits: int, way: ArrayLike, shunned: ArrayLike, failed: ArrayLike,
    headings: Floats, cell: float, leaves: tuple[float, float, float],
) -> Floats:  # fmt: skip
    """The moves (n, 4) of a base out of a narrow place: the kind of each, and x, y and yaw of where it ends.

    They lead along `way`. If it has no points, they lead away: `leaves` are the metres from the base if there is room,
    at least, and from places `shunned`. Of `points` the first `hits` are on what stands around, the others on
    teammates. kernels.h has the shapes. Raises ValueError, and MemoryError if `radius` (m) is more than 10 000 cells.
    """
    places = cell * np.arange(-42, 43)
    given = [memory("headings", headings, 16, 5), memory("away", np.hypot(places, places[:, None]), 85, 85)]
    check_within("headings", headings[:, :2], -2, 3)
    for rows, width in ((planes, 3), (points, 2), (way, 2), (shunned, 2), (failed, 4)):
        array = np.array(rows, float, order="C").reshape(-1, width)
        given += memory("rows", array, *array.shape), len(array)
    moves, made = empty(np.float64, 200, 4)
    count = lib.find_moves(ffi.new("surroundings *", (*given, hits, radius, cell, *leaves)), made)
    if count < 0:
        raise MemoryError(f"no room for a search with cells of {cell} m and a base of {radius} m")
    return moves[len(moves) - count :]
