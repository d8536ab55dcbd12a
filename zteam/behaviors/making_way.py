"""What a robot of a formation does that cannot go straight to its slot.

It makes way for a leader that is boxed in by its own formation: in a dead end, or where the leader turns back. And it
goes along the leader's trail where walls are between.
"""

import math
from collections.abc import Iterable

from zteam.behaviors.around import Around
from zteam.behaviors.leader_trail import LeaderTrail
from zteam.behaviors.pursuit import Limits
from zteam.behaviors.scans import is_clear
from zteam.behaviors.slot_driving import Other
from zteam.behaviors.view import View
from zteam.clock import to_ns
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import Twist, Vector3

PATIENCE, MOVED, TURNED = to_ns(2.5), 0.1, 1.0
"""A leader is boxed in that has not moved so many metres in so many nanoseconds, but has turned by so many radians."""
ROOM, BESIDE = 1.6, 0.75
"""Metres that it gets ahead, and on either side of its way."""
STEP = 1.5
"""Metres to the place that a robot drives to: it goes on from there as long as it has to."""

STUCK, FAR = to_ns(1.5), 0.8
"""Nanoseconds for which a robot has not moved that takes the trail, until it is not so many metres from its slot."""
ALONG = 0.4
"""Metres between the places of the trail to which it looks."""
ASIDE = 1.0
"""Rad/s: it turns on the spot where it has to turn faster."""
MARGIN = 0.03
"""Metres on either side of the base that have to be free on the way there."""


class MakingWay:
    """Drives off until the leader has room, and then aside as long as the leader comes towards it."""

    def __init__(self) -> None:
        self._leader, self._since, self._has_turned = Pose2(0.0, 0.0, 0.0), 0, False
        """Where the leader has got on last, and when, and whether it has turned there."""
        self._is_asked = False
        self._around = Around()

    def forget(self) -> None:
        """The leader is not seen."""
        self._since, self._is_asked = 0, False

    def step(self, view: View, here: Pose2, leader: Pose2, others: Iterable[Other], limits: Limits) -> Twist | None:
        """The velocity of a robot that is in the way; None for one that is not. Poses are in map."""
        if not self._since or math.dist(leader[:2], self._leader[:2]) > MOVED:
            self._leader, self._since, self._has_turned = leader, view.now, False
        self._has_turned = self._has_turned or abs(normalize_angle(leader.yaw - self._leader.yaw)) > TURNED
        is_boxed = self._has_turned and view.now - self._since > PATIENCE
        if not is_boxed and not self._is_asked:
            return None
        x, y, yaw = leader.inverse().compose(here)
        apart = math.hypot(x, y)
        nearer = sum(math.dist(leader[:2], other[:2]) < apart - MOVED for other in others) - 1
        comes = x > 0.0 and abs(y) < BESIDE and apart < 2.0 * ROOM
        self._is_asked = apart < ROOM + BESIDE * max(0, nearer) if is_boxed else comes
        if not self._is_asked:
            return None
        away = math.atan2(y, x) if is_boxed else math.copysign(math.atan2(1.0, 1.0), y)
        return self._around.drive_to(view, STEP * math.cos(away - yaw), STEP * math.sin(away - yaw), limits)


class Detour:
    """The way of a robot that stands far from its slot."""

    def __init__(self) -> None:
        self._at, self._since, self._is_needed = Pose2(0.0, 0.0, 0.0), 0, False
        """Where it has got on last, and when, and whether it takes the trail."""
        self._around = Around()

    def is_needed(self, view: View, here: Pose2, slot: Pose2) -> bool:
        """Whether to go along the trail, from `here` to the `slot` in map."""
        is_far = math.dist(here[:2], slot[:2]) > FAR
        if not is_far or math.dist(here[:2], self._at[:2]) > MOVED or abs(here.yaw - self._at.yaw) > MOVED:
            self._at, self._since = here, view.now
        self._is_needed = is_far and (self._is_needed or view.now - self._since > STUCK)
        return self._is_needed

    def step(self, view: View, here: Pose2, trail: LeaderTrail, slot: Pose2, limits: Limits) -> Twist:
        """The velocity to the foremost place of the trail that it sees, from its slot back; else to its slot."""
        to_base, path = here.inverse(), trail.path
        place, goal = path.project(slot.x, slot.y), to_base.compose(slot)
        while view.scan is not None and place > path.start:
            x, y, _ = to_base.compose(path.at(place))
            apart = math.hypot(x, y)
            if is_clear(view.scan, view.base.half_width + MARGIN, apart, math.atan2(y, x)) and apart > ALONG:
                goal = Pose2(x, y, 0.0)
                break
            place -= ALONG
        command = self._around.drive_to(view, goal.x, goal.y, limits)
        if abs(command.angular.z) < ASIDE and view.now - self._since < 2 * STUCK:
            return command
        # There may be no room for a bend, or for the way ahead.
        return Twist(angular=Vector3(z=math.copysign(max(ASIDE, abs(command.angular.z)), command.angular.z)))
