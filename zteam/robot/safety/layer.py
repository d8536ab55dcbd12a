"""The layer under everything that drives: nothing moves on old data, into an obstacle, or faster than the limits.

A commanded arc is looked at for as long as the base needs to stop on it, and is slowed down so far that the base can
stop before what it would meet. Text that says why is the same from step to step, so that a robot's status changes only
with the cause.

What stands around a robot is one set of points that stay where they are in `odom`. The newest scan clears what it sees
through and adds its hits. What it does not look at stays for the last metres of travel, but for points at teammates.
A beam that says nothing neither clears nor adds. Teammates are placed by their poses, because the laser looks over low
bodies, and lasers dazzle each other.
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
from zteam.messages import LaserScan, Odometry, Twist, ns_from_time
from zteam.messages.base import DEFAULT_BASE, Base
from zteam.messages.planar import pose2_of
from zteam.reasons import Reason
from zteam.robot.safety.motion import (
    NO_NUMBER,
    STANDING,
    Outline,
    admissible,
    at_least,
    limits_of,
    outline_of,
    place_after,
    share_of,
    swept_disc,
)
from zteam.robot.view import Beams, Teammate, View, beams_of, own_pose

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


TEAMMATE_GAP = 0.3
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
BODY = 0.1
"""Metres beside a teammate within which a hit is on that one."""
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
        cos, sin, (xs, ys) = math.cos(at.yaw), math.sin(at.yaw), self.outline.border
        border = np.array((at.x + cos * xs - sin * ys, at.y + sin * xs + cos * ys))
        if vx * at.x + vy * at.y > RECEDES * math.hypot(at.x, at.y):
            # It comes no nearer, should it stop at once.
            return NearTeammate(self.robot_id, border, FOLLOWING_GAP, growth)
        if way:
            count = math.ceil(way / _STEP)
            seconds = np.arange(count + 1) * (way / count / math.hypot(vx, vy))
            border = (border[:, :, None] + np.array((vx, vy))[:, None, None] * seconds).reshape(2, -1)
        return NearTeammate(self.robot_id, border, TEAMMATE_GAP, growth)


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

    def bodies(self) -> list[tuple[Pose2, Outline]]:
        """Where those are whose poses are fresh, in the base frame, and what they are like."""
        to_base = None if self._here is None else self._here.inverse()
        fresh = [(mate.pose, mate.outline) for mate in self._known.values() if mate.pose and mate.age <= GRACE]
        return [] if to_base is None else [(to_base.compose(pose), outline) for pose, outline in fresh]

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

    def forget(self, bodies: Iterable[tuple[Pose2, Outline]]) -> None:
        """Forget the points at teammates that the laser does not see wholly. Their poses (base frame) say where they
        are, and hits on them would stay when they have driven on."""
        for pose, outline in bodies:
            away = max(math.hypot(pose.x, pose.y), outline.radius)
            if away < REACH and not self.sight.looks(math.atan2(pose.y, pose.x), outline.radius / away):
                points = self._known.copy()
                kernels.move_points(points, *pose)
                self._known = self._known.compress(outline.distances(points[:2]) > BODY, axis=1)

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


GAP = 0.15
"""Metres that a robot stops before what it would drive into."""
SHORTEST = 0.05
"""Seconds until the next command, at least, whatever the last step took."""
FIRST, FIRST_TICK = 2.0, 0.1
"""Seconds until the next command (no tick is known yet) that the first step is safe for, and reckons with."""
HYSTERESIS = 0.05
"""Metres more than the gap that have to be free before a robot that was stopped drives the same way again."""
UNSEEN = 0.2
"""m/s of the fastest corner, at most, where no laser looks: what was never seen is met so."""


class SafetyLayer:
    """Limits the velocities of one robot. It remembers what came before: make a new one when time has jumped back."""

    def __init__(self) -> None:
        self._base: Base | None = None
        self._last = STANDING
        """What the base was told to do last."""
        self._held: tuple[bool, bool] | None = None
        """Which way the motion went that was stopped last: forwards or not, left or not; None while it is free."""
        self._mates = TeammateTracker()
        self._reaction, self._extra = FIRST, 0.0
        """In this step: seconds until the next command, metres that are to be free besides the gaps."""
        self._measured: Velocity | None = None
        """What odometry says of a base that is faster than it was told to be."""

    def limit(self, wanted: Twist, view: View, reason: str = "") -> tuple[Twist, str]:
        """`wanted` as far as it is safe, and why it was cut ("" = it was not).

        Only x and yaw are passed on, and y to an omni base: the others have no other way to move. The numbers are
        plain ones, whatever was wanted. With a `reason` a wanted stop is due to data that the driver lacks: the base
        then brakes evenly.
        """
        if view.base is not self._base:
            self._base, self._outline, self._limits = view.base, outline_of(view.base.footprint), limits_of(view.base)
            self._around = Surroundings()
        trouble, asked = old_scan(view), self._limits.motion_of(wanted)
        seconds, self._reaction = (max(view.dt, SHORTEST),) * 2 if view.dt else (FIRST_TICK, FIRST)
        if not trouble:
            self._around.update(view, self._limits.longest_way(self._reaction) + self._outline.radius + 0.5)
            self._mates.look(view)
            self._around.forget(self._mates.bodies())
            trouble = NO_NUMBER if asked is None else ""
        if asked is None or trouble or (reason and asked == STANDING):
            motion = self._limits.brake(self._last, seconds)
        else:
            asked = self._limits.approach(asked, self._last, seconds)
            motion, trouble = self._cut(asked, view)
            if motion != self._limits.approach(motion, self._last, seconds):
                # What lies between the two was not looked at. The way of the last command was: with even braking.
                motion = self._limits.brake(self._last, seconds)
        self._last = motion
        return self._limits.command_of(motion), trouble

    def halt(self, view: View) -> None:
        """The robot is commanded zero velocity, whatever was wanted: its base brakes as hard as it can."""
        self.limit(Twist(), view)
        self._last, self._held = STANDING, None

    def _cut(self, asked: Velocity, view: View) -> tuple[Velocity, str]:
        """`asked` as far as nothing stands in its way, and why it is less ("" = it is not)."""
        if asked == STANDING:
            return asked, ""
        self._extra = HYSTERESIS if self._held == _way_of(asked) else 0.0
        self._measured = self._limits.measure(self._last, view)
        slow, cause = self._slow_down_unseen(asked, view)
        motion, why = self._avoid(slow)
        cause = why or cause
        if motion != slow:
            # It may lead over other ground. A turn on the spot that is left then was not looked at.
            seen, why = self._slow_down_unseen(motion, view)
            cause = cause or why
            motion = seen if seen.speed or not motion.speed else self._avoid(seen)[0]
        self._held = _way_of(asked) if (asked.speed and not motion.speed) or motion == STANDING else None
        return motion, cause

    def _slow_down_unseen(self, asked: Velocity, view: View) -> tuple[Velocity, str]:
        """`asked` as far as the ground that it leads over is seen."""
        sight, real, side = self._around.sight, at_least(asked, self._measured), _side_of(asked)
        if real == STANDING:
            return asked, ""
        braking = self._limits.stop_time(real)
        seconds, forwards = self._reaction + 0.5 * braking, real.x > 0.0 and abs(real.y) <= 0.5 * real.x
        is_blind = forwards if sight.beams is None else real.speed and sight.silent.size
        if is_blind and sight.beams is not None:
            is_blind = sight.is_blind(self._outline, real, seconds, view.teammates)
        if is_blind:
            return Velocity(turn=asked.turn), f"blind {side}"
        is_seen = sight.looks_along(real, seconds, forwards)
        if is_seen and not (real.turn and not self._around.has_room):
            # What is beyond its range no laser has seen.
            share = share_of(sight.range / real.speed, braking, self._reaction, real.speed) if forwards else 1.0
        else:
            share = min(1.0, UNSEEN / self._outline.fastest(real))
        if share >= 1.0:
            return asked, ""
        where = "behind" if is_seen and not forwards else side
        return asked.scale(share), Reason(f"it cannot see {where}", slows=True)

    def _avoid(self, motion: Velocity) -> tuple[Velocity, str]:
        """What is left of a motion: slower, but turning as was wanted where there is room; else straight on."""
        share, mate = self._share(motion) if motion != STANDING else (1.0, None)
        if share >= 1.0:
            return motion, ""
        slow = motion.scale(share)
        # A car turns the less, the more slowly it drives.
        if motion.turn and motion.speed and not self._limits.is_car:
            turning = slow._replace(turn=motion.turn)
            free, _ = self._share(turning)
            if free >= 1.0 or not share:
                slow = turning.scale(free)
            if slow == STANDING:
                # The tail of a robot beside a wall has room to drive on, but not to turn.
                straight = motion._replace(turn=0.0)
                slow = straight.scale(self._share(straight)[0])
        is_stopped = not slow.speed and (motion.speed or not slow.turn)
        return slow, _before(mate, _side_of(motion)) if is_stopped else ""

    def _share(self, motion: Velocity) -> tuple[float, int | None]:
        """The share of its speed at which `motion` can stop before all, and the robot that it would meet first; None
        for an obstacle."""
        outline, reaction, extra = self._outline, self._reaction, self._extra
        real = at_least(motion, self._measured)
        braking, met = self._limits.stop_time(real), None
        least = admissible(self._around.points, outline, real, braking, reaction, GAP, extra=extra)
        seconds = reaction + 0.5 * braking + (TEAMMATE_GAP + extra) / (real.speed + abs(real.turn) * outline.radius)
        for mate in self._mates.near(*swept_disc(outline, real, seconds), reaction):
            share = admissible(mate.points, outline, real, braking, reaction, mate.gap, mate.clearance, extra)
            if share < least or (share == least < 1.0 and met is None):
                least, met = share, mate.robot_id
        return least, met


def _before(robot: int | None, side: str) -> str:
    """Why it is stopped: by this robot, or by an obstacle, on this side."""
    return f"obstacle {side}" if robot is None else Reason(f"{names.robot_name(robot)} {side}", blocked_by=robot)


def _side_of(motion: Velocity) -> str:
    is_beside = abs(motion.y) > abs(motion.x) or not motion.x
    return "beside" if is_beside else "ahead" if motion.x > 0.0 else "behind"


def _way_of(motion: Velocity) -> tuple[bool, bool]:
    return motion.x > 0.0, not motion.x and (motion.y or motion.turn) > 0.0


def old_scan(view: View) -> str:
    """Why the scan cannot be driven by: there is none, it is of no use, or it is old; empty if it can."""
    if view.scan is None:
        return f"needs {view.scan_needs}" if view.scan_needs else "no scan yet"
    return "" if view.is_fresh(ns_from_time(view.scan.header.stamp), STALE_AFTER) else "stale scan"


def make_safe(wanted: Twist, view: View) -> tuple[Twist, str]:
    """What a new `SafetyLayer` makes of `wanted`, and why it was cut ("" = it was not)."""
    return SafetyLayer().limit(wanted, view)
