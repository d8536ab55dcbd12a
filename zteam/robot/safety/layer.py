"""The layer under everything that drives: nothing moves on old data, into an obstacle, or faster than the limits.

A commanded arc is looked at for as long as the base needs to stop on it, and is slowed down so far that the base can
stop before what it would meet. Text that says why is the same from step to step, so that a robot's status changes only
with the cause.
"""

from zteam import names
from zteam.geometry import Velocity
from zteam.messages import Twist, ns_from_time
from zteam.messages.base import Base
from zteam.reasons import Reason
from zteam.robot.safety.motion import (
    NO_NUMBER,
    STANDING,
    admissible,
    at_least,
    limits_of,
    outline_of,
    share_of,
    swept_disc,
)
from zteam.robot.safety.surroundings import GAP as TEAMMATE_GAP
from zteam.robot.safety.surroundings import STALE_AFTER, Surroundings, TeammateTracker
from zteam.robot.view import View

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
        self._mates.look(view)
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
        return asked.scale(share), Reason(f"no laser looks {where}", slows=True)

    def _avoid(self, motion: Velocity) -> tuple[Velocity, str]:
        """What is left of a motion: slower, but turning as was wanted where there is room; else straight on."""
        share, mate = self._share(motion) if motion != STANDING else (1.0, None)
        if share >= 1.0:
            return motion, ""
        slow = motion.scale(share)
        if motion.turn and motion.speed and self._limits.turns_apart:
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
