"""What the laser saw before and does not see now: the scans of the last metres of travel, kept in `odom`.

A scan is kept each KEY_DISTANCE or KEY_ANGLE. What they say is worked out when it is asked for, and a bound on the
distance of the nearest remembered point answers most questions.
"""

import math
from collections import deque
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.behaviors.scans import Beams
from zteam.geometry import Pose2, normalize_angle

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

SPAN = 3.0
"""Metres of travel that are remembered: longer, and the odometry's error outgrows the margins."""
KEY_DISTANCE = 0.1
KEY_ANGLE = 0.2
"""Metres or radians of travel from one kept scan to the next: a scan for each third of an erratic's length."""
MAX_KEYS = 60
"""Kept scans, at most: thirty for SPAN straight on, and as many for turns."""
REACH = 4.0
"""Metres: hits further from the laser are not remembered. More than SPAN and a braking distance."""
SEEN_WITHIN = 0.05
"""Metres that a point may seem to lie behind what a beam met and still be the same."""
_GROUP = math.radians(1.0)
"""Radians: beams are kept in groups of this width, as the nearest of them."""
_FINEST = 1e-9
"""Radians: finer sectors are no laser's, and their places too large for a number."""
_JUMP = 1.0
"""Metres of odometry from step to step that no base drives: the robot was set down elsewhere."""
_PUT = 0.02
"""Metres further than the corners that a base has room where it was put down."""
_NOTHING = np.empty((2, 0))


class Sectors(NamedTuple):
    """Distances by bearing, in equal sectors."""

    start: float
    step: float
    """Radians, not 0; below 0 for a laser that turns clockwise."""
    distances: Floats
    """NaN where nothing is known; (n,), or a row for each of several scans."""

    def look(self, x: Floats, y: Floats) -> Floats:
        """How far the laser saw towards points of its own frame: metres, NaN where it looked not or saw nothing."""
        places = np.remainder((np.arctan2(y, x) - self.start) * math.copysign(1.0, self.step), math.tau)
        index = (places / max(abs(self.step), _FINEST) + 0.5).astype(np.intp)
        last = self.distances.shape[-1] - 1
        nearest = np.minimum(index, last)
        rows = self.distances[nearest] if self.distances.ndim == 1 else np.take_along_axis(self.distances, nearest, 1)
        return np.where(index <= last, rows, np.nan)

    def is_like(self, other: "Sectors") -> bool:
        """Whether the other has the same bearings."""
        return (self.start, self.step, self.distances.size) == (other.start, other.step, other.distances.size)


class _Key(NamedTuple):
    """A kept scan."""

    travelled: float
    base: Pose2
    laser: Pose2
    """Both in `odom`."""
    sectors: Sectors


class _Stack(NamedTuple):
    """Kept scans of one laser as columns."""

    base_x: Floats
    base_y: Floats
    base_cos: Floats
    base_sin: Floats
    x: Floats
    y: Floats
    cos: Floats
    sin: Floats
    """Of the laser."""
    sectors: Sectors

    @classmethod
    def of(cls, keys: Sequence[_Key]) -> "_Stack":
        """The stack of these scans."""
        bases, lasers = (_columns([key.base for key in keys]), _columns([key.laser for key in keys]))
        distances = np.array([key.sectors.distances for key in keys])
        return cls(*bases, *lasers, keys[0].sectors._replace(distances=distances))

    def saw(self, places: Floats, extent: tuple[float, float, float]) -> Flags:
        """Which places (2, n) of `odom` a scan saw, or its base stood on: `extent` as in ScanMemory."""
        x, y = places
        dx, dy = x - self.x, y - self.y
        there = self.cos * dx + self.sin * dy, self.cos * dy - self.sin * dx
        seen = self.sectors.look(*there) >= np.hypot(dx, dy)
        dx, dy = x - self.base_x, y - self.base_y
        along, across = self.base_cos * dx + self.base_sin * dy, self.base_cos * dy - self.base_sin * dx
        rear, front, half_width = extent
        seen |= (along >= -rear) & (along <= front) & (np.abs(across) <= half_width)
        found: Flags = seen.any(axis=0)
        return found


def _columns(poses: Sequence[Pose2]) -> tuple[Floats, Floats, Floats, Floats]:
    """x, y, cosine and sine of poses, each (n, 1)."""
    x, y, yaw = np.array(poses).T[:, :, None]
    return x, y, np.cos(yaw), np.sin(yaw)


def group(beams: Beams, distances: Floats) -> Sectors:
    """The sectors of a scan."""
    start, step, count = beams.laser
    size = max(1, int(min(count, _GROUP / abs(step) + 1e-6))) if step else 1
    if size == 1:
        return Sectors(start, step or math.tau, distances)
    groups = -(-count // size)
    nearest = np.full(groups, np.nan)
    for i in range(size):
        part = distances[i::size]
        # The smaller of two numbers; of a number and a NaN the number.
        np.fmin(nearest[: part.size], part, out=nearest[: part.size])
    return Sectors(start + 0.5 * (size - 1) * step, size * step, nearest)


@lru_cache(maxsize=64)
def axes_of(start: float, step: float, count: int) -> Floats:
    """(2, n): cosines and sines of the bearings of sectors."""
    angles = start + step * np.arange(count)
    return np.array((np.cos(angles), np.sin(angles)))


class ScanMemory:
    """The remembered scans of one robot."""

    def __init__(self, rear: float, front: float, half_width: float, room: float) -> None:
        """Ground that the base covered counts as seen; the base reaches so far (m) from its origin.

        So does what is within `room` (m) of where it was put down.
        """
        self._extent, self._room = (rear, front, half_width), room + _PUT
        self.forget()

    def forget(self) -> None:
        """The robot is somewhere else."""
        self._keys: deque[_Key] = deque(maxlen=MAX_KEYS)
        self._stack: _Stack | None = None
        """The kept scans as arrays, when they were last asked for."""
        self._pending: list[_Key] = []
        """Kept scans that are not in the cloud."""
        self._cloud = _NOTHING
        """Points in `odom`."""
        self._born = np.empty(0)
        """How far the base had travelled when a point was seen."""
        self.pose: Pose2 | None = None
        self._start: Pose2 | None = None
        """Where it was put down."""
        self.ahead = 0.0
        """Metres that the base moved forwards in the last step; below 0 backwards."""
        self._travelled = 0.0
        self._bound = math.inf
        """Metres from the base in which there certainly is no remembered point."""

    def move(self, base: Pose2) -> bool:
        """The base is at `base` in `odom`; whether its scan is to be kept."""
        last, self.pose = self.pose, base
        moved = math.hypot(base.x - last.x, base.y - last.y) if last else 0.0
        if moved > _JUMP or not last:
            self.forget()
            self.pose = self._start = base
        else:
            self.ahead = math.cos(last.yaw) * (base.x - last.x) + math.sin(last.yaw) * (base.y - last.y)
            self._travelled += moved
            self._bound -= moved
        if not self._keys:
            return True
        key = self._keys[-1].base
        turned = abs(normalize_angle(base.yaw - key.yaw))
        return turned >= KEY_ANGLE or math.hypot(base.x - key.x, base.y - key.y) >= KEY_DISTANCE

    def keep(self, sectors: Sectors, nearest: float, base_from_laser: Pose2) -> None:
        """Keep a scan that was made where the base is; no hit is nearer to the laser than `nearest` (m)."""
        base = self.pose
        assert base is not None
        if self._keys and not sectors.is_like(self._keys[-1].sectors):
            # Another laser than before.
            self.forget()
            self.pose = base
        key_scan = _Key(self._travelled, base, base.compose(base_from_laser), sectors)
        self._keys.append(key_scan)
        self._stack = None
        self._pending.append(key_scan)
        while self._keys[0].travelled < self._travelled - SPAN:
            self._keys.popleft()
        if len(self._pending) > 2 * len(self._keys):
            self._pending = self._pending[-len(self._keys) :]
        self._bound = min(self._bound, nearest - math.hypot(base_from_laser.x, base_from_laser.y))

    def may_hide(self, reach: float) -> bool:
        """Whether there may be a remembered point within `reach` (m)."""
        return self._bound <= reach

    def hidden(self, reach: float, now: Sectors, base_from_laser: Pose2) -> Floats:
        """Remembered points (2, n) of the base's frame, within `reach` (m), that the scan `now` tells nothing of."""
        pose = self.pose
        if pose is None or not self.may_hide(reach):
            return _NOTHING
        for key in self._pending:
            self._add(key)
        self._pending.clear()
        dx, dy = self._cloud[0] - pose.x, self._cloud[1] - pose.y
        squares = dx * dx + dy * dy
        self._bound = math.sqrt(squares.min(initial=(REACH - SPAN) ** 2))
        near = (squares <= reach * reach).nonzero()[0]
        if not near.size:
            return _NOTHING
        points = _into(pose, self._cloud.take(near, axis=1))
        return points[:, ~_is_told(now, _into(base_from_laser, points))]

    def never_seen(self, points: Floats) -> Flags:
        """Which of the points (2, n) of the base's frame no remembered scan saw."""
        if self.pose is None or not self._keys:
            return np.ones(points.shape[1], bool)
        if self._stack is None:
            self._stack = _Stack.of(self._keys)
        places = _out_of(self.pose, points)
        unseen = ~self._stack.saw(places, self._extent)
        if self._start is not None and self._travelled <= SPAN:
            unseen &= np.hypot(places[0] - self._start.x, places[1] - self._start.y) > self._room
        return unseen

    def _add(self, key: _Key) -> None:
        """Bring a kept scan into the cloud: what it tells of takes the place of what was known there."""
        kept = self._born >= key.travelled - SPAN
        if kept.any():
            kept &= ~_is_told(key.sectors, _into(key.laser, self._cloud))
        sectors = key.sectors
        hits = (sectors.distances < REACH).nonzero()[0]
        seen = sectors.distances[hits] * axes_of(sectors.start, sectors.step, sectors.distances.size)[:, hits]
        self._cloud = np.hstack((self._cloud[:, kept], _out_of(key.laser, seen)))
        self._born = np.concatenate((self._born[kept], np.full(hits.size, key.travelled)))


def _is_told(sectors: Sectors, points: Floats) -> Flags:
    """Which points of the laser's frame a scan tells of: it saw them, or through them."""
    told: Flags = sectors.look(points[0], points[1]) >= np.hypot(points[0], points[1]) - SEEN_WITHIN
    return told


def _into(frame: Pose2, points: Floats) -> Floats:
    """Points in a frame of the pose `frame`."""
    cos, sin = math.cos(frame.yaw), math.sin(frame.yaw)
    x, y = points[0] - frame.x, points[1] - frame.y
    return np.array((cos * x + sin * y, cos * y - sin * x))


def _out_of(frame: Pose2, points: Floats) -> Floats:
    """Points of a frame of the pose `frame`, outside of it."""
    cos, sin = math.cos(frame.yaw), math.sin(frame.yaw)
    return np.array((frame.x + cos * points[0] - sin * points[1], frame.y + sin * points[0] + cos * points[1]))
