"""The kernels by which a robot's view is read (view.c). As `binding.py` says."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.binding import Floats, empty, ffi, lib, memory


def see_poses(poses: Any, own: int) -> list[float]:
    """Poses (n rows of four doubles of C: m, m, rad, and a time) of one frame in the frame at one of them: n times x, y
    (m) and yaw (rad)."""
    count = len(poses) // 4
    if not 0 <= own < count:
        raise ValueError(f"own: {own} is no row of {count}")
    seen = ffi.new("double[]", 3 * count)
    lib.see_poses(poses, count, own, seen)
    return list(seen)


def read_ranges(
    ranges: NDArray[np.float32], least: float, most: float, closest: float = 0.0
) -> tuple[Floats, float, int, Any]:
    """Distances of the ranges (n) of a scan with these limits, as `zteam.messages.laser` says, and the nearest; how
    many beams say nothing; and the distances for C. A hit that is too close to measure is at `closest`. In metres."""
    count, nearest = ranges.size, ffi.new("double *")
    distances, made = empty(np.float64, count)
    silent = lib.read_ranges(memory("ranges", ranges, count), count, least, most, closest, made, nearest)
    return distances, nearest[0], silent, made


class Directions:
    """The beams of a laser: what is the same in all of its scans."""

    def __init__(self, start: float, step: float, count: int) -> None:
        """First angle and increment (rad), and how many beams there are."""
        self._laser = start, step
        self.angles: Floats = np.remainder(start + step * np.arange(count) + math.pi, math.tau) - math.pi
        """(n) bearings in [-pi, pi)."""
        self.axes: Floats = np.array((np.cos(self.angles), np.sin(self.angles)))
        """(2, n): their cosines and sines."""
        self._arrays = memory("angles", self.angles, count), memory("axes", self.axes, 2, count)

    def read(self, ranges: NDArray[np.float32], least: float, most: float, closest: float) -> tuple[Floats, float, Any]:
        """The distances of a scan's `ranges` (n), and the nearest, as of `read_ranges`; and the scan for C, which this
        object and the distances have to outlive."""
        distances, nearest, silent, made = read_ranges(ranges, least, most, closest)
        return distances, nearest, ffi.new("laser_scan *", (*self._arrays, made, distances.size, silent, *self._laser))


def look_along(scan: Any, half_width: float, heading: float) -> float:
    """Metres to the nearest hit in a corridor of 2 * `half_width` (m) towards `heading` (rad), or inf."""
    return float(lib.look_along(scan, half_width, heading, -math.inf))


def first_clear(scan: Any, half_width: float, reach: float, headings: Floats) -> int:
    """Which of `headings` (n, rad) is the first whose corridor, as of `look_along`, is clear for `reach` (m), or -1."""
    count = len(headings)
    return int(lib.first_clear(scan, half_width, reach, memory("headings", headings, count), count))
