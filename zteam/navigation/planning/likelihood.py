"""How well scans fit a map: the likelihood field of a map, the poses nearby where a scan fits best, and those anywhere.

The field is that of Thrun, Burgard, Fox 2005, section 6.4, as amcl uses it.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.config.map_files import OCCUPIED
from zteam.geometry import Pose2
from zteam.kernels.binding import Floats
from zteam.kernels.navigation import MAX_CELLS, BeamEnds, climb, square_distances, sum_poses
from zteam.navigation.planning.costmap import FREE_SPACE, LETHAL_OBSTACLE
from zteam.navigation.planning.grid import GridMap

UNITS = 65_535
"""A field's largest value. Whole numbers add to the same sum in any order."""
_HALVINGS = 4
"""Times that steps are halved."""
_MOST_STEPS = 30
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


class LikelihoodField(NamedTuple):
    """What a beam that ends in a cell adds to the weight of a pose."""

    place: tuple[float, float, float, float]
    """x, y (metres) and yaw of the map's lower left corner in `map`, and metres a cell."""
    values: NDArray[np.uint16]
    """(rows + 2, columns + 2): (z_hit · exp(−d² / 2σ²) + z_rand / range_max)³ in units of `unit`, d to the nearest
    occupied cell; around the map a border with the value of the largest distance."""
    unit: float


def make_likelihood_field(
    grid: GridMap, *, z_hit: float, z_rand: float, sigma_hit: float, max_dist: float, range_max: float
) -> LikelihoodField:
    """The field of a map. `max_dist` (m): no distance counts as more than this (`laser_likelihood_max_dist`)."""
    frame = grid.frame
    reach = min(MAX_CELLS - 1, math.ceil(max_dist / frame.resolution))
    costs = np.where(grid.cells >= OCCUPIED, LETHAL_OBSTACLE, FREE_SPACE).astype(np.uint8)
    squares = np.full((frame.rows + 2, frame.columns + 2), (reach + 1) ** 2, np.uint16)
    squares[1:-1, 1:-1] = square_distances(costs, (0, frame.rows, 0, frame.columns), reach)
    distances = np.minimum(np.sqrt(np.arange((reach + 1) ** 2 + 1)) * frame.resolution, max_dist)
    values = (z_hit * np.exp(-(distances**2) / (2.0 * sigma_hit**2)) + z_rand / range_max) ** 3
    unit = float(values.max()) / UNITS or 1.0
    place = *frame.origin, frame.resolution
    return LikelihoodField(place, np.rint(values / unit).astype(np.uint16)[squares], unit)


def beams_of(field: LikelihoodField, ends: Floats) -> BeamEnds:
    """The ends of beams (n, 2; metres in the base frame) in cells of a field: (2, n)."""
    return np.ascontiguousarray(ends.T / field.place[3], np.float32)


def weigh_poses(field: LikelihoodField, poses: Floats, beams: BeamEnds, weights: Floats) -> None:
    """Multiply the weight of each pose (n, 3; base in `map`) by 1 plus the sum of likelihoods where the beams end."""
    weights *= 1.0 + sum_poses(field.values, field.place, poses, beams) * field.unit


def match(field: LikelihoodField, poses: Floats, beams: BeamEnds, step: float, turn: float) -> tuple[Floats, Floats]:
    """The poses (n, 3) near `poses` where the beams fit best, and how well (n); first steps in m and radians."""
    found = poses.copy()
    if not beams.shape[1]:
        return found, np.zeros(len(poses))
    sums = climb(field.values, field.place, found, beams, (step, turn), _HALVINGS, _MOST_STEPS)
    return found, sums * (field.unit / beams.shape[1])


class GlobalSearch:
    """Where on a whole map a scan fits: poses all over it, the best of them moved to where they fit best.

    One scan rarely decides: the best poses are carried along as the robot moves, and new ones are tried with each scan.
    Call `try_poses` with each scan until it finds the place.
    """

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
        beams = beams_of(wide, ends)
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
