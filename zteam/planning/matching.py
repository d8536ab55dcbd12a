"""Poses near given ones at which a scan fits a map best."""

import numpy as np

from zteam.kernels.binding import BeamEnds, Floats, climb
from zteam.planning.likelihood import LikelihoodField

_HALVINGS = 4
"""Times that steps are halved, and ..."""
_MOST_STEPS = 30
"""... how many are made at most."""


def match(field: LikelihoodField, poses: Floats, beams: BeamEnds, step: float, turn: float) -> tuple[Floats, Floats]:
    """The poses (n, 3) near `poses` (base in `map`) at which the beams fit best.

    And the mean of their likelihoods, (n). `step` (m) and `turn` (radians) are the first steps of the search.
    """
    found = poses.copy()
    if not beams.shape[1]:
        return found, np.zeros(len(poses))
    sums = climb(field.values, field.place, found, beams, (step, turn), _HALVINGS, _MOST_STEPS)
    return found, sums * (field.unit / beams.shape[1])
