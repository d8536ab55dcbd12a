"""How far a formation has to be squeezed to a column: where walls are near, and where it goes round a tight bend."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from zteam.behaviors.scans import beams_of
from zteam.geometry import Pose2
from zteam.messages import LaserScan

Floats = NDArray[np.float64]

MARGIN = 0.1
"""Metres that have to be free beside the outermost robot."""
BEHIND, AHEAD = 0.5, 1.5
"""Metres along the trail, from the leader and from the own slot, within which walls count."""
BODY = 0.45
"""Metres around another robot within which a hit is that robot."""
BEND = 0.9
"""The outermost slot lies within this share of the radius of a bend."""
CLOSING, OPENING = 0.5, 0.25
"""1/s: how fast the formation closes and opens."""
HOLD = 1.0
"""Seconds with more room before it opens."""
_ROUNDING = 1e-6
"""Metres."""


class Squeeze:
    """The share of the way from the shape's slots to those of the column, 0 to 1."""

    def __init__(self) -> None:
        self.share = 0.0
        self._roomy = 0.0
        """Seconds in a row in which a smaller share would have done."""

    def take(self, needed: float, dt: float) -> None:
        """The share that is needed now; it closes at once and opens after a while."""
        if needed >= self.share:
            self._roomy = 0.0
            self.share = min(needed, self.share + CLOSING * dt)
            return
        self._roomy += dt
        if self._roomy > HOLD:
            self.share = max(needed, self.share - OPENING * dt)


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
    side = max(left, right) + beside + _ROUNDING
    bound = math.hypot(side, AHEAD) + max(math.hypot(place.x, place.y) for place in places)
    beams = beams_of(scan)
    if beams is None or beams.nearest >= bound:
        return 0.0
    x, y = beams.find_hits(bound)
    # All places at once, one row each: numpy has a cost for each call.
    rows = [(place.x, place.y, math.cos(place.yaw), math.sin(place.yaw)) for place in places]
    place_x, place_y, cos, sin = np.array(rows).T[:, :, None]
    dx, dy = x - place_x, y - place_y
    along, across = cos * dx + sin * dy, cos * dy - sin * dx
    beside_place = (along > -BEHIND) & (along < AHEAD) & (np.abs(across) < side)
    off = across[beside_place & _is_wall(x, y, others)]
    needed = 0.0
    for reach, offs in ((left, off[off > 0.0]), (right, -off[off < 0.0])):
        if reach > 0.0 and offs.size:
            needed = max(needed, 1.0 - (float(offs.min()) - beside) / reach)
    return min(needed, 1.0)


def _is_wall(x: Floats, y: Floats, others: Sequence[tuple[float, float]]) -> NDArray[np.bool_]:
    """Which hits are not of another robot."""
    other_x, other_y = np.array(others).reshape(-1, 2).T[:, :, None]
    is_wall: NDArray[np.bool_] = ((x - other_x) ** 2 + (y - other_y) ** 2 > BODY * BODY).all(axis=0)
    return is_wall
