"""How the robots of a line make room behind a head that keeps its place, and that may turn back into its line."""

import math
from collections.abc import Sequence, Set
from typing import NamedTuple

from zteam import names
from zteam.clock import to_ns
from zteam.geometry import Pose2, curvature_to, normalize_angle
from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.evasion import Around, Escape, Pause
from zteam.robot.behaviors.head import Head
from zteam.robot.behaviors.line import Place
from zteam.robot.behaviors.polyline import LOOK_AHEAD, Polyline, SpeedLimits
from zteam.robot.view import View

NEAR, MET = 0.58, 1.0
"""Metres from base to base within which a robot drives back from the one ahead; and where that one comes towards it."""
BESIDE = 0.4
"""Metres beside each other up to which two robots that come towards each other cannot pass."""
BACK_SPEED = 0.2
"""m/s at which it drives back."""
PATIENCE, MOVED, TURNED = to_ns(2.5), 0.1, 1.0
"""A leader is boxed in that has not moved so many metres in so many nanoseconds, but has turned by so many radians."""
ROOM = 1.6
"""Metres from base to base that it then gets."""
FACING, FACED = 1.2, 2.0
"""Metres from the head within which a robot begins to stand face to face with it, and beyond which it does no more."""
FACED_FOR = to_ns(4.0)
"""Nanoseconds face to face after which it drives round the head to its place behind it, because that cannot get on."""
STUCK, STUCK_FOR = 0.2, to_ns(3.0)
"""Metres, and nanoseconds: a robot that wants to drive on and has not come so far in so long leaves its way."""
FRUITLESS = 2
"""Turns of the line after which that holds for each robot: neither end gets on, so those between are in the way."""
FREED = 0.5
"""Metres from there after which it takes its trail again."""
STRAY, STRAY_TURN = 0.4, 1.0
"""m/s and rad/s while it is off its trail."""


Answer = tuple[Twist, str]
"""A velocity, and why it is zero, or what the robot does instead of following."""


class Following(NamedTuple):
    """Where a robot follows."""

    path: Polyline
    """The way of the head."""
    here: float
    """The robot's place on it."""
    back: float
    """Metres behind the head where it belongs."""
    driven_on: float = 0.0
    """Metres that the robot ahead has driven away since its pose, which may be late."""


class BoxedIn:
    """Whether a leader has no room to get on."""

    def __init__(self) -> None:
        self._leader, self._since, self._has_turned = Pose2(0.0, 0.0, 0.0), 0, False
        """Where it has got on last, and when, and whether it has turned there."""

    def look(self, now: int, leader: Pose2) -> bool:
        """Whether it is boxed in, at `leader` in map at time `now` (ns)."""
        if not self._since or math.dist(leader[:2], self._leader[:2]) > MOVED:
            self._leader, self._since, self._has_turned = leader, now, False
        self._has_turned = self._has_turned or abs(normalize_angle(leader.yaw - self._leader.yaw)) > TURNED
        return self._has_turned and now - self._since > PATIENCE


class Stray:
    """Takes a robot off its way that is stuck: there it drives as a head does."""

    def __init__(self) -> None:
        self._head = Head()
        self._anchor = (0.0, 0.0), 0, 0
        """Where it got on last, when (ns), and how often the line had turned then."""
        self._pause = Pause()

    def rest(self) -> None:
        """It has not been stuck until now."""
        self._anchor = (math.inf, math.inf), 0, self._anchor[2]

    def step(self, view: View, own: Pose2, limits: SpeedLimits, *, wants: bool, turns: int = 0) -> Twist | None:
        """The velocity of a robot at `own` in map; None to go its way.

        `wants`: it is to drive on, and does not wait for another robot. `turns`: of its line, so far.
        """
        place, since, before = self._anchor
        if self._pause.is_over(view.now):
            since = view.now
            self._anchor = place, since, before
        is_fruitless = turns - before >= FRUITLESS
        is_stuck = is_fruitless or view.now - since > STUCK_FOR
        if math.dist(own[:2], place) > (FREED if is_stuck else STUCK):
            self._anchor, is_stuck = (own[:2], view.now, turns), False
        elif not (wants or is_fruitless):
            self._anchor = own[:2], view.now, before
        if is_stuck:
            linear, angular = min(STRAY, limits.linear), min(STRAY_TURN, limits.angular)
            command, _ = self._head.step(view, own, Place(), linear, angular)
            if command is not None:
                return command
            self._anchor = own[:2], view.now, turns
        self._head.rest()
        return None


class MakingRoom:
    """What a robot does instead of following: it strays, goes round a head that faces it, or drives back."""

    def __init__(self) -> None:
        self._around, self._escape, self._stray = Around(), Escape(), Stray()
        self._faced_since: int | None = None
        """Nanoseconds: since when it stands face to face with the head."""
        self._boxed_in, self._pause = BoxedIn(), Pause()
        self._asking: int | None = None
        """The robot for which it drives back."""

    def rest(self) -> None:
        """What stands in its way does so from now on."""
        self._stray.rest()
        self._escape.rest()
        self._faced_since, self._boxed_in = None, BoxedIn()

    def step(
        self, view: View, own: Pose2, place: Place, way: Following, limits: SpeedLimits, stopped: Set[int],
        *, keeps: bool, wants: bool,
    ) -> Answer | None:  # fmt: skip
        """The velocity of a robot at `own` (map) and its `place` in the line, and what it does; None to follow.

        `stopped`: the robots that this one is in the way of. `keeps`: the head keeps its place, as one that is driven
        by hand does. For `wants` see `Stray`.
        """
        head = place.before[-1]
        if self._pause.is_over(view.now):
            self._faced_since, self._boxed_in = None, BoxedIn()
        self._asking, seen = self._find_asking(view, own, place.before, stopped, way.driven_on) if keeps else (None, {})
        command = self._stray.step(view, own, limits, wants=wants or self._asking is not None, turns=place.turns)
        if command is not None:
            return command, "is stuck: leaves its way"
        if not keeps:
            return None
        command = self._go_round(view, seen.get(head), way.back, limits)
        if command is not None:
            return self._escape.free(view, command), f"drives round {names.robot_name(head)}"
        if self._asking is not None and seen[self._asking].x > 0.0:
            return back_up(own, way.path, way.here), f"makes room for {names.robot_name(self._asking)}"
        return None

    def _find_asking(
        self, view: View, own: Pose2, before: Sequence[int], stopped: Set[int], driven_on: float
    ) -> tuple[int | None, dict[int, Pose2]]:
        """The robot that comes too near from ahead, or is boxed in, or says that this one is in its way.

        And where those of the robots `before` are that may do so, in the own base frame.
        """
        head, asked = before[-1], {before[0], before[-1], self._asking, *stopped}
        found = ((robot, view.base_from_robot(robot)) for robot in before if robot in asked)
        seen = {robot: at[0] for robot, at in found if at is not None}
        is_boxed = head in seen and self._boxed_in.look(view.now, own.compose(seen[head]))
        if driven_on and before[0] in seen:
            seen[before[0]] = seen[before[0]]._replace(x=seen[before[0]].x + driven_on)
        for robot, at in seen.items():
            near = ROOM if is_boxed and robot == head else MET if robot == self._asking else 0.0
            is_near = at.x > 0.0 and (math.hypot(at.x, at.y) < near or (robot == before[0] and is_too_near(at)))
            if robot in stopped or is_near:
                return robot, seen
        return None, seen

    def _go_round(self, view: View, head: Pose2 | None, back: float, limits: SpeedLimits) -> Twist | None:
        """To the place behind a head that has faced it for long, if there is a way; `head` is in the own base frame."""
        apart = math.inf if head is None else math.hypot(head.x, head.y)
        if head is None or apart > FACED or head.inverse().x <= 0.0:
            self._faced_since = None
        elif self._faced_since is None and head.x > 0.0 and apart < FACING:
            self._faced_since = view.now
        if head is None or self._faced_since is None or view.now - self._faced_since <= FACED_FOR:
            return None
        x, y, _ = head.compose(Pose2(-back, 0.0, 0.0))
        if self._around.find_heading(view, math.atan2(y, x), math.hypot(x, y)) is None:
            return None
        return self._around.drive_to(view, x, y, limits)


def find_stopped(view: View) -> Set[int]:
    """The robots that say that this one is in their way."""
    statuses = view.inputs.get("statuses") or {}
    return {robot for robot, status in statuses.items() if status.blocked_by == view.robot_id}


def is_too_near(ahead: Pose2) -> bool:
    """Whether a robot has to drive back from the one at `ahead` (own base frame)."""
    back = ahead.inverse()
    is_met = back.x > 0.0 and max(abs(ahead.y), abs(back.y)) < BESIDE
    return ahead.x > 0.0 and math.hypot(ahead.x, ahead.y) < (MET if is_met else NEAR)


def back_up(own: Pose2, path: Polyline, place: float) -> Twist:
    """The velocity back along the way behind `place`."""
    x, y = own.locate(*path.point(place - LOOK_AHEAD))
    square = x * x + y * y
    turn = 0.0 if x >= 0.0 or square < 1e-4 else -BACK_SPEED * curvature_to(y, square)
    return Twist(Vector3(-BACK_SPEED), Vector3(z=max(-1.0, min(1.0, turn))))
