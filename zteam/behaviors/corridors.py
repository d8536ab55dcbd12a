"""Whether a hit stands in a corridor, from the beams' lengths alone: for speed, and undecided where rounding decides.

A beam leaves a corridor at its end or at its side, at a distance that depends only on the angle between the two. These
distances are computed once for a laser, for whole numbers of beams. So the angle is known to one beam, and there are
two such distances: one within which a hit certainly stands in the corridor, one beyond which it certainly does not.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Laser = tuple[float, float, int]
"""First angle, increment and number of beams."""

_CERTAIN = 1e-9
"""More than rounding makes of a difference: radians, and relative."""
_RIGHT_ANGLE = 0.5 * math.pi
_EXACT = 100.0
"""Radians: larger angles are not exact enough."""
_FINEST = 1e-4
"""Radians: the distances are not computed for a laser of a smaller increment."""
_FEW = 24
"""Beams, at most: so many, evenly spread, show most of what is blocked."""
_TRUE = np.True_.tobytes()


class _Exits(NamedTuple):
    """Where beams leave a corridor of a laser: at its end, as a multiple of its length; at its side, in metres.

    By the number of the beam less the number of the beam nearest to the heading. 0 where a beam does not enter it.
    """

    origin: int
    """The index of the beam nearest to the heading."""
    least_end: Floats
    least_side: Floats
    most_end: Floats
    most_side: Floats


@lru_cache(maxsize=64)
def _exits(step: float, count: int, half_width: float) -> _Exits:
    origin = 2 * math.ceil(math.tau / step) + 1
    angles = np.abs(np.remainder(step * np.arange(-origin, count + 1) + math.pi, math.tau) - math.pi)
    off = step + _CERTAIN
    near, far = np.maximum(angles - off, 0.0), angles + off
    with np.errstate(divide="ignore"):
        least_end = np.where(far < _RIGHT_ANGLE, 1.0 / np.cos(near), 0.0)
        least_side = np.where(far < _RIGHT_ANGLE, half_width / np.sin(far), 0.0)
        most_end = np.where(far < _RIGHT_ANGLE, 1.0 / np.cos(far), np.inf)
        most_side = np.where(near < _RIGHT_ANGLE, half_width / np.sin(near), 0.0)
    less, more = 1.0 - _CERTAIN, 1.0 + _CERTAIN
    return _Exits(origin, least_end * less, least_side * less, most_end * more, most_side * more)


class Corridor:
    """A corridor of one laser: straight from it towards any heading.

    Where distances are taken they are those of the laser's beams, NaN or inf without a hit.
    """

    def __init__(self, laser: Laser, half_width: float, reach: float) -> None:
        self.half_width, self.reach = half_width, reach
        start, increment, self._count = laser
        step = abs(increment)
        self._usable = step >= _FINEST and step * self._count + abs(start) < _EXACT
        if not self._usable:
            return
        exits = _exits(step, self._count, half_width)
        self._turn, self._origin = math.tau / step, exits.origin
        self._scale, self._shift = 1.0 / increment, 0.5 - start / increment
        self._least = np.minimum(exits.least_end * reach, exits.least_side)
        """By index as in _Exits: a nearer hit certainly stands in the corridor."""
        self._most = np.minimum(exits.most_end * reach, exits.most_side)
        """A hit that is not nearer certainly does not."""
        self._straight = float(self._least[self._origin])
        self._stride = -(-self._count // _FEW)
        self._few = -(-self._count // self._stride)

    def is_blocked(self, distances: Floats, heading: float) -> bool | None:
        """Whether a hit stands in the corridor towards `heading` (rad); None if that is not certain."""
        if not self._usable:
            return None
        place = self._place(heading)
        if place < self._count and distances[place] < self._straight:
            return True
        first = self._origin - place
        beams = slice(first, first + self._count)
        # To look for a byte is faster than any reduction.
        if _TRUE not in (distances < self._most[beams]).tobytes():
            return False
        return True if _TRUE in (distances < self._least[beams]).tobytes() else None

    def are_blocked(self, distances: Floats, heading: float, turns: tuple[float, ...]) -> list[int]:
        """For each turn (rad) from `heading`: not 0 if a hit of one of a few beams certainly stands in the corridor."""
        if not self._usable:
            return [0] * len(turns)
        beams, pairs = _pairs(self._scale, self._turn, self._count, self._stride, turns)
        least = self._least[self._origin - self._place(heading) - math.ceil(self._turn) :].take(pairs)
        blocked = (distances.take(beams) < least).reshape(len(turns), self._few)
        # `argmax` is the fastest reduction. Without the first beam it is 0 where no hit is in the way.
        blocked[:, 0] = False
        found: list[int] = blocked.argmax(axis=1).tolist()
        return found

    def _place(self, heading: float) -> int:
        """The number of the beam nearest to `heading`, which may be beyond the last."""
        return int((heading * self._scale + self._shift) % self._turn)


class _Pairs(NamedTuple):
    """Each of the turns with each of the few beams, turn by turn. One long row: numpy has a cost for each row."""

    beams: NDArray[np.intp]
    numbers: NDArray[np.intp]
    """The beam's number less that of the beam nearest to the turned heading.

    For a heading whose own beam has the number 0; and a whole turn is added, so that none is negative.
    """


@lru_cache(maxsize=64)
def _pairs(scale: float, turn: float, count: int, stride: int, turns: tuple[float, ...]) -> _Pairs:
    places = np.rint(np.array(turns) * scale % turn).astype(np.intp)
    beams = np.arange(0, count, stride)
    numbers = math.ceil(turn) + beams - places[:, None]
    return _Pairs(np.tile(beams, len(turns)), numbers.ravel())


find_corridor = lru_cache(maxsize=64)(Corridor)
"""A `Corridor` for these arguments: the same for all scans of a laser."""
