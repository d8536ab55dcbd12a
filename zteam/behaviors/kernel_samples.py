"""A call of each kernel of behaviours, with arguments of the types that it is always called with."""

import math

import numpy as np

from zteam.behaviors.meeting_kernels import meet_straight, meet_turning
from zteam.behaviors.memory_kernels import add_scan, clear_seen, select_near, select_untold
from zteam.behaviors.scan_kernels import find_nearest, interpret, select_hits

_BEAMS = 4


def call_kernels() -> None:
    """Call each kernel once: where they run as they are kept, all are loaded then."""
    ranges, room, frame = np.ones(_BEAMS), np.empty((2, _BEAMS)), (0.0, 0.0, 1.0, 0.0)
    interpret(ranges, 0.1, 30.0, 29.9)
    find_nearest(ranges, 2, np.empty(2))
    points = np.zeros((2, _BEAMS))
    select_hits(ranges, ranges, points, 0.0, 0.0, room)
    select_untold(points, *frame, -1.0, 0.5, ranges, room)
    select_near(points, *frame, -1.0, 1.0, -1.0, 1.0, 1.0, room)
    empty = np.empty((2, 0)), np.empty(0)
    add_scan(*empty, 0.0, 1.0, *frame, -1.0, 0.5, ranges, points, 4.0, room, np.empty(_BEAMS))
    clear_seen(np.ones(_BEAMS, bool), points, np.zeros((1, 8)), -1.0, 0.5, np.ones((1, _BEAMS)), 0.1, 0.1, 0.1)
    meet_straight(points, np.zeros((3, 4)), 0.5, 0.1)
    meet_turning(points, np.zeros((3, 4)), 0.0, 1.0, 0.0, math.inf, 0.1, 1.0)
