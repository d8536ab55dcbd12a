"""Beams that say nothing: for a moment their last word counts, then the ground that they would see is not seen."""

import math
from typing import NamedTuple

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


class _Answer(NamedTuple):
    """What was made of a scan."""

    beams: Beams
    distances: Floats
    silent: Flags | None


class LastWords:
    """What each beam of a laser said last."""

    def __init__(self) -> None:
        self._whole: Beams | None = None
        """The newest scan in which every beam spoke, if that was the one before."""
        self._whole_at = 0
        self._distances: Floats | None = None
        self._spoke_at: NDArray[np.int64] | None = None
        self._settled: _Answer | None = None
        """Of the newest scan, if the last words of all beams that say nothing are too old: while the scan stays the
        same, so does this."""
        self._settled_at = 0
        """When that scan was seen last (ns)."""

    def fill(self, beams: Beams, now: int) -> tuple[Floats, Flags | None]:
        """The distances of a scan of time `now` (ns), with fresh last words; and which beams see nothing (None: none).

        A distance is NaN where nothing is known, inf where nothing was met.
        """
        settled = self._settled
        if settled is not None and settled.beams is beams:
            self._settled_at = now
            return settled.distances, settled.silent
        silent = None if beams.all_speak else np.isnan(beams.distances)
        if silent is None or not silent.any():
            self._whole, self._whole_at, self._settled = beams, now, None
            return beams.distances, None
        distances, spoke_at = self._words(beams)
        speaks = ~silent
        np.copyto(distances, beams.distances, where=speaks)
        np.copyto(spoke_at, now, where=speaks)
        old = silent & (spoke_at < now - to_ns(STALE_AFTER))
        is_settled = np.array_equal(old, silent)
        filled = np.where(old, np.nan, distances)
        answer = _Answer(beams, filled, _without_gaps(old, beams.laser[1]))
        self._settled, self._settled_at = (answer if is_settled else None), now
        return answer.distances, answer.silent

    def _words(self, beams: Beams) -> tuple[Floats, NDArray[np.int64]]:
        """The kept words of the same laser, to be changed."""
        if self._settled is not None and self._spoke_at is not None:
            np.copyto(self._spoke_at, self._settled_at, where=~np.isnan(self._settled.beams.distances))
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
