"""What a base sweeps along an arc, when it meets given points there, and how fast it may drive it.

The outline counts as convex: its hull is some half-planes, and a point's depth in the hull is the largest of its
distances from them (below 0 inside). When a point is met is computed, not searched for in steps.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.base import Base
from zteam.geometry import Point2, Pose2, convex_hull
from zteam.kernels import binding as kernels

Floats = NDArray[np.float64]

SPIN_MARGIN = 0.01
"""Metres that stay free around a base that turns on the spot: less than what `wander` squeezes through."""
DRIVE_MARGIN = 0.025
"""Metres that stay free beside a base that drives: what the odometry and the laser are wrong by."""
SLOWEST = 0.02
"""m/s of the fastest corner: what has to be slower than this stands, so that nothing crawls at the edge."""
STRAIGHT = 1e-5
"""Radians: an arc that turns less counts as straight. On a metre that is wrong by less than 0.01 mm."""
_MOST = 48
"""Points of a side, at most."""
_EDGE = 0.1
"""Metres between points of an outline, at most."""


class Motion(NamedTuple):
    """A velocity of the base that is kept: an arc, a straight line or a turn on the spot."""

    x: float
    """m/s, forwards."""
    turn: float
    """rad/s."""
    y: float = 0.0
    """m/s, to the left."""

    @property
    def speed(self) -> float:
        """m/s of the base's origin."""
        return math.hypot(self.x, self.y) if self.y else abs(self.x)

    def scale(self, share: float) -> "Motion":
        """The same arc, driven at a share of its speed."""
        return Motion(self.x * share, self.turn * share, self.y * share)


class Outline:
    """The convex hull of a footprint, in `base_footprint`."""

    def __init__(self, footprint: tuple[Point2, ...]) -> None:
        corners = np.array(convex_hull(footprint))
        self.corners = corners
        """(n, 2), counter-clockwise."""
        along = np.roll(corners, -1, axis=0) - corners
        along /= np.hypot(along[:, 0], along[:, 1])[:, None]
        normals = np.column_stack((along[:, 1], -along[:, 0]))
        self.rows: Floats = np.column_stack((normals, (normals * corners).sum(axis=1)))
        """(n, 3): outward normals of length 1, offsets (inside, normal @ point is less)."""
        self.radius = float(np.hypot(corners[:, 0], corners[:, 1]).max())
        """Metres from the origin to the furthest corner."""
        self._tips: list[list[float]] = corners.tolist()
        self.border = _border(corners)
        """(2, m): points on the outline, at most _EDGE apart."""

    def distances(self, points: Floats) -> Floats:
        """Of points (2, m): metres from the hull, below 0 inside; too little beside a corner."""
        found: Floats = np.maximum.reduce(self.rows[:, :2] @ points - self.rows[:, 2:3])
        return found

    def fastest(self, motion: Motion) -> float:
        """m/s of the fastest corner."""
        x, turn, y = motion
        return max([math.hypot(x - turn * up, y + turn * along) for along, up in self._tips])


_outline_of = lru_cache(maxsize=256)(Outline)


def outline_of(base: Base) -> Outline:
    """The outline of a base: the same object for equal footprints."""
    return _outline_of(base.footprint)


def _border(corners: Floats) -> Floats:
    parts = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = min(_MOST, math.ceil(float(np.hypot(*(end - start))) / _EDGE))
        parts.append(start[:, None] + (end - start)[:, None] * (np.arange(count) / count))
    return np.hstack(parts)


def margin_of(outline: Outline, motion: Motion) -> float:
    """Metres to keep free around the outline on this arc."""
    speed = motion.speed
    fastest = speed + abs(motion.turn) * outline.radius
    return SPIN_MARGIN + (DRIVE_MARGIN - SPIN_MARGIN) * (speed / fastest if fastest else 0.0)


def place_after(motion: Motion, seconds: float) -> Pose2:
    """Where the base is then, in its frame of now."""
    x, turn, y = motion
    angle = turn * seconds
    if abs(angle) < STRAIGHT:
        return Pose2(x * seconds, y * seconds, angle)
    ahead, aside = math.sin(angle) / turn, (1.0 - math.cos(angle)) / turn
    return Pose2(x * ahead - y * aside, x * aside + y * ahead, angle)


def swept_disc(outline: Outline, motion: Motion, seconds: float) -> tuple[float, float, float]:
    """A disc that all lies in that `motion` sweeps within `seconds`, with the margin: x, y and radius in metres."""
    x, y, _ = place_after(motion, 0.5 * seconds)
    return x, y, 0.5 * motion.speed * seconds + outline.radius + margin_of(outline, motion)


def meeting_time(outline: Outline, motion: Motion, seconds: float, points: Floats, clearance: float = 0.0) -> float:
    """When within `seconds` the base first comes nearer to a point of (2, n) than the margin and `clearance` (m).

    inf if it does not. Where it is nearer than that now, what counts is when it comes nearer still: so a base may
    always move away.
    """
    margin, (x, y, radius) = margin_of(outline, motion) + clearance, swept_disc(outline, motion, seconds)
    return kernels.meet(np.ascontiguousarray(points), outline.rows, motion, seconds, margin, (x, y, radius + clearance))


def admissible(
    points: Floats, hull: Outline, arc: Motion, braking: float, reaction: float,
    gap: float = 0.0, clearance: float = 0.0, extra: float = 0.0,
) -> float:  # fmt: skip
    """The share of its speed (0..1) at which a base may drive an arc to stop before all points (2, n) of its frame.

    Braking on the arc from its full speed takes `braking` seconds, and begins `reaction` seconds from now. The base
    stops `gap` metres before a point, as far as it drives and not turns, and `extra` metres before any; beside it the
    margin and `clearance` (m) stay free.
    """
    fastest = arc.speed + abs(arc.turn) * hull.radius
    kept = arc.speed / fastest**2 * gap + extra / fastest
    seconds = reaction + 0.5 * braking + kept
    free = meeting_time(hull, arc, seconds, points, clearance)
    return share_of(free - kept, braking, reaction, fastest)


def share_of(free: float, braking: float, reaction: float, fastest: float) -> float:
    """As `admissible`, where `free` seconds of the arc are free at its full speed, of the fastest corner's m/s."""
    if free <= 0.0:
        return 0.0
    if free >= reaction + 0.5 * braking:
        return 1.0
    share = (math.sqrt(reaction**2 + 2.0 * braking * free) - reaction) / braking
    return share if share * fastest >= SLOWEST else 0.0
