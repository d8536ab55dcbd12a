"""A scan by bearings, in few sectors: what lies behind what a laser met, and what it saw."""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.behaviors.scans import Beams

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

SEEN_WITHIN = 0.05
"""Metres that a point may seem to lie behind what a beam met and still be the same."""
_GROUP = math.radians(1.0)
"""Radians: beams are kept in groups of this width, as the nearest of them."""
_FINEST = 1e-9
"""Radians: finer sectors are no laser's, and their places too large for a number."""


class Sectors(NamedTuple):
    """Distances by bearing, in equal sectors."""

    start: float
    step: float
    """Radians, not 0; below 0 for a laser that turns clockwise."""
    distances: Floats
    """NaN where nothing is known; (n,), or a row for each of several scans."""

    def look(self, x: Floats, y: Floats) -> Floats:
        """How far the laser saw towards points of its own frame: metres, NaN where it looked not or saw nothing."""
        places = np.remainder((np.arctan2(y, x) - self.start) * math.copysign(1.0, self.step), math.tau)
        index = (places / max(abs(self.step), _FINEST) + 0.5).astype(np.intp)
        count = self.distances.shape[-1]
        at = np.minimum(index, count - 1)
        if self.distances.ndim > 1:
            at += np.arange(0, self.distances.size, count)[:, None]
        return np.where(index < count, self.distances.take(at), np.nan)

    def is_like(self, other: "Sectors") -> bool:
        """Whether the other has the same bearings."""
        return (self.start, self.step, self.distances.size) == (other.start, other.step, other.distances.size)


def group(beams: Beams, distances: Floats) -> Sectors:
    """The sectors of a scan."""
    start, step, count = beams.laser
    size = max(1, int(min(count, _GROUP / abs(step) + 1e-6))) if step else 1
    if size == 1:
        return Sectors(start, step or math.tau, distances)
    groups = -(-count // size)
    nearest = np.full(groups, np.nan)
    for i in range(size):
        part = distances[i::size]
        # The smaller of two numbers; of a number and a NaN the number.
        np.fmin(nearest[: part.size], part, out=nearest[: part.size])
    return Sectors(start + 0.5 * (size - 1) * step, size * step, nearest)


@lru_cache(maxsize=64)
def axes_of(start: float, step: float, count: int) -> Floats:
    """(2, n): cosines and sines of the bearings of sectors."""
    angles = start + step * np.arange(count)
    return np.array((np.cos(angles), np.sin(angles)))


def is_told(sectors: Sectors, points: Floats) -> Flags:
    """Which points of the laser's frame a scan tells of: it saw them, or through them."""
    told: Flags = sectors.look(points[0], points[1]) >= np.hypot(points[0], points[1]) - SEEN_WITHIN
    return told
