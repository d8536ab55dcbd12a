"""What a base sweeps along an arc, and when it meets given points there.

The outline counts as convex: its hull is some half-planes, and a point's depth in the hull is the largest of its
distances from them (below 0 inside). When a point is met is computed, not searched for in steps.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.base import Base, Point2
from zteam.behaviors.meeting_kernels import CLOSEST, meet_straight, meet_turning

Floats = NDArray[np.float64]

SPIN_MARGIN = 0.005
"""Metres that stay free around a base that turns on the spot: less than what `wander` squeezes through."""
DRIVE_MARGIN = 0.025
"""Metres that stay free beside a base that drives: what the odometry and the laser are wrong by."""
STRAIGHT = 1e-5
"""Radians: an arc that turns less counts as straight. On a metre that is wrong by less than 0.01 mm."""
_RING = 1e-6
"""Metres that a ring is larger, for rounding."""
_MOST = 48
"""Points of a side, at most."""
SWING = CLOSEST
"""Metres that the rear may come out beside the way before that is looked at: no base stands nearer to a thing. An
erratic comes out further on arcs of less than 12.5 m radius."""
_FACES = 0.5
"""Cosine of the angle to the driving direction up to which a side of the outline leads."""
_EDGE = 0.1
"""Metres between points of an outline, at most."""


class Outline:
    """The convex hull of a footprint, in `base_footprint`."""

    def __init__(self, footprint: tuple[Point2, ...]) -> None:
        corners = np.array(_hull(footprint))
        self.corners = corners
        """(n, 2), counter-clockwise."""
        along = np.roll(corners, -1, axis=0) - corners
        along /= np.hypot(along[:, 0], along[:, 1])[:, None]
        self.normals = np.column_stack((along[:, 1], -along[:, 0]))
        """(n, 2): outward, of length 1."""
        self.offsets: Floats = (self.normals * corners).sum(axis=1)
        """(n,): a point p is inside where normals @ p <= offsets."""
        self.planes: tuple[tuple[float, float, float], ...] = tuple(
            zip(*self.normals.T.tolist(), self.offsets.tolist(), strict=True)
        )
        """x and y of the normals, and the offsets, as plain numbers: for one point they are faster."""
        # Where the sides move outward by a metre, the corners move by this.
        before = np.roll(self.normals, 1, axis=0)
        with np.errstate(divide="ignore", invalid="ignore"):
            moves = (before + self.normals) / (1.0 + (before * self.normals).sum(axis=1))[:, None]
        # The tip of an outline that is hardly wider than a line may be anywhere.
        moves[~np.isfinite(moves)] = np.inf
        self._mitres: list[list[float]] = np.hstack((corners, moves)).tolist()
        bearings = [math.atan2(y, x) for x, y in self.normals.tolist()]
        self.rows: Floats = np.column_stack((self.normals, self.offsets, bearings))
        """(n, 4): normals, offsets, and where the normals point to: as kernels take it."""
        self.radius = float(np.hypot(corners[:, 0], corners[:, 1]).max())
        """Metres from the origin to the furthest corner."""
        self.rear = max(0.0, -float(corners[:, 0].min()))
        self.front = max(0.0, float(corners[:, 0].max()))
        self.longer = max(self.front, self.rear)
        self.half_width = float(np.abs(corners[:, 1]).max())
        self.border = _border(corners)
        """(2, m): points on the outline, at most _EDGE apart."""
        self.room = _rings(self.radius)
        """(2, m): places within the circle of the corners, all round: what the base needs to turn on the spot."""
        self.front_edge = _edge(corners, self.normals, 1.0)
        self.rear_edge = _edge(corners, self.normals, -1.0)
        """(2, m): points of what leads when it drives forwards, and backwards."""

    def distances(self, points: Floats) -> Floats:
        """Of points (2, m): metres from the hull, below 0 inside; too little beside a corner."""
        found: Floats = np.maximum.reduce(self.normals @ points - self.offsets[:, None])
        return found

    def distance(self, x: float, y: float) -> float:
        """As `distances`, of one point."""
        return max([normal_x * x + normal_y * y - offset for normal_x, normal_y, offset in self.planes])

    def ring(self, centre: float, margin: float) -> tuple[float, float]:
        """Metres from the place (0, `centre`) between which all points lie that are nearer to the hull than `margin`
        (m): no other comes into the outline that turns about that place."""
        outer = max([math.hypot(x + margin * aside, y + margin * up - centre) for x, y, aside, up in self._mitres])
        return self.distance(0.0, centre) - margin - _RING, outer + _RING


@lru_cache(maxsize=256)
def _outline_of(footprint: tuple[Point2, ...]) -> Outline:
    return Outline(footprint)


def outline_of(base: Base) -> Outline:
    """The outline of a base: the same object for equal footprints."""
    return _outline_of(base.footprint)


def _hull(points: tuple[Point2, ...]) -> list[Point2]:
    """Andrew's monotone chain: corners counter-clockwise."""
    ordered = sorted(set(points))
    halves = []
    for sequence in (ordered, ordered[::-1]):
        half: list[Point2] = []
        for x, y in sequence:
            while len(half) >= 2 and _turns_right(half[-2], half[-1], (x, y)):
                half.pop()
            half.append((x, y))
        halves.append(half[:-1])
    return halves[0] + halves[1]


def _turns_right(a: Point2, b: Point2, c: Point2) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) <= 0.0


def _border(corners: Floats) -> Floats:
    parts = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = min(_MOST, math.ceil(float(np.hypot(*(end - start))) / _EDGE))
        parts.append(start[:, None] + (end - start)[:, None] * (np.arange(count) / count))
    return np.hstack(parts)


def _rings(radius: float) -> Floats:
    angles = math.tau * np.arange(_MOST) / _MOST
    ring = radius * np.array((np.cos(angles), np.sin(angles)))
    return np.hstack((ring, 0.85 * ring))


def _edge(corners: Floats, normals: Floats, side: float) -> Floats:
    """Points of the sides that face more forwards (`side` 1) or backwards (-1) than sideways, and of the tips."""
    parts = [corners[(corners[:, 0] * side).argmax()][:, None]]
    for start, end, normal in zip(corners, np.roll(corners, -1, axis=0), normals, strict=True):
        if normal[0] * side >= _FACES:
            count = min(_MOST, max(1, math.ceil(float(np.hypot(*(end - start))) / _EDGE)))
            parts.append(start[:, None] + (end - start)[:, None] * (np.arange(count + 1) / count))
    return np.hstack(parts)


class Arc(NamedTuple):
    """A motion that is kept: a straight line, an arc or a turn on the spot."""

    speed: float
    """m/s."""
    turn: float
    """rad/s."""


class Box(NamedTuple):
    """A rectangle along the axes of the base frame: metres."""

    left: float
    right: float
    """Least and most x."""
    bottom: float
    top: float
    """Least and most y."""

    def away(self, x: float, y: float) -> float:
        """Metres from a point to the box; 0 inside."""
        left, right, bottom, top = self
        dx = left - x if x < left else x - right if x > right else 0.0
        dy = bottom - y if y < bottom else y - top if y > top else 0.0
        return math.hypot(dx, dy)


def swings(outline: Outline, arc: Arc) -> bool:
    """Whether the base comes out beside its own way on this arc: its rear if it drives forwards, or its front."""
    if not arc.turn:
        return False
    reach = outline.rear if arc.speed > 0.0 else outline.longer
    return reach**2 > 2.0 * SWING * (abs(arc.speed / arc.turn) + outline.half_width)


def margin_of(outline: Outline, arc: Arc) -> float:
    """Metres to keep free around the outline on this arc."""
    fastest = abs(arc.speed) + abs(arc.turn) * outline.radius
    return SPIN_MARGIN + (DRIVE_MARGIN - SPIN_MARGIN) * (abs(arc.speed) / fastest if fastest else 0.0)


def swept_box(outline: Outline, arc: Arc, seconds: float) -> Box:
    """A box that all lies in that `arc` sweeps within `seconds`, with the margin."""
    speed, turn = arc
    angle, most, margin = abs(turn * seconds), outline.radius, margin_of(outline, arc)
    if angle > 0.5 * math.pi:
        # The origin stays on its circle, and any corner may point anywhere.
        way, aside, most = abs(speed / turn), 2.0 * speed / turn, most + margin
        return Box(-way - most, way + most, min(0.0, aside) - most, max(0.0, aside) + most)
    if angle < STRAIGHT:
        x, y = speed * seconds, 0.0
    else:
        x, y = speed / turn * math.sin(turn * seconds), speed / turn * (1.0 - math.cos(turn * seconds))
    swing, half_width = math.sin(angle), outline.half_width
    front = min(most, outline.front + half_width * swing) + margin
    rear = min(most, outline.rear + half_width * swing) + margin
    side = min(most, half_width + outline.longer * swing) + margin
    left, right = (0.0, x) if x > 0.0 else (x, 0.0)
    bottom, top = (0.0, y) if y > 0.0 else (y, 0.0)
    return Box(left - rear, right + front, bottom - side, top + side)


def meeting_time(outline: Outline, arc: Arc, seconds: float, points: Floats, clearance: float = 0.0) -> float:
    """When within `seconds` the base first comes nearer to a point of (2, n) than the margin and `clearance` (m).

    inf if it does not. Where it is nearer than that now, what counts is when it comes nearer still: so a base may
    always move away.
    """
    points, margin = np.ascontiguousarray(points), margin_of(outline, arc) + clearance
    if abs(arc.turn * seconds) < STRAIGHT:
        time = meet_straight(points, outline.rows, float(arc.speed), margin)
    else:
        centre, side, most = arc.speed / arc.turn, math.copysign(1.0, arc.turn), float(abs(arc.turn) * seconds)
        ring = outline.ring(centre, margin)
        time = meet_turning(points, outline.rows, centre, side, *ring, margin, most) / abs(arc.turn)
    return time if time <= seconds else math.inf
