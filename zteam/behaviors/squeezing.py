"""How far a formation has to be squeezed to a column: where walls are near, and where it goes round a tight bend."""

import math
from collections.abc import Sequence

import numpy as np

from zteam.behaviors.scans import beams_of
from zteam.geometry import Pose2
from zteam.messages import LaserScan

MARGIN = 0.1
"""Metres that have to be free beside the outermost robot."""
BEHIND, AHEAD = 0.5, 1.5
"""Metres along the trail, from the leader and from the own slot, within which walls count."""
BODY = 0.45
"""Metres around another robot within which a hit is that robot."""
BEND = 0.9
"""The outermost slot lies within this share of the radius of a bend."""
CLOSING, OPENING = 0.5, 0.13
"""1/s: how fast the formation closes and opens."""


def approach(share: float, needed: float, dt: float) -> float:
    """The share after `dt` seconds: it closes faster than it opens, so a doorway does not open it."""
    return min(needed, share + CLOSING * dt) if needed > share else max(needed, share - OPENING * dt)


def share_for_bend(curvature: float, left: float, right: float) -> float:
    """The share that a bend (1/m, left positive) needs for slots that reach so far (m) to the left and to the right."""
    width = abs(curvature) * (left if curvature > 0.0 else right)
    return max(0.0, 1.0 - BEND / width) if width > BEND else 0.0


def share_for_room(
    scan: LaserScan,
    places: Sequence[Pose2],
    others: Sequence[tuple[float, float]],
    left: float,
    right: float,
    half_width: float,
) -> float:
    """The share that walls beside these places of the trail need.

    The places and the other robots, whose hits do not count, are in the own base frame.
    """
    beside = half_width + MARGIN
    # What is further to the side needs nothing.
    side = max(left, right) + beside
    bound = math.hypot(side, AHEAD) + max(math.hypot(place.x, place.y) for place in places)
    beams = beams_of(scan)
    if beams is None or beams.nearest >= bound:
        return 0.0
    hits = beams.find_hits(bound)
    for x, y in others:
        hits = hits[:, np.hypot(hits[0] - x, hits[1] - y) > BODY]
    needed = 0.0
    for x, y, yaw in places:
        dx, dy, cos, sin = hits[0] - x, hits[1] - y, math.cos(yaw), math.sin(yaw)
        along, across = cos * dx + sin * dy, cos * dy - sin * dx
        off = across[(along > -BEHIND) & (along < AHEAD) & (np.abs(across) < side)]
        for reach, offs in ((left, off[off > 0.0]), (right, -off[off < 0.0])):
            if reach > 0.0 and offs.size:
                needed = max(needed, 1.0 - (float(offs.min()) - beside) / reach)
    return min(needed, 1.0)
