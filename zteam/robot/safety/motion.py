"""How a base moves: what it sweeps along an arc, when it meets given points there, and its limits.

The outline counts as convex: its hull is some half-planes, and a point's depth in the hull is the largest of its
distances from them (below 0 inside). When a point is met is computed, not searched for in steps.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Point2, Pose2, Velocity, convex_hull
from zteam.kernels import safety as kernels
from zteam.messages import Twist, Vector3
from zteam.messages.base import Base
from zteam.robot.view import View

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


class Outline:
    """The convex hull of a footprint, in `base_footprint`."""

    def __init__(self, footprint: tuple[Point2, ...]) -> None:
        corners = np.array(convex_hull(footprint))
        self.corners = corners
        """(n, 2), counter-clockwise."""
        along = np.roll(corners, -1, axis=0) - corners
        along /= np.hypot(along[:, 0], along[:, 1])[:, None]
        sides = np.column_stack((along[:, 1], -along[:, 0]))
        tips = sides + np.roll(sides, 1, axis=0)
        normals, at = np.vstack((sides, tips / np.hypot(*tips.T)[:, None])), np.vstack((corners, corners))
        self.rows: Floats = np.column_stack((normals, (normals * at).sum(axis=1)))
        """(n, 3): outward normals of length 1, offsets (inside, normal @ point is less). Of sides and at corners:
        beside a right angle a distance is then less than 8 % too little, and not 29 %."""
        self.radius = float(np.hypot(corners[:, 0], corners[:, 1]).max())
        """Metres from the origin to the furthest corner."""
        self._tips: list[list[float]] = corners.tolist()
        self.border = _border(corners)
        """(2, m): points on the outline, at most _EDGE apart."""

    def distances(self, points: Floats) -> Floats:
        """Of points (2, m): metres from the hull, below 0 inside; too little beside a corner."""
        found: Floats = np.maximum.reduce(self.rows[:, :2] @ points - self.rows[:, 2:3])
        return found

    def fastest(self, motion: Velocity) -> float:
        """m/s of the fastest corner."""
        x, y, turn = motion
        return max([math.hypot(x - turn * up, y + turn * along) for along, up in self._tips])


outline_of = lru_cache(maxsize=256)(Outline)
"""The outline of a footprint: the same object for equal ones."""


def _border(corners: Floats) -> Floats:
    parts = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = min(_MOST, math.ceil(float(np.hypot(*(end - start))) / _EDGE))
        parts.append(start[:, None] + (end - start)[:, None] * (np.arange(count) / count))
    return np.hstack(parts)


def margin_of(outline: Outline, motion: Velocity) -> float:
    """Metres to keep free around the outline on this arc."""
    speed = motion.speed
    fastest = speed + abs(motion.turn) * outline.radius
    return SPIN_MARGIN + (DRIVE_MARGIN - SPIN_MARGIN) * (speed / fastest if fastest else 0.0)


def place_after(motion: Velocity, seconds: float) -> Pose2:
    """Where the base is then, in its frame of now."""
    x, y, turn = motion
    angle = turn * seconds
    if abs(angle) < STRAIGHT:
        return Pose2(x * seconds, y * seconds, angle)
    ahead, aside = math.sin(angle) / turn, (1.0 - math.cos(angle)) / turn
    return Pose2(x * ahead - y * aside, x * aside + y * ahead, angle)


def swept_disc(outline: Outline, motion: Velocity, seconds: float) -> tuple[float, float, float]:
    """A disc that all lies in that `motion` sweeps within `seconds`, with the margin: x, y and radius in metres."""
    x, y, _ = place_after(motion, 0.5 * seconds)
    return x, y, 0.5 * motion.speed * seconds + outline.radius + margin_of(outline, motion)


def meeting_time(outline: Outline, motion: Velocity, seconds: float, points: Floats, clearance: float = 0.0) -> float:
    """When within `seconds` the base first comes nearer to a point of (2, n) than the margin and `clearance` (m).

    inf if it does not. Where it is nearer to a point than that now, what counts is when it comes nearer still to that
    one, or as near to another: so a base may always move away, and along a wall.
    """
    margin, (x, y, radius) = margin_of(outline, motion) + clearance, swept_disc(outline, motion, seconds)
    return kernels.meet(np.ascontiguousarray(points), outline.rows, motion, seconds, margin, (x, y, radius + clearance))


def admissible(
    points: Floats, hull: Outline, arc: Velocity, braking: float, reaction: float,
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


NO_NUMBER = "the driver asks for a velocity that is no number"
BRAKING = 1.0
"""m/s²: how hard a base counts as braking that tells no limit: none stops at once. `wander` counts on the same."""
TURN_BRAKING = 3.2
"""rad/s², likewise: a stop from the fastest turn of an erratic in a second."""
STOPPING, TURN_STOPPING = 2.5, 8.0
"""m/s² and rad/s²: how hard such a base is made to stop when data is old or a leader is gone: an erratic stands within
0.4 s, and so within 0.5 s of the loss."""
LEAST = 1e-6
"""m/s and rad/s: no base moves so slowly, and a way divided by less would be no number."""
_WHEELBASE_SHARE = 0.5
"""Of the outline's length: the wheelbase of a car that does not tell it. Shorter turns more sharply."""
_FASTER = 0.02
"""m/s and rad/s more than commanded that odometry may say for nothing."""

STANDING = Velocity()


class BaseLimits:
    """The limits of one base. Motions are what the base does; a car's command is an angle of its wheels instead."""

    def __init__(self, base: Base) -> None:
        self._base = base
        self.is_car, self._is_omni = base.drive == "car", base.drive == "omni"
        reach = [x for x, _ in base.footprint]
        self.wheelbase = base.wheelbase or _WHEELBASE_SHARE * (max(reach) - min(reach))
        """Metres from axle to axle of a car."""
        self._most_y = base.max_vel_y if self._is_omni else 0.0
        bounds = base.acc_lim_x, base.decel_lim_x, base.decel_lim_reverse, base.acc_lim_y, base.acc_lim_theta
        self._has_accelerations = any(map(math.isfinite, bounds))
        # Backwards a base gains speed no harder than it brakes forwards: that is the simulator's bound.
        self._gain = base.acc_lim_x, min(base.acc_lim_x, -base.decel_lim_x)
        back = base.decel_lim_reverse if math.isfinite(base.decel_lim_reverse) else -base.decel_lim_x
        self._loss = -base.decel_lim_x, back
        self._braking = tuple(loss if math.isfinite(loss) else BRAKING for loss in self._loss)
        self._side_braking = base.acc_lim_y if math.isfinite(base.acc_lim_y) else BRAKING
        self.least_braking = min(*self._braking, self._side_braking if self._is_omni else math.inf)
        self._turn_braking = base.acc_lim_theta if math.isfinite(base.acc_lim_theta) else TURN_BRAKING

    def motion_of(self, wanted: Twist) -> Velocity | None:
        """What the base makes of a command within its limits of speed; None if that is no number."""
        x, y, turn = wanted.linear.x, wanted.linear.y if self._is_omni else 0.0, wanted.angular.z
        if not (math.isfinite(x) and math.isfinite(turn) and math.isfinite(y)):
            return None
        motion = Velocity(float(x), float(y), float(turn))
        if self.is_car:
            x = max(self._base.min_vel_x, min(self._base.max_vel_x, motion.x))
            motion = Velocity(x * math.cos(motion.turn), 0.0, x * math.sin(motion.turn) / self.wheelbase)
        return self.clamp(motion)

    def command_of(self, motion: Velocity) -> Twist:
        """The command that makes the base do this."""
        x, y, turn = motion
        if self.is_car:
            angle = math.atan2(math.copysign(turn, turn * x) * self.wheelbase, abs(x)) if x else 0.0
            x, turn = math.copysign(math.hypot(x, turn * self.wheelbase), x) if x else 0.0, angle
        return Twist(Vector3(x, y), Vector3(0.0, 0.0, turn))

    def clamp(self, wanted: Velocity) -> Velocity:
        """`wanted` within the limits of speed; what is less than LEAST is 0."""
        x, y, turn = [part if abs(part) >= LEAST else 0.0 for part in wanted]
        base, most_y = self._base, self._most_y
        x, turn = max(base.min_vel_x, min(base.max_vel_x, x)), max(-base.max_vel_theta, min(base.max_vel_theta, turn))
        return Velocity(x, max(-most_y, min(most_y, y)), turn)

    def approach(self, wanted: Velocity, last: Velocity, seconds: float) -> Velocity:
        """What comes of `wanted` in `seconds` within the limits of acceleration, if the base has any."""
        if not self._has_accelerations:
            return wanted
        x = _approach(wanted.x, last.x, self._gain[wanted.x < 0.0] * seconds, self._loss[last.x < 0.0] * seconds)
        turning, sideways = self._base.acc_lim_theta * seconds, self._base.acc_lim_y * seconds
        # The wheels of a car that slows down take its turn with them.
        turn = _approach(wanted.turn, last.turn, turning, math.inf if self.is_car else turning)
        if self.is_car and (x != wanted.x or wanted.turn * last.turn < 0.0):
            # They go through straight on, and are never turned more sharply than was asked for.
            sharpest = abs(wanted.turn * x / wanted.x) if wanted.x and wanted.turn * last.turn >= 0.0 else 0.0
            turn = max(-sharpest, min(sharpest, turn))
        return Velocity(x, _approach(wanted.y, last.y, sideways, sideways), turn)

    def brake(self, last: Velocity, seconds: float) -> Velocity:
        """The motion after braking for `seconds`: along the same arc, as hard as all parts can."""
        if self._has_accelerations:
            longest = self.stop_time(last)
        else:
            straight, turning = last.speed / STOPPING, abs(last.turn) / TURN_STOPPING
            longest = straight if self.is_car else max(straight, turning)
        return last.scale(1.0 - seconds / longest) if longest > seconds else STANDING

    def longest_way(self, reaction: float) -> float:
        """Metres until the base stands that begins to brake `reaction` seconds from now, at most."""
        fastest = max(self._base.max_vel_x, -self._base.min_vel_x, self._most_y)
        return fastest * (reaction + 0.5 * fastest / self.least_braking)

    def stop_time(self, motion: Velocity) -> float:
        """Seconds that braking along the arc takes."""
        straight = max(abs(motion.x) / self._braking[motion.x < 0.0], abs(motion.y) / self._side_braking)
        return straight if self.is_car else max(straight, abs(motion.turn) / self._turn_braking)

    def measure(self, told: Velocity, view: View) -> Velocity | None:
        """The velocity that odometry says, if the base is faster than it was told to be in some part; else None."""
        if view.odom is None:
            return None
        linear, angular = view.odom.twist.twist.linear, view.odom.twist.twist.angular
        x, y, turn = linear.x, linear.y if self._is_omni else 0.0, angular.z
        is_faster = any(abs(a) > abs(b) + _FASTER for a, b in zip((x, y, turn), told, strict=True))
        return Velocity(float(x), float(y), float(turn)) if is_faster and math.isfinite(x + turn + y) else None


limits_of = lru_cache(maxsize=256)(BaseLimits)
"""The limits of a base: worked out once, for a robot looks at those of its teammates in each step."""


def limit_speed(wanted: Twist, base: Base) -> tuple[Twist, str]:
    """Without the safety layer: `wanted` within the limits of speed, and why it was cut ("" = it was not)."""
    limits = limits_of(base)
    motion = limits.motion_of(wanted)
    return (Twist(), NO_NUMBER) if motion is None else (limits.command_of(motion), "")


def at_least(motion: Velocity, measured: Velocity | None) -> Velocity:
    """`motion`, with each part as large as it is `measured` where the base is faster than it was told to be."""
    if measured is None:
        return motion
    return Velocity(*[math.copysign(max(abs(a), abs(b)), a) if a else a for a, b in zip(motion, measured, strict=True)])


def _approach(wanted: float, last: float, gain: float, loss: float) -> float:
    """`wanted`, but at most `gain` faster and `loss` slower than `last`; turning round means losing speed first."""
    if wanted * last < 0.0:
        left = abs(last) - loss
        return math.copysign(left, last) if left > 0.0 else math.copysign(min(abs(wanted), gain), wanted)
    size = min(max(abs(wanted), abs(last) - loss), abs(last) + gain)
    return math.copysign(size, last if wanted == 0.0 else wanted)
