"""A call of each kernel of behaviours, with arguments of the types that it is always called with."""

import math

import numpy as np

from zteam.behaviors.meeting_kernels import meet_straight, meet_turning
from zteam.behaviors.scan_kernels import interpret

_BEAMS = 4


def call_kernels() -> None:
    """Call each kernel once: where they run as they are kept, all are loaded then."""
    interpret(np.ones(_BEAMS), 0.1, 30.0, 29.9)
    points = np.zeros((2, _BEAMS))
    meet_straight(points, np.zeros((3, 4)), 0.5, 0.1)
    meet_turning(points, np.zeros((3, 4)), 0.0, 1.0, 0.0, math.inf, 0.1, 1.0)
