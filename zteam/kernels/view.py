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


def read_ranges(ranges: NDArray[np.float32], least: float, most: float) -> tuple[Floats, float, int]:
    """Distances of the ranges (n) of a scan with these limits, as `zteam.messages.laser` says; the nearest; and how many
    beams say nothing. All in metres."""
    count, nearest = ranges.size, ffi.new("double *")
    distances, made = empty(np.float64, count)
    silent = lib.read_ranges(memory("ranges", ranges, count), count, least, most, made, nearest)
    return distances, nearest[0], silent


class Directions:
    """The beams of a laser: what is the same in all of its scans."""

    def __init__(self, start: float, step: float, count: int) -> None:
        """First angle and increment (rad), and how many beams there are."""
        self.laser = start, step, count
        self.angles: Floats = np.remainder(start + step * np.arange(count) + math.pi, math.tau) - math.pi
        """(n) bearings in [-pi, pi)."""
        self.axes: Floats = np.array((np.cos(self.angles), np.sin(self.angles)))
        """(2, n): their cosines and sines."""
        self._arrays = memory("angles", self.angles, count), memory("axes", self.axes, 2, count)

    def scan(self, distances: Floats, silent: int) -> Any:
        """A scan for C: `distances` (n, m; NaN: the beam says nothing), and how many of them say nothing. This object
        and the distances have to outlive it."""
        start, step, count = self.laser
        seen = memory("distances", distances, count)
        return ffi.new("laser_scan *", (*self._arrays, seen, count, silent, start, step))


def look_along(scan: Any, half_width: float, heading: float) -> float:
    """Metres to the nearest hit in a corridor of 2 * `half_width` (m) from the laser towards `heading` (rad), or inf."""
    return float(lib.look_along(scan, half_width, heading, -math.inf))


def first_clear(scan: Any, half_width: float, reach: float, headings: Floats) -> int:
    """Which of `headings` (n, rad) is the first whose corridor, as of `look_along`, is clear for `reach` (m), or -1."""
    count = len(headings)
    return int(lib.first_clear(scan, half_width, reach, memory("headings", headings, count), count))
