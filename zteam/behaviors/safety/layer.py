"""The layer under everything that drives: nothing moves on old data, into an obstacle, or faster than the limits.

A commanded arc is looked at for as long as the base needs to stop on it, and is slowed down so far that the base can
stop before what it would meet. Text that says why is the same from step to step, so that a robot's status changes only
with the cause.
"""

import math

import msgspec

from zteam import names
from zteam.base import Base
from zteam.behaviors.safety.blindness import CREEP, CREEPS, find_blind_spot, is_surely_seen
from zteam.behaviors.safety.limits import LEAST, NO_NUMBER, STANDING, Limits, Motion
from zteam.behaviors.safety.silence import STALE_AFTER
from zteam.behaviors.safety.stopping import Stoppers, Way
from zteam.behaviors.safety.surroundings import GAP, Surroundings
from zteam.behaviors.safety.swept import DRIVE_MARGIN, Arc, Outline, meeting_time, outline_of, swept_box, swings
from zteam.behaviors.safety.teammates import GAP as TEAMMATE_GAP
from zteam.behaviors.safety.teammates import Near, Teammates
from zteam.behaviors.view import View
from zteam.messages import Twist, Vector3, ns_from_time

REACTION = 0.1
"""Seconds until the next command where the view does not tell (`dt` 0): Stage's tick."""
SHORTEST, LONGEST = 0.05, 0.5
"""Seconds between which the time until the next command is taken to be, whatever the last step took."""
HYSTERESIS = 0.05
"""Metres more than the gap that have to be free before a robot that was stopped drives the same way again."""
SLOWEST = 0.02
"""m/s of the fastest corner: what has to be slower than this stands, so that nothing crawls at the edge."""


class Cut(msgspec.Struct, frozen=True):
    """What is left of a wanted motion, and why ("" = all)."""

    motion: Motion
    cause: str


class Approach(msgspec.Struct, frozen=True):
    """How a base comes to meet things on an arc."""

    limits: Limits
    outline: Outline
    seconds: float
    """Until the next command."""

    def stop_seconds(self, motion: Motion) -> float:
        """Seconds of the arc at full speed that are as long as the way until the base stands."""
        return self.seconds + 0.5 * self.limits.stop_time(motion)

    def gap_seconds(self, motion: Motion, extra: float) -> tuple[float, float]:
        """Seconds of the arc for each metre of a gap, which counts as far as the base drives; for `extra` metres."""
        speed, turn = self.limits.arc(motion)
        fastest = abs(speed) + abs(turn) * self.outline.radius
        return abs(speed) / fastest**2, extra / fastest

    def needed_seconds(self, motion: Motion, gap: float, extra: float) -> float:
        """Seconds of the arc at full speed after which nothing counts any more that asks for `gap` metres."""
        a_metre, more = self.gap_seconds(motion, extra)
        return self.stop_seconds(motion) + a_metre * gap + more

    def share(self, motion: Motion, free: float) -> float:
        """The share of its speed at which the base can stop in the first `free` seconds of the arc at full speed."""
        if free <= 0.0:
            return 0.0
        braking = self.limits.stop_time(motion)
        share = (math.sqrt(self.seconds**2 + 2.0 * braking * free) - self.seconds) / braking
        speed, turn = self.limits.arc(motion)
        crawls = share * (abs(speed) + abs(turn) * self.outline.radius) < SLOWEST
        return 0.0 if share < 1.0 and crawls else min(1.0, share)


class Obstacles(msgspec.Struct, frozen=True):
    """What may stand in a robot's way."""

    around: Surroundings
    stoppers: Stoppers
    mates: list[Near]
    extra: float
    """Metres that are to be free besides the gaps."""

    def free_share(self, motion: Motion, approach: Approach) -> tuple[float, int]:
        """The share of its speed at which `motion` can stop before all, and the id of the robot met first, or -1."""
        # Where a stop is certain it depends on the teammates whether the rest is looked at.
        asked = motion, approach.seconds, self.extra, not self.mates
        free, more = self.around.known.get(asked) or self.around.keep(asked, self._free_of_things(motion, approach))
        first = -1
        if self.mates:
            free, first = self._free_of_mates(motion, approach, free)
        return (1.0 if free == math.inf else approach.share(motion, free - more)), first

    def _free_of_things(self, motion: Motion, approach: Approach) -> tuple[float, float]:
        """Seconds of the arc until the base is GAP before something; and how many are to be free besides.

        Without teammates it may be any time that is not enough, where it is not enough.
        """
        outline, arc = approach.outline, Arc(*approach.limits.arc(motion))
        a_metre, more = approach.gap_seconds(motion, self.extra)
        seconds = approach.stop_seconds(motion) + more + a_metre * GAP
        reach = abs(arc.speed) * seconds + outline.radius + DRIVE_MARGIN
        back = self._back(outline, arc, reach)
        if self.around.is_clear(reach, back):
            return math.inf, more
        way = Way(outline, arc, seconds, a_metre * GAP + more)
        if not self.mates and self.stoppers.stop(way, self.around.sight):
            return 0.0, more
        points = self.around.points(swept_box(outline, arc, seconds), reach, back)
        if not points.size:
            return math.inf, more
        free = meeting_time(outline, arc, seconds, points) - a_metre * GAP
        if free <= more:
            self.stoppers.note(way, self.around.sight, points)
        return free, more

    def _free_of_mates(self, motion: Motion, approach: Approach, free: float) -> tuple[float, int]:
        """Seconds of the arc until the base is so near to a teammate as it may be, or `free` where that is less; and
        the teammate's id, or -1."""
        outline, arc, first = approach.outline, Arc(*approach.limits.arc(motion)), -1
        a_metre, more = approach.gap_seconds(motion, self.extra)
        stops = approach.stop_seconds(motion) + more
        widest = swept_box(outline, arc, stops + a_metre * TEAMMATE_GAP)
        for mate in self.mates:
            if not mate.may_be_in(widest):
                continue
            seconds = stops + a_metre * mate.gap
            if mate.gap == TEAMMATE_GAP or mate.may_be_in(swept_box(outline, arc, seconds)):
                met = meeting_time(outline, arc, seconds, mate.points, mate.clearance)
                if met - a_metre * mate.gap < free:
                    free, first = met - a_metre * mate.gap, mate.robot_id
        return free, first

    def _back(self, outline: Outline, arc: Arc, reach: float) -> float:
        """How far (m) the memory is to be asked: all that is reached, only beside the base, or not (0)."""
        if not self.around.sees_all(arc.speed):
            return reach
        return outline.radius + DRIVE_MARGIN if swings(outline, arc) else 0.0


class SafetyLayer:
    """Limits the velocities of one robot; it remembers what came before, so each robot has its own.

    Make a new one when time has jumped back.
    """

    def __init__(self) -> None:
        self._base: Base | None = None
        self._last = STANDING
        self._held: tuple[bool, bool] | None = None
        """Which way the motion went that was stopped last: forwards or not, left or not; None while it is free."""
        self._mates = Teammates()

    def limit(self, wanted: Twist, view: View, reason: str = "") -> tuple[Twist, str]:
        """`wanted` as far as it is safe, and why it was cut ("" = it was not).

        Only x and yaw are passed on: the bases have no other way to move. The numbers are plain ones, whatever was
        wanted. With a `reason` a wanted stop is due to data that the driver lacks: the base then brakes evenly.
        """
        if view.base is not self._base:
            self._take_base(view.base)
        trouble = old_scan(view)
        seconds = min(max(view.dt, SHORTEST), LONGEST) if view.dt else REACTION
        x, turn = wanted.linear.x, wanted.angular.z
        if not trouble:
            self._around.take(view)
            if not (math.isfinite(x) and math.isfinite(turn)):
                trouble = NO_NUMBER
        if trouble or (reason and not x and not turn):
            motion = self._limits.brake(self._last, seconds)
        else:
            asked = self._limits.clamp(Motion(float(x), float(turn)))
            asked = self._limits.approach(asked, self._last, seconds)
            cut = self._cut(asked, seconds, view)
            motion, trouble = cut.motion, cut.cause
            if motion != self._limits.approach(motion, self._last, seconds):
                # What lies between the two was not looked at. The way of the last command was: with even braking.
                motion = self._limits.brake(self._last, seconds)
        self._last = motion
        return Twist(Vector3(motion.x), Vector3(0.0, 0.0, motion.turn)), trouble

    def _take_base(self, base: Base) -> None:
        self._base, self._outline, self._limits = base, outline_of(base), Limits(base)
        self._around, self._stoppers = Surroundings(self._outline), Stoppers()

    def _cut(self, asked: Motion, seconds: float, view: View) -> Cut:
        """`asked` as far as nothing stands in its way."""
        speed, turn = self._limits.arc(asked)
        if not (speed or turn):
            return Cut(asked, "")
        approach = Approach(self._limits, self._outline, seconds)
        extra = HYSTERESIS if self._held == _way_of(asked) else 0.0
        mates = []
        if self._mates.are_due(view):
            needs = approach.needed_seconds(asked, TEAMMATE_GAP, extra)
            mates = self._mates.look(view, self._outline, abs(speed) * needs)
        obstacles = Obstacles(self._around, self._stoppers, mates, extra)
        if self._around.is_blinded:
            # What is silent hangs on all teammates.
            cut = self._find_cut(asked, approach, obstacles, view)
        else:
            known, same = self._around.known, (asked, seconds, extra, tuple(mates))
            cut = known.get(same) or self._around.keep(same, self._find_cut(asked, approach, obstacles, view))
        is_stopped = (asked.x and not cut.motion.x) or cut.motion == STANDING
        self._held = _way_of(asked) if is_stopped else None
        return cut

    def _find_cut(self, asked: Motion, approach: Approach, obstacles: Obstacles, view: View) -> Cut:
        """`asked` as far as the ground before it is seen, and these obstacles are not in the way."""
        cut = self._slow_down_blind(asked, approach, obstacles.extra, view)
        if cut.motion == STANDING:
            return cut
        free = _avoid(cut, approach, obstacles)
        if free.motion is asked or not self._is_another(free.motion, asked):
            return free
        # It leads over other ground.
        slow = self._slow_down_blind(free.motion, approach, obstacles.extra, view)
        return Cut(slow.motion, free.cause or slow.cause)

    def _is_another(self, motion: Motion, asked: Motion) -> bool:
        """Whether `motion` is on another arc than `asked`."""
        (speed, turn), left = self._limits.arc(asked), self._limits.arc(motion)
        return abs(left[0] * turn - speed * left[1]) > LEAST

    def _slow_down_blind(self, asked: Motion, approach: Approach, extra: float, view: View) -> Cut:
        """`asked` as far as the ground before it is seen."""
        arc = Arc(*self._limits.arc(asked))
        if is_surely_seen(self._outline, arc, self._around):
            return Cut(asked, "")
        needs = approach.needed_seconds(asked, TEAMMATE_GAP, extra)
        blind, unseen = find_blind_spot(self._outline, arc, needs, self._around, self._mates, view)
        side = _side_of(asked)
        if blind:
            return Cut(Motion(0.0, asked.turn), f"blind {side}")
        if unseen >= approach.stop_seconds(asked):
            return Cut(asked, "")
        share = approach.share(asked, unseen)
        least = min(1.0, CREEP / (abs(arc.speed) + abs(arc.turn) * self._outline.radius))
        slow = self._limits.scale(asked, max(share, least))
        return Cut(slow, f"{CREEPS} {side} was never seen" if share < least < 1.0 else "")


def _avoid(cut: Cut, approach: Approach, obstacles: Obstacles) -> Cut:
    """What is left of a motion before the obstacles: slower, but turning as was wanted where there is room."""
    motion, limits = cut.motion, approach.limits
    share, robot_id = obstacles.free_share(motion, approach)
    if share >= 1.0:
        return cut
    slow = limits.scale(motion, share)
    if motion.turn and motion.x and limits.arc(slow) == slow:
        turning = Motion(slow.x, motion.turn)
        free, _ = obstacles.free_share(turning, approach)
        if free >= 1.0 or not share:
            slow = limits.scale(turning, free)
    if slow.x or (not motion.x and slow.turn):
        return Cut(slow, cut.cause)
    what = names.robot_name(robot_id) if robot_id >= 0 else "obstacle"
    return Cut(slow, f"{what} {_side_of(motion)}")


def _side_of(motion: Motion) -> str:
    return "beside" if not motion.x else "ahead" if motion.x > 0.0 else "behind"


def _way_of(motion: Motion) -> tuple[bool, bool]:
    return motion.x > 0.0, not motion.x and motion.turn > 0.0


def old_scan(view: View) -> str:
    """Why the scan cannot be driven by: there is none, or it is old; empty if it can."""
    # Asked before the behaviour steps, and before its command is limited.
    known = view.__dict__
    if "old_scan" not in known:
        known["old_scan"] = _age_trouble(view)
    trouble: str = known["old_scan"]
    return trouble


def _age_trouble(view: View) -> str:
    if view.scan is None:
        return "no scan yet"
    return "" if view.is_fresh(ns_from_time(view.scan.header.stamp), STALE_AFTER) else "stale scan"
