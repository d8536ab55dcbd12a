"""What stands about a robot in one step, as points: from the scan and from memory."""

import math
from collections.abc import Hashable
from functools import cached_property, lru_cache
from typing import Any, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam.base import Point2
from zteam.behaviors.corridors import Laser
from zteam.behaviors.safety.memory import ScanMemory
from zteam.behaviors.safety.sectors import Sectors, group, untold
from zteam.behaviors.safety.silence import LastWords
from zteam.behaviors.safety.swept import Box, Outline
from zteam.behaviors.safety.zones import zone_of
from zteam.behaviors.scan_kernels import select_hits
from zteam.behaviors.scans import Beams, beams_of
from zteam.behaviors.view import View
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import Odometry

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
_Answer = TypeVar("_Answer")

GAP = 0.15
"""Metres that a robot stops before what it would drive into."""
LOOKS_ROUND = 0.5 * math.pi
"""Radians to either side that a laser has to see for a drive forwards to need no memory."""
MOST_KNOWN = 16
"""Answers that are kept, at most: a step needs three."""
NO_POSE = Pose2(0.0, 0.0, 0.0)
NO_POINTS = np.empty((2, 0))


class Sight(msgspec.Struct, frozen=True, eq=False, dict=True):
    """What the laser sees in one step."""

    beams: Beams
    distances: Floats
    """With last words; NaN where nothing is known."""
    silent: Flags | None
    """Beams that see nothing, without those that are bridged; None if there are none."""
    laser: Pose2
    """In the base frame."""
    nearest: float
    """Metres from the laser: no hit is nearer."""

    def is_of(self, beams: Beams, distances: Floats, silent: Flags | None, laser: Pose2) -> bool:
        """Whether it is the sight of these: the very same objects."""
        return self.beams is beams and self.distances is distances and self.silent is silent and self.laser is laser

    @cached_property
    def sectors(self) -> Sectors:
        """The scan by bearings."""
        return group(self.beams, self.distances)

    def is_clear(self, reach: float) -> bool:
        """Whether there is certainly no hit within `reach` (m) of the base."""
        return self.nearest > reach + math.hypot(self.laser.x, self.laser.y)

    def hits(self, box: Box) -> Floats:
        """(2, n): hits in a box of the base frame, or a little outside."""
        ends, axes = zone_of(self.beams.laser, self.laser, box)
        points = np.empty(axes.shape)
        count = select_hits(self.distances, ends, axes, self.laser.x, self.laser.y, points)
        # Mostly none.
        return points[:, :count].copy() if count else NO_POINTS

    def hit(self, beam: int) -> Point2 | None:
        """Where a beam ended, in the base frame; None if it met nothing, or there is no such beam."""
        if not 0 <= beam < self.distances.size:
            return None
        distance = self.distances.item(beam)
        if not distance < math.inf:
            return None
        start, step, _ = self.beams.laser
        angle = start + self.laser.yaw + step * beam
        return distance * math.cos(angle) + self.laser.x, distance * math.sin(angle) + self.laser.y

    def beam_towards(self, x: float, y: float) -> int:
        """The beam that looks to a point of the base frame: its index, which may be that of no beam."""
        start, step, _ = self.beams.laser
        bearing = math.atan2(y - self.laser.y, x - self.laser.x) - self.laser.yaw
        return round((bearing - start) * math.copysign(1.0, step) % math.tau / abs(step)) if step else 0

    def covers(self, half_angle: float) -> bool:
        """Whether the laser looks to all bearings within `half_angle` (rad) of straight ahead of the base."""
        return _covers(self.beams.laser, self.laser.yaw, half_angle)


@lru_cache(maxsize=16)
def _covers(laser: Laser, yaw: float, half_angle: float) -> bool:
    start, step, count = laser
    low, high = sorted((start + yaw, start + step * (count - 1) + yaw))
    shift = math.tau * round(0.5 * (low + high) / math.tau)
    return low - shift <= -half_angle and high - shift >= half_angle


class Surroundings:
    """Keeps what one robot saw."""

    def __init__(self, outline: Outline) -> None:
        self._outline = outline
        self._words = LastWords()
        self._memory = ScanMemory(outline.rear, outline.front, outline.half_width, outline.radius)
        self._lasers: dict[str, Pose2] = {}
        """The pose of each laser in the base frame, by its frame: it is fixed there."""
        self._looks_round = False
        self._has_room = True
        """As it says below, where that is known: driving forwards with a laser that looks round, it stays so."""
        self.sight: Sight | None = None
        """None without usable beams; the same while the robot sees the same."""
        self.known: dict[Hashable, Any] = {}
        """What was worked out from sight and memory, by what was asked: empty when the robot sees something new, or has
        moved."""

    def take(self, view: View) -> None:
        """See what the view shows."""
        last, self.sight = self.sight, self._look(view)
        if self.sight is not last:
            self.known.clear()
            self._looks_round = self.sight is not None and self.sight.covers(LOOKS_ROUND)
        if self.sight is None or view.odom is None:
            return
        pose = _pose_of(view.odom)
        if pose != self._memory.pose:
            self.known.clear()
        if math.isfinite(pose.x + pose.y + pose.yaw) and self._memory.move(pose):
            self._memory.keep(self.sight.sectors, self.sight.nearest, self.sight.laser)
        if self._memory.ahead < 0.0 or not self._looks_round:
            self._has_room = False

    def _look(self, view: View) -> Sight | None:
        """What the laser sees: the same as before if that has not changed."""
        assert view.scan is not None
        beams = beams_of(view.scan)
        if beams is None:
            return None
        distances, silent = self._words.fill(beams, view.now)
        laser = self._find_laser(view, view.scan.header.frame_id)
        last = self.sight
        if last is not None and last.is_of(beams, distances, silent, laser):
            return last
        nearest = beams.nearest if beams.all_speak else _nearest(distances)
        return Sight(beams, distances, silent, laser, nearest)

    def sees_all(self, speed: float) -> bool:
        """Whether a laser looks at all that the base drives to at this speed (m/s): forwards, and it looks round."""
        return speed > 0.0 and self._looks_round

    @property
    def is_blinded(self) -> bool:
        """Whether some beams see nothing."""
        return self.sight is not None and self.sight.silent is not None

    def keep(self, asked: Hashable, answer: _Answer) -> _Answer:
        """Keep an answer in `known`."""
        if len(self.known) >= MOST_KNOWN:
            self.known.clear()
        self.known[asked] = answer
        return answer

    def is_clear(self, reach: float, back: float) -> bool:
        """Whether there certainly is nothing: no hit within `reach` (m) of the base, and nothing remembered within
        `back` (m) that the laser might not see."""
        sight = self.sight
        return sight is None or (sight.is_clear(reach) and not (back > 0.0 and self._memory.may_hide(back)))

    def points(self, box: Box, reach: float, back: float) -> Floats:
        """(2, n): what stands in a box of the base frame, or a little outside, and within `reach` (m) of the base.

        The memory is asked for what is within `back` (m); with 0 it is not asked.
        """
        sight = self.sight
        if sight is None:
            return NO_POINTS
        hits = NO_POINTS if sight.is_clear(reach) else sight.hits(box)
        remembered = self._memory.remembered(box, back) if back > 0.0 else NO_POINTS
        if not remembered.size:
            return hits
        hidden = untold(sight.sectors, sight.laser, remembered)
        return np.hstack((hits, hidden)) if hidden.size else hits

    def never_seen(self, points: Floats) -> Flags:
        """Which points of the base frame no remembered scan saw."""
        return self._memory.never_seen(points)

    def has_room(self) -> bool:
        """Whether the ground within the circle of the corners was seen, or the base was put down there."""
        if not self._has_room:
            room = self._outline.room
            beyond = ~self.sees(room) & (self._outline.distances(room) > 0.0)
            self._has_room = not beyond.any() or not self.never_seen(room[:, beyond]).any()
        return self._has_room

    def in_view(self, points: Floats) -> Flags:
        """Towards which points of the base frame the laser looks, whether it sees something there or not."""
        sight = self.sight
        if sight is None:
            return np.zeros(points.shape[1], bool)
        start, step, count = sight.beams.laser
        bearings = np.arctan2(points[1] - sight.laser.y, points[0] - sight.laser.x) - sight.laser.yaw
        places = np.remainder((bearings - start) * math.copysign(1.0, step), math.tau)
        seen: Flags = places <= abs(step) * (count - 0.5)
        return seen

    def sees(self, points: Floats) -> Flags:
        """Which points of the base frame the laser looks to, and meets nothing before them."""
        seen = self.in_view(points)
        if self.sight is not None and seen.any():
            x, y = points[0] - self.sight.laser.x, points[1] - self.sight.laser.y
            cos, sin = math.cos(self.sight.laser.yaw), math.sin(self.sight.laser.yaw)
            # NaN is no obstacle: beams that say nothing are judged by themselves.
            seen &= ~(self.sight.sectors.look(cos * x + sin * y, cos * y - sin * x) < np.hypot(x, y))
        return seen

    def _find_laser(self, view: View, frame: str) -> Pose2:
        known = self._lasers.get(frame)
        if known is None:
            found = view.lookup(view.base_frame, frame) if frame else None
            if found is None or not all(map(math.isfinite, found[0])):
                return NO_POSE
            known = self._lasers[frame] = Pose2(*map(float, found[0]))
        return known


def _nearest(distances: Floats) -> float:
    lowest = float(np.fmin.reduce(distances, initial=math.inf))
    return lowest if lowest < math.inf else math.inf


def _pose_of(odom: Odometry) -> Pose2:
    position, turn = odom.pose.pose.position, odom.pose.pose.orientation
    return Pose2(float(position.x), float(position.y), yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w))
