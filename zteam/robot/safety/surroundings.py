"""What a robot knows of what stands around it: points, where its laser looks, and its teammates.

There is one set of points that stay where they are in `odom`. The newest scan clears what it sees through and adds its
hits. What it does not look at stays for the last metres of travel. A beam that says nothing neither clears nor adds.
Teammates are told by their poses: the laser looks over low bodies, and lasers dazzle each other.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.clock import to_ns
from zteam.geometry import Point2, Pose2, Velocity, normalize_angle
from zteam.kernels import safety as kernels
from zteam.messages import LaserScan, Odometry
from zteam.messages.base import DEFAULT_BASE, Base
from zteam.messages.planar import pose2_of
from zteam.robot.safety.motion import Outline, limits_of, outline_of, place_after
from zteam.robot.scans import Beams, beams_of
from zteam.robot.view import Teammate, View, own_pose

Floats = NDArray[np.float64]

STALE_AFTER = 0.5
"""Seconds after which a scan, the word of a beam, or the robot's own pose, is too old to move on."""
DAZZLE_ANGLE = math.radians(5.0)
"""Radians to either side of a teammate whose pose is fresh within which beams that say nothing are explained: its laser
dazzles, by 2 degrees in the simulator. The teammate itself is known from its pose."""
_SECTORS = 360
"""Of bearings: a beam that speaks does so for the others of its sector."""
_NARROW = math.radians(15.0)
"""Radians to either side of its way that a laser has to see for a drive forwards."""
_LOOKS = 6
"""Places on an arc at which is looked whether beams towards it say something."""
_NONE = np.empty(0)


class LaserCoverage:
    """What the newest scan shows, and what was silent before. Bearings are radians along the base's axes."""

    def __init__(self) -> None:
        self.beams: Beams | None = None
        """The newest scan, read; None without usable beams."""
        self.laser: Point2 = (0.0, 0.0)
        """In the base frame."""
        self.range = math.inf
        """Metres that the laser sees."""
        self.silent: Floats = _NONE
        """Bearings, from the laser, of beams that have said nothing for a while."""
        self._middle, self._half = 0.0, 0.0
        """The laser looks so far (rad) to either side of a bearing."""
        self._heard, self._whole = np.full(_SECTORS, -(1 << 62)), -(1 << 62)
        """When a beam of each sector of `odom` spoke last (ns), and all of them at once."""

    def update(self, beams: Beams, laser: Point2, yaw: float, now: int) -> None:
        """A scan of `now` (ns) by a laser at a place of the base, which is turned by `yaw` in `odom`."""
        start, step, count = beams.laser
        self.beams, self.laser, self.silent = beams, laser, _NONE
        self._middle, self._half = start + 0.5 * step * (count - 1), 0.5 * abs(step) * count
        is_silent = None if beams.all_speak else np.isnan(beams.distances)
        if is_silent is None or not is_silent.any():
            self._whole = now
            return
        bearings = beams.angles
        sectors = np.remainder((bearings + yaw) * (_SECTORS / math.tau), _SECTORS).astype(np.intp) % _SECTORS
        if self._whole > 0:
            # The beams were then where they are now, or nearly so.
            self._heard[sectors], self._whole = self._whole, -1
        self._heard[sectors[~is_silent]] = now
        self.silent = bearings[is_silent & (self._heard[sectors] < now - to_ns(STALE_AFTER))]

    def looks_along(self, motion: Velocity, seconds: float, forwards: bool) -> bool:
        """Whether the laser looks where the base drives to within `seconds`: a little to either side of a way forwards,
        and else as far as the base is wide. A turn on the spot is no way."""
        way = math.atan2(motion.y, motion.x)
        bend = max(-1.0, min(1.0, 0.5 * motion.turn * seconds))
        return not motion.speed or (self.looks(way + bend, _NARROW) if forwards else self.looks(way, 0.5 * math.pi))

    def looks(self, bearing: float, spare: float) -> bool:
        """Whether the laser looks to all bearings within `spare` (rad) of one."""
        return self._half > 3.1 or abs(normalize_angle(bearing - self._middle)) + spare <= self._half

    def is_blind(self, outline: Outline, motion: Velocity, seconds: float, mates: Iterable[Teammate]) -> bool:
        """Whether a beam that says nothing points into the way; those towards `mates` are explained."""
        silent, (laser_x, laser_y) = self.silent, self.laser
        for mate in mates:
            if mate.age <= STALE_AFTER:
                bearing = math.atan2(mate.pose.y - laser_y, mate.pose.x - laser_x)
                silent = silent[np.abs(_wrap(silent - bearing)) > DAZZLE_ANGLE]
        if not silent.size:
            return False
        seconds = max(seconds, 0.3 / motion.speed) / _LOOKS
        places = [place_after(motion, seconds * (i + 1)) for i in range(_LOOKS)]
        corners = [place.compose(Pose2(x, y, 0.0))[:2] for place in places for x, y in outline.corners.tolist()]
        x, y = (points := np.array(corners).T)[:, outline.distances(points) > 0.0]
        bearings = np.arctan2(y - laser_y, x - laser_x)
        bearings = bearings[np.abs(_wrap(bearings - self._middle)) <= self._half]
        if not bearings.size:
            return False
        middle = math.atan2(np.sin(bearings).sum(), np.cos(bearings).sum())
        aside, off = _wrap(bearings - middle), _wrap(silent - middle)
        return bool(((off >= aside.min()) & (off <= aside.max())).any())


def _wrap(angles: Floats) -> Floats:
    """In [-pi, pi)."""
    wrapped: Floats = np.remainder(angles + math.pi, math.tau) - math.pi
    return wrapped


GAP = 0.3
"""Metres that two robots stop apart, outline to outline."""
FOLLOWING_GAP = 0.1
"""Metres to a teammate that drives away: a chain at 0.8 m from base to base has 0.45 m between two erratics."""
RECEDES = 0.05
"""m/s away from the robot from which on a teammate drives away."""
GRACE = 0.3
"""Seconds that a pose may be old for nothing: transforms come over the aggregator. Then its outline grows."""
GROWTH = 0.25
"""m/s at which the outline of a teammate grows whose pose is old, or its own speed if that is more."""
MAX_GROWTH = 0.5
"""Metres."""
FORGET_AFTER = 5.0
"""Seconds after which a pose says nothing any more: the robot was taken away, or its transforms never come."""
TOO_FAST = 3.0
"""Times its base's limit of speed: a teammate that seems faster was set down elsewhere."""
_STEP = 0.2
"""Metres between two outlines of a teammate on its way, at most: less than the length of any robot."""


class NearTeammate(NamedTuple):
    """A teammate that may be in the way."""

    robot_id: int
    points: Floats
    """(2, n): its border on all its way until it stands, in the base frame of the robot that looks."""
    gap: float
    """Metres to stop before it."""
    clearance: float
    """Metres that its outline has grown."""


class _TrackedTeammate:
    """What is known of one teammate."""

    def __init__(self, robot_id: int, base: Base) -> None:
        self.robot_id, self.base, self.frame = robot_id, base, names.robot_frame(robot_id, names.BASE_FOOTPRINT)
        self.outline, self.braking = outline_of(base.footprint), limits_of(base).least_braking
        self._too_fast = TOO_FAST * max(base.max_vel_x, base.max_vel_y)
        self.pose: Pose2 | None = None
        """In `map`."""
        self.stamp, self.age, self.x, self.y, self.speed = 0, 0.0, 0.0, 0.0, 0.0
        """When it was there (ns; 0 = it never moves), how many seconds ago, and how fast, in `map` (m/s)."""

    def update(self, pose: Pose2, stamp: int, age: float) -> None:
        """It was at `pose`, so many seconds ago."""
        last, seconds = self.pose, (stamp - self.stamp) / 1e9
        if last is None or seconds < 0.0 or not stamp:
            self.x = self.y = self.speed = 0.0
        elif seconds > 0.0:
            self.x, self.y = (pose.x - last.x) / seconds, (pose.y - last.y) / seconds
            self.speed = math.hypot(self.x, self.y)
            if self.speed > self._too_fast:
                self.x = self.y = self.speed = 0.0
        self.pose, self.stamp, self.age = pose, stamp, age

    def near(self, here: Pose2, x: float, y: float, radius: float, reaction: float) -> NearTeammate | None:
        """It, if it may come into this disc of the map (m), braking `reaction` seconds from now; `here` is the pose in
        `map` of the robot that looks."""
        if self.pose is None:
            return None
        way = self.speed * (self.age + reaction + 0.5 * self.speed / self.braking)
        growth = 0.0 if self.age <= GRACE else min(MAX_GROWTH, (self.age - GRACE) * max(self.speed, GROWTH))
        if math.hypot(self.pose.x - x, self.pose.y - y) - self.outline.radius > radius + way + growth:
            return None
        at, cos, sin = here.inverse().compose(self.pose), math.cos(here.yaw), math.sin(here.yaw)
        vx, vy = cos * self.x + sin * self.y, cos * self.y - sin * self.x
        cos, sin, (x, y) = math.cos(at.yaw), math.sin(at.yaw), self.outline.border
        border = np.array((at.x + cos * x - sin * y, at.y + sin * x + cos * y))
        if vx * at.x + vy * at.y > RECEDES * math.hypot(at.x, at.y):
            # It comes no nearer, should it stop at once.
            return NearTeammate(self.robot_id, border, FOLLOWING_GAP, growth)
        if way:
            count = math.ceil(way / _STEP)
            seconds = np.arange(count + 1) * (way / count / math.hypot(vx, vy))
            border = (border[:, :, None] + np.array((vx, vy))[:, None, None] * seconds).reshape(2, -1)
        return NearTeammate(self.robot_id, border, GAP, growth)


class TeammateTracker:
    """Tracks the teammates of one robot."""

    def __init__(self) -> None:
        self._known: dict[int, _TrackedTeammate] = {}
        self._here: Pose2 | None = None
        """Of the robot in `map`, in this step."""

    def look(self, view: View) -> None:
        known, self._known, self._here = self._known, {}, own_pose(view)
        for robot_id in sorted({*view.bases, *view.team} - {view.robot_id}):
            base, mate = view.bases.get(robot_id, DEFAULT_BASE), known.get(robot_id)
            mate = self._known[robot_id] = mate if mate and mate.base is base else _TrackedTeammate(robot_id, base)
            at = view.lookup(names.MAP_FRAME, mate.frame)
            age = (view.now - at[1]) / 1e9 if at is not None and at[1] else 0.0
            if at is None or age > FORGET_AFTER or not math.isfinite(sum(at[0])):
                mate.pose = None
            else:
                mate.update(*at, max(0.0, age))

    def near(self, x: float, y: float, radius: float, reaction: float) -> list[NearTeammate]:
        """The teammates that may come into a disc of the base frame (m), braking `reaction` seconds from now."""
        here = self._here
        if here is None or not self._known:
            return []
        x, y, _ = here.compose(Pose2(x, y, 0.0))
        found = (mate.near(here, x, y, radius, reaction) for mate in self._known.values())
        return [mate for mate in found if mate is not None]


SPAN = 3.0
"""Metres of travel that are remembered: longer, and the odometry's error outgrows the margins."""
REACH = 4.0
"""Metres: points further from the laser are not remembered. More than SPAN and a braking distance."""
_FINEST = math.radians(1.0)
"""Of beams so close together the nearest hit is a point: 5 mm apart where the corners of an erratic turn."""
_PUT = 0.02
"""Metres that a base may back up where it was put down and still has room to turn."""
_WEARS = 0.5
"""Metres of way behind it that a base no longer knows when it has turned by a radian."""


class Surroundings:
    """What one robot knows."""

    def __init__(self) -> None:
        self._scan: LaserScan | None = None
        self._pose: Pose2 | None = None
        """Of the base in `odom`."""
        self._forget()

    def _forget(self) -> None:
        """The robot is somewhere else."""
        self.sight = LaserCoverage()
        self._known, self._travelled = np.empty((3, 0)), 0.0
        """x and y of the points, and how far the base had travelled when each was seen (m). As it moves they
        are told in its frame anew."""
        self._room = 0.0
        """Metres that the base may back up over ground that it drove over; below 0: so far it backed up over other."""

    @property
    def points(self) -> Floats:
        """(2, n) in the base frame: what stands around."""
        return self._known[:2]

    @property
    def has_room(self) -> bool:
        """Whether the ground that the corners come to in a turn was seen, or the base was put down there."""
        return self._room >= -_PUT or self.sight.looks(0.0, math.pi)

    def update(self, view: View, reach: float) -> None:
        """See what the view shows, at least up to `reach` metres away."""
        self._pose = self._move(view.odom, reach)
        if view.scan is not None and view.scan is not self._scan:
            self._scan, beams = view.scan, beams_of(view.scan)
            self.sight.beams = beams
            self.sight.range = view.scan.range_max if view.scan.range_max > 0.0 else math.inf
            if beams is not None:
                self.sight.update(beams, view.laser, self._pose.yaw if self._pose else 0.0, view.now)
                (start, step, _), way = beams.laser, self._travelled
                few = max(1, int(_FINEST / max(abs(step), 1e-9) + 1e-6))
                self._known = kernels.see(
                    self._known, beams.axes, beams.distances, (start, step), few,
                    (*view.laser, 0.0), max(REACH, reach), way, way - SPAN,
                )  # fmt: skip

    def _move(self, odom: Odometry | None, reach: float) -> Pose2 | None:
        """The base is where odometry says; the pose in `odom` by which points are told now."""
        last, pose = self._pose, None if odom is None else pose2_of(odom.pose.pose)
        if pose is not None and not math.isfinite(sum(pose)):
            return last
        if last is None or pose is None or math.hypot(pose.x - last.x, pose.y - last.y) > reach:
            # It was set down here, or it is not known where the points are now.
            self._forget()
        elif pose != last:
            x, y, turn = last.inverse().compose(pose)
            turn, way = normalize_angle(turn), math.hypot(x, y)
            self._travelled += way
            kernels.move_points(self._known, x, y, turn)
            forwards = math.cos(0.5 * turn) * x + math.sin(0.5 * turn) * y > 0.9 * way
            self._room = min(SPAN, self._room + way) if forwards else self._room - way
            self._room = max(min(0.0, self._room), self._room - _WEARS * abs(turn))
        return pose
