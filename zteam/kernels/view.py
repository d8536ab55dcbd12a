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


def scan_of(angles: Floats, axes: Floats, distances: Floats, start: float, step: float, silent: int) -> Any:
    """A scan for C: bearings (n, rad), their cosines and sines (2, n), and distances (n, m; NaN: it says nothing), all of
    which have to outlive it; first angle and increment (rad); how many beams say nothing."""
    beams = distances.size
    arrays = memory("angles", angles, beams), memory("axes", axes, 2, beams), memory("distances", distances, beams)
    return ffi.new("laser_scan *", (*arrays, beams, silent, start, step))


def look_along(scan: Any, half_width: float, heading: float) -> float:
    """Metres to the nearest hit in a corridor of 2 * `half_width` (m) from the laser towards `heading` (rad), else inf."""
    return float(lib.look_along(scan, half_width, heading, -math.inf))


def first_clear(scan: Any, half_width: float, reach: float, headings: Floats) -> int:
    """Which of `headings` (n, rad) is the first whose corridor, as of `look_along`, is clear for `reach` (m), or -1."""
    count = len(headings)
    return int(lib.first_clear(scan, half_width, reach, memory("headings", headings, count), count))
