"""A scan by bearings, in few sectors: what lies behind what a laser met, and what it saw."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.behaviors.memory_kernels import look, select_untold
from zteam.behaviors.scan_kernels import find_nearest
from zteam.behaviors.scans import Beams
from zteam.geometry import Pose2

Floats = NDArray[np.float64]

_GROUP = math.radians(1.0)
"""Radians: beams are kept in groups of this width, as the nearest of them."""


class Sectors(NamedTuple):
    """Distances by bearing, in equal sectors."""

    start: float
    step: float
    """Radians, not 0; below 0 for a laser that turns clockwise."""
    distances: Floats
    """NaN where nothing is known; (n,), or a row for each of several scans."""

    def look(self, x: Floats, y: Floats) -> Floats:
        """How far the laser saw towards points of its own frame: metres, NaN where it looked not or saw nothing."""
        return look(self.start, self.step, self.distances, x, y)

    def is_like(self, other: "Sectors") -> bool:
        """Whether the other has the same bearings."""
        return (self.start, self.step, self.distances.size) == (other.start, other.step, other.distances.size)


def group(beams: Beams, distances: Floats) -> Sectors:
    """The sectors of a scan."""
    start, step, count = beams.laser
    size = max(1, int(min(count, _GROUP / abs(step) + 1e-6))) if step else 1
    if size == 1:
        return Sectors(start, step or math.tau, distances)
    nearest = np.empty(-(-count // size))
    find_nearest(distances, size, nearest)
    return Sectors(start + 0.5 * (size - 1) * step, size * step, nearest)


@lru_cache(maxsize=64)
def axes_of(start: float, step: float, count: int) -> Floats:
    """(2, n): cosines and sines of the bearings of sectors."""
    angles = start + step * np.arange(count)
    return np.array((np.cos(angles), np.sin(angles)))


def untold(sectors: Sectors, laser: Pose2, points: Floats) -> Floats:
    """The points (2, n) that a scan of a laser at the pose `laser` does not tell of: it did not see them, nor through
    them."""
    found = np.empty(points.shape)
    frame = laser.x, laser.y, math.cos(laser.yaw), math.sin(laser.yaw)
    count = select_untold(points, *frame, *sectors, found)
    return found[:, :count]
