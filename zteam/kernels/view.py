"""The kernels by which a robot's view is read (view.c). As `binding.py` says."""

import math
from typing import Any

import numpy as np

from zteam.kernels.binding import Floats, empty, ffi, lib, memory


def see_poses(poses: Floats, own: int) -> list[tuple[float, float, float]]:
    """Poses (n, 3; m, m, rad) of one frame in the frame at one of them."""
    count = len(poses)
    if not 0 <= own < count:
        raise ValueError(f"own: {own} is no row of {count}")
    seen, made = empty(np.float64, count, 3)
    lib.see_poses(memory("poses", poses, count, 3), count, own, made)
    return seen.tolist()


def read_ranges(distances: Floats, least: float, most: float) -> tuple[float, int]:
    """Make distances of the ranges (n) of a scan with these limits, in place; the nearest (m), and how many beams say
    nothing. `zteam.messages.laser` has the rule."""
    nearest, count = ffi.new("double *"), distances.size
    silent = lib.read_ranges(memory("ranges", distances, count, out=True), count, least, most, nearest)
    return nearest[0], silent


def look_along(axes: Floats, distances: Floats, half_width: float, heading: float) -> float:
    """Metres to the nearest hit in a corridor of 2 * `half_width` (m) from the laser towards `heading` (rad), else inf.

    The scan: directions `axes` (2, m: cosines and sines) and `distances` (m; NaN: it says nothing) of beams.
    """
    return float(lib.look_along(*_scan(axes, distances), half_width, heading, -math.inf))


def first_clear(axes: Floats, distances: Floats, half_width: float, reach: float, headings: Floats) -> int:
    """Which of `headings` (n, rad) is the first whose corridor, as of `look_along`, is clear for `reach` (m), or -1."""
    count = len(headings)
    given = *_scan(axes, distances), half_width, reach, memory("headings", headings, count), count
    return int(lib.first_clear(*given))


def _scan(axes: Floats, distances: Floats) -> tuple[Any, Any, int]:
    beams = distances.size
    return memory("axes", axes, 2, beams), memory("distances", distances, beams), beams
