"""Where on a whole map a scan fits: poses all over the map, the best of them moved to where they fit best.

One scan rarely decides: the best poses are carried along as the robot moves, and new ones are tried with every scan.
"""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.planning.grid import GridMap
from zteam.planning.likelihood import beams_of, make_likelihood_field, weigh_poses
from zteam.planning.matching import match

Floats = NDArray[np.float64]

_WIDE, _NARROW = 0.4, 0.1
"""Metres: deviations of the two fields. The wide one leads to the place, the narrow one says how well it fits."""
_STEPS = ((0.4, 0.1), (0.1, 0.05))
"""First steps in each: metres, radians."""
_CLIMBING = 0.02
"""Share of the poses that are tried that climb."""
_KEPT = 200
"""Poses that are carried along."""
_SURE = 0.8
"""Mean likelihood of a scan's beams from which on a pose fits."""
_AHEAD = 0.85
"""Share of it that no other place may have."""
_SAME = 1.0, 0.35
"""Metres and radians up to which two poses are the same place."""
_SEEN = 3
"""Scans for which one place must be the best, by far, in a row."""
_PATIENCE = 300
"""Scans after which the best place must do."""


class GlobalSearch:
    """The places at which a robot may be. Call `try_poses` with each scan until it finds one."""

    def __init__(self, grid: GridMap, range_max: float) -> None:
        self._fields = [
            # The field's cube makes the deviation smaller by √3.
            make_likelihood_field(
                grid, z_hit=1.0, z_rand=0.0, sigma_hit=math.sqrt(3.0) * sigma, max_dist=2.0, range_max=range_max
            )
            for sigma in (_WIDE, _NARROW)
        ]
        self.poses: Floats = np.empty((0, 3))
        """The places (n, 3), the best one first."""
        self.fits: Floats = np.empty(0)
        """How well the last scan fits there: mean likelihood of its beams, up to 1."""
        self._in_a_row = self._scans = 0

    def move(self, before: Pose2, after: Pose2) -> None:
        """The robot has moved so in its odometry."""
        step = before.inverse().compose(after)
        cos, sin = np.cos(self.poses[:, 2]), np.sin(self.poses[:, 2])
        self.poses[:, 0] += cos * step.x - sin * step.y
        self.poses[:, 1] += sin * step.x + cos * step.y
        self.poses[:, 2] += step.yaw

    def try_poses(self, poses: Floats, ends: Floats) -> bool:
        """Look for the beams' `ends` (m, 2; base frame) at these poses (n, 3) too; whether the place is found."""
        wide, narrow = self._fields
        if not len(ends):
            return False
        weights = np.ones(len(poses))
        beams = beams_of(wide.frame, ends)
        weigh_poses(wide, poses, beams, weights)
        best = np.argsort(-weights, kind="stable")[: max(1, int(_CLIMBING * len(poses)))]
        found, _ = match(wide, poses[best], beams, *_STEPS[0])
        found, fits = match(narrow, np.concatenate((self.poses, found)), beams, *_STEPS[1])
        order = np.argsort(-fits, kind="stable")
        self.poses, self.fits = _distinct(found[order], fits[order])
        alone = len(self.fits) == 1 or self.fits[1] < _AHEAD * self.fits[0]
        self._in_a_row = self._in_a_row + 1 if self.fits[0] >= _SURE and alone else 0
        self._scans += 1
        return self._in_a_row >= _SEEN or self._scans >= _PATIENCE


def _distinct(poses: Floats, fits: Floats) -> tuple[Floats, Floats]:
    """The first _KEPT poses that are not the same place as one before them."""
    chosen: list[int] = []
    for i in range(len(poses)):
        delta = poses[chosen] - poses[i]
        turn = np.abs(np.arctan2(np.sin(delta[:, 2]), np.cos(delta[:, 2])))
        if not ((np.hypot(delta[:, 0], delta[:, 1]) < _SAME[0]) & (turn < _SAME[1])).any():
            chosen.append(i)
            if len(chosen) == _KEPT:
                break
    return poses[chosen], fits[chosen]
