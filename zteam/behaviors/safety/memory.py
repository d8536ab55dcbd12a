"""What the laser saw before and does not see now: the scans of the last metres of travel, kept in `odom`.

A scan is kept each KEY_DISTANCE or KEY_ANGLE. What they say is worked out when it is asked for, and a bound on the
distance of the nearest remembered point answers most questions.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.behaviors.memory_kernels import add_scan, clear_seen, select_near
from zteam.behaviors.safety.sectors import Sectors, axes_of
from zteam.behaviors.safety.swept import DRIVE_MARGIN, Box
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
_JUMP = 1.0
"""Metres of odometry from step to step that no base drives: the robot was set down elsewhere."""
_PUT = 0.02
"""Metres further than the corners that a base has room where it was put down."""
_NOTHING = np.empty((2, 0))


class _Key(NamedTuple):
    """A kept scan."""

    travelled: float
    base: Pose2
    laser: Pose2
    """Both in `odom`."""
    frames: tuple[float, ...]
    """The same as kernels take it: four numbers each."""
    sectors: Sectors


class _Stack(NamedTuple):
    """The kept scans of a laser."""

    frames: Floats
    """(n, 8): of base and laser at each scan."""
    sectors: Sectors
    """With a row of distances for each scan."""

    @classmethod
    def of(cls, keys: deque[_Key]) -> "_Stack":
        """The stack of these scans."""
        distances = np.array([key.sectors.distances for key in keys])
        return cls(np.array([key.frames for key in keys]), keys[-1].sectors._replace(distances=distances))


class _Vicinity(NamedTuple):
    """The points of the cloud about a place."""

    x: float
    y: float
    radius: float
    """Metres within which it has all points."""
    points: Floats

    def holds(self, pose: Pose2, reach: float) -> bool:
        """Whether it has all points within `reach` (m) of a pose."""
        return math.hypot(pose.x - self.x, pose.y - self.y) + reach <= self.radius


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
        """The kept scans, when they were last asked for."""
        self._pending: list[_Key] = []
        """Kept scans that are not in the cloud."""
        self._cloud = _NOTHING
        """Points in `odom`."""
        self._born = np.empty(0)
        """How far the base had travelled when a point was seen."""
        self._vicinity: _Vicinity | None = None
        """Of the cloud, where it was last asked for."""
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
        if base == last and self._keys:
            self.ahead = 0.0
            return False
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
        laser = base.compose(base_from_laser)
        key_scan = _Key(self._travelled, base, laser, (*_frame(base), *_frame(laser)), sectors)
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

    def remembered(self, box: Box, reach: float) -> Floats:
        """Remembered points (2, n) of the base's frame: in a box, or a little outside, and within `reach` (m)."""
        pose = self.pose
        if pose is None or not self.may_hide(reach):
            return _NOTHING
        near = self._vicinity_of(pose, reach)
        # Mostly none is in the box.
        found = np.empty(near.points.shape)
        left, right, bottom, top = box
        grown = left - DRIVE_MARGIN, right + DRIVE_MARGIN, bottom - DRIVE_MARGIN, top + DRIVE_MARGIN
        count = select_near(near.points, *_frame(pose), *grown, reach, found)
        return found[:, :count].copy() if count else _NOTHING

    def _vicinity_of(self, pose: Pose2, reach: float) -> "_Vicinity":
        """A part of the cloud with all points within `reach` (m) of the base."""
        known = self._vicinity
        if not self._pending and known is not None and known.holds(pose, reach):
            return known
        for key in self._pending:
            self._add(key)
        self._pending.clear()
        dx, dy = self._cloud[0] - pose.x, self._cloud[1] - pose.y
        squares = dx * dx + dy * dy
        self._bound = math.sqrt(squares.min(initial=(REACH - SPAN) ** 2))
        radius = reach + KEY_DISTANCE
        points = self._cloud.take((squares <= radius * radius).nonzero()[0], axis=1)
        self._vicinity = _Vicinity(pose.x, pose.y, radius, points)
        return self._vicinity

    def never_seen(self, points: Floats) -> Flags:
        """Which of the points (2, n) of the base's frame no remembered scan saw."""
        if self.pose is None or not self._keys:
            return np.ones(points.shape[1], bool)
        if self._stack is None:
            self._stack = _Stack.of(self._keys)
        places = _out_of(self.pose, points)
        unseen = np.ones(points.shape[1], bool)
        clear_seen(unseen, places, self._stack.frames, *self._stack.sectors, *self._extent)
        if not unseen.any():
            return unseen
        if self._start is not None and self._travelled <= SPAN:
            unseen &= np.hypot(places[0] - self._start.x, places[1] - self._start.y) > self._room
        return unseen

    def _add(self, key: _Key) -> None:
        """Bring a kept scan into the cloud: what it tells of takes the place of what was known there."""
        sectors, most = key.sectors, self._born.size + key.sectors.distances.size
        axes = axes_of(sectors.start, sectors.step, sectors.distances.size)
        cloud, born = np.empty((2, most)), np.empty(most)
        oldest = key.travelled - SPAN
        known = self._cloud, self._born, oldest, key.travelled
        count = add_scan(*known, *_frame(key.laser), *sectors, axes, REACH, cloud, born)
        self._cloud, self._born = cloud[:, :count].copy(), born[:count].copy()


def _frame(pose: Pose2) -> tuple[float, float, float, float]:
    """As kernels take it."""
    return pose.x, pose.y, math.cos(pose.yaw), math.sin(pose.yaw)


def _out_of(frame: Pose2, points: Floats) -> Floats:
    """Points of a frame of the pose `frame`, outside of it."""
    cos, sin = math.cos(frame.yaw), math.sin(frame.yaw)
    return np.array((frame.x + cos * points[0] - sin * points[1], frame.y + sin * points[0] + cos * points[1]))
