"""Beams that say nothing: for a moment their last word counts, then the ground that they would see is not seen."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.behaviors.scans import Beams
from zteam.clock import to_ns

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

STALE_AFTER = 0.5
"""Seconds after which a scan, the word of a beam, or the robot's own pose, is too old to move on."""
BRIDGE = math.radians(0.5)
"""Radians: beams that say nothing between two that do, and together are no wider than this (or one beam), are bridged.
Ten centimetres ahead of the front of an erratic that is less than two millimetres."""


class LastWords:
    """What each beam of a laser said last."""

    def __init__(self) -> None:
        self._whole: Beams | None = None
        """The newest scan in which every beam spoke, if that was the one before."""
        self._whole_at = 0
        self._distances: Floats | None = None
        self._spoke_at: NDArray[np.int64] | None = None

    def fill(self, beams: Beams, now: int) -> tuple[Floats, Flags | None]:
        """The distances of a scan of time `now` (ns), with fresh last words; and which beams see nothing (None: none).

        A distance is NaN where nothing is known, inf where nothing was met.
        """
        if beams.all_speak:
            self._whole, self._whole_at = beams, now
            return beams.distances, None
        silent = np.isnan(beams.distances)
        if not silent.any():
            self._whole, self._whole_at = beams, now
            return beams.distances, None
        distances, spoke_at = self._words(beams, now)
        speaks = ~silent
        np.copyto(distances, beams.distances, where=speaks)
        np.copyto(spoke_at, now, where=speaks)
        silent &= spoke_at < now - to_ns(STALE_AFTER)
        filled = np.where(silent, np.nan, distances)
        return filled, _without_gaps(silent, beams.laser[1])

    def _words(self, beams: Beams, now: int) -> tuple[Floats, NDArray[np.int64]]:
        """The kept words of the same laser, to be changed."""
        whole, self._whole = self._whole, None
        if whole is not None and whole.laser == beams.laser:
            self._distances = whole.distances.copy()
            self._spoke_at = np.full(whole.distances.size, self._whole_at)
        if self._distances is None or self._spoke_at is None or self._distances.size != beams.distances.size:
            self._distances = np.full(beams.distances.size, np.nan)
            self._spoke_at = np.full(beams.distances.size, -(1 << 62))
        return self._distances, self._spoke_at


def _without_gaps(silent: Flags, increment: float) -> Flags | None:
    """`silent` without the runs that are bridged; None if nothing is left."""
    if not silent.any():
        return None
    longest = max(1, int(BRIDGE / abs(increment) + 1e-9)) if increment else 1
    edges = ((silent[1:] != silent[:-1]).nonzero()[0] + 1).tolist()
    # The first and the last beam have a neighbour on one side alone.
    edges = edges[1:] if silent[0] else edges
    for first, end in zip(edges[::2], edges[1::2], strict=False):
        if end - first <= longest:
            silent[first:end] = False
    return silent if silent.any() else None
