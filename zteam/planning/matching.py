"""Poses near given ones at which a scan fits a map best."""

import numpy as np

from zteam.kernels.binding import Beams, Floats, climb
from zteam.planning.likelihood import LikelihoodField

_HALVINGS = 4
"""Times that steps are halved, and ..."""
_MOST_STEPS = 30
"""... how many are made at most."""


def match(field: LikelihoodField, poses: Floats, beams: Beams, step: float, turn: float) -> tuple[Floats, Floats]:
    """The poses (n, 3) near `poses` (base in `map`) at which the beams fit best.

    And the mean of their likelihoods, (n). `step` (m) and `turn` (radians) are the first steps of the search.
    """
    frame = field.frame
    if not len(beams[0]):
        return poses.copy(), np.zeros(len(poses))
    found = field.to_cells(poses)
    sums = climb(field.values, found, beams, step / frame.resolution, turn, _HALVINGS, _MOST_STEPS)
    found[:, :2] = frame.points_from_cells(found[:, :2] - 1.0)
    found[:, 2] += frame.origin.yaw
    return found, sums.astype(np.float64) * (field.unit / len(beams[0]))
