"""The beam that a stopped robot looks at first.

A robot that stands before something is stopped in each step by what stopped it in the step before. Where the beam that
met this still says so alone, no other beam has to be looked at. All is computed from the newest scan: what is kept is
only which beam comes first, so that the decision is the same as without.
"""

import math
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from zteam.base import Point2
from zteam.behaviors.meeting_kernels import TOUCH
from zteam.behaviors.safety.surroundings import Sight
from zteam.behaviors.safety.swept import STRAIGHT, Arc, Outline, margin_of

Floats = NDArray[np.float64]
_Number = TypeVar("_Number", float, Floats)

_SURE = 1e-6
"""Metres: where the base is so much nearer to a point than it may come, rounding decides nothing."""


class Way(NamedTuple):
    """An arc that is looked at, and how much of it has to be free for the robot to move at all."""

    outline: Outline
    arc: Arc
    seconds: float
    """How much of the arc is looked at."""
    due: float
    """Seconds, less than `seconds`: the robot is stopped if it meets something before."""

    def seen_then(self, x: _Number, y: _Number) -> tuple[_Number, _Number]:
        """A point of the base frame, seen from the base where it is when `due` has passed."""
        speed, turn = self.arc
        if abs(turn * self.seconds) < STRAIGHT:
            return x - speed * self.due, y
        radius, cos, sin = speed / turn, math.cos(turn * self.due), math.sin(turn * self.due)
        x, y = x - radius * sin, y - radius * (1.0 - cos)
        return cos * x + sin * y, cos * y - sin * x

    def surely_meets(self, x: float, y: float) -> bool:
        """Whether `meeting_time` with this point is certainly before `due`: the base is too near to it by then.

        False says nothing.
        """
        # Never more than the limit of `meeting_time`.
        limit = min(margin_of(self.outline, self.arc), self.outline.distance(x, y) - TOUCH)
        return self.outline.distance(*self.seen_then(x, y)) < limit - _SURE

    def nearest(self, points: Floats) -> Point2:
        """The point of (2, n) that the base comes too near to by the most."""
        limits = np.minimum(margin_of(self.outline, self.arc), self.outline.distances(points) - TOUCH)
        then = np.array(self.seen_then(points[0], points[1]))
        most = (self.outline.distances(then) - limits).argmin()
        return points.item(0, most), points.item(1, most)


class Stoppers:
    """Which beam of one robot met what the robot was stopped before."""

    def __init__(self) -> None:
        self._beams = {True: -1, False: -1}
        """One for driving, one for turning on the spot; -1 for none."""

    def stop(self, way: Way, sight: Sight | None) -> bool:
        """Whether the beam says that the robot meets something before `way.due`; False says nothing."""
        drives = way.arc.speed != 0.0
        beam = self._beams[drives]
        if beam < 0:
            return False
        hit = sight.hit(beam) if sight is not None else None
        if hit is not None and way.surely_meets(*hit):
            return True
        self._beams[drives] = -1
        return False

    def note(self, way: Way, sight: Sight | None, points: Floats) -> None:
        """The robot was stopped before one of these points (2, n) of the base frame."""
        point = way.nearest(points)
        if sight is not None and way.surely_meets(*point):
            self._beams[way.arc.speed != 0.0] = sight.beam_towards(*point)
