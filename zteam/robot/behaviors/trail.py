"""How a robot of a line follows: along the way of the robot that leads, and not too near to the one ahead."""

import math
from collections.abc import Mapping, Sequence, Set
from itertools import pairwise
from typing import Any, ClassVar

from zteam import names
from zteam.clock import to_ns
from zteam.errors import log
from zteam.geometry import Point2, Pose2
from zteam.kernels.polylines import LeaderTrail, Polyline
from zteam.messages import Message, Twist
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.behaviors.escape import AGAIN, Escape
from zteam.robot.behaviors.evasion import Around, Head, MakingRoom, back_up
from zteam.robot.behaviors.line import (
    NO_TURNS,
    STATUSES,
    STRETCHED,
    Line,
    LineRole,
    OnLeaderLost,
    Seen,
    keep_together,
    see_robot,
    waits_for,
)
from zteam.robot.behaviors.path import LOOK_AHEAD, SpeedLimits, pursue
from zteam.robot.behaviors.spreading import Spreading, spread
from zteam.robot.behaviors.steering import Steering
from zteam.robot.view import NO_POSE, SILENT_AFTER, View, is_clear, is_seen, own_pose

OFF = 0.5
"""Metres from the trail from which on the whole trail is searched, and a robot drives to it past what is between."""
MARGIN = 0.1
"""Metres before a robot in which what the laser sees may be that robot."""
NEARER = 0.6
"""Metres by which a head that comes round is nearer to the last robot than to the one that is to follow it."""
LOOK_ON, BODY = 1.5, 0.15
"""Metres of the trail ahead on which no robot that is gone may stand, and metres beside it that have to be free."""


def is_walled_off(view: View, own: Pose2, point: tuple[float, float]) -> bool:
    """Whether a wall leaves no straight way to this point (map), as far as to the first robot on it."""
    x, y = own.locate(*point)
    reach, bearing = math.hypot(x, y), math.atan2(y, x)
    for mate in view.teammates:
        along, across = mate.along(bearing)
        if along > 0.0 and abs(across) < view.base.half_width + mate.base.radius:
            reach = min(reach, along - mate.base.radius - MARGIN)
    if view.scan is None or reach <= 0.0:
        return False
    return not is_clear(view.scan, view.base.half_width, reach, bearing)


def places_of(view: View, robots: Sequence[int]) -> list[Point2]:
    """Where those are in map that are seen."""
    seen = (see_robot(view, robot)[0] for robot in robots)
    return [each[0][:2] for each in seen if each is not None]


def length_in_sight(view: View, before: Sequence[int], own: Pose2) -> float:
    """Metres straight from robot to robot up to the head; infinite where the first of them may be behind a wall."""
    way = [own[:2], *places_of(view, before)]
    x, y = own.locate(*way[1])
    is_blind = view.scan is not None and not is_seen(view.scan, math.atan2(y, x))
    if is_blind or is_walled_off(view, own, way[1]):
        return math.inf
    return sum(math.dist(a, b) for a, b in pairwise(way))


def overtaken(view: View, path: Polyline, here: float, after: Sequence[int]) -> list[int]:
    """Those of the robots that belong behind the place `here` that are ahead of it on the path."""
    found = []
    for robot in after:
        seen = view.map_from_robot(robot)
        if seen is not None:
            place, off = path.near(seen[0])
            if place > here + OFF and off < OFF:
                found.append(robot)
    return found


def is_blocked(view: View, own: Pose2, path: Polyline, place: float, robots: Set[int]) -> bool:
    """Whether one of these robots is on the path, a little ahead of `place`."""
    for mate in view.teammates:
        if mate.robot_id in robots and math.hypot(*mate.pose[:2]) < LOOK_ON:
            off = path.near(own.compose(mate.pose), place, place + LOOK_ON)[1]
            if off < view.base.half_width + mate.base.radius + BODY:
                return True
    return False


def head_comes_round(view: View, own: Pose2, role: LineRole) -> bool:
    """Whether the head has left the robot that is to follow it, and is nearest to this one, the last of its line."""
    seen = [view.map_from_robot(robot) for robot in reversed(role.before)]
    if len(seen) < 2 or seen[0] is None or seen[1] is None:
        return False
    head = seen[0][0][:2]
    near, apart = math.dist(head, own[:2]), [math.dist(head, each[0][:2]) for each in seen[1:] if each is not None]
    return apart[0] > max(role.gap + STRETCHED, near + NEARER) and min(apart) > near


SPACING, STEP = 0.05, 0.1
"""Metres between two points of the own way, and of the part of an old trail that becomes a new one."""
KEPT = 30.0
"""Metres of the own way that are kept: a new head stands on it."""
JUMP = 1.0
"""Metres in one step after which a robot was moved; and up to which a new head counts as standing on the own way."""
BACK, AHEAD = 0.3, 0.5
"""Metres of the trail around a robot's last place in which its next one is sought: the trail may cross itself."""
ASIDE = 0.3
"""Metres from the trail within which it has come back to the robot."""
LAGS = 0.4
"""Metres behind its place from which on it passes those that belong behind it."""
LEAD, LEADS = 0.4, 6
"""Metres between the points of the trail ahead, and how many there are, along which it gets past what stops it."""
WANTED = 0.1
"""m/s from which on it wants to get on also where it is less behind."""
PASSING = 0.4
"""m/s past a lost head."""
SCRIBBLE = 2.0
"""So many times longer than the way straight from robot to robot a trail is given up."""
BEYOND = 1.9
"""Metres past a lost head to which the robot drives that leads in its place."""
NEARLY = 0.1
"""Metres to the end of that way within which it is past."""
STALLED, PROGRESS = to_ns(3.0), 0.05
"""It gives that way up where it has not got on so many metres in so many nanoseconds: a wall may stand at its end."""


class Trail:
    """The way of the robot that leads, the own place on it, and the velocity along it.

    All robots of a line measure from the same robot, so no error adds up from one to the next.
    """

    def __init__(self) -> None:
        self._trail = LeaderTrail()
        self._leads: int | None = None
        """Whose way it is."""
        self._place = self._off = 0.0
        """Where it is on the trail, and metres beside that."""
        self.own_way = Polyline()
        """The robot's own way."""
        self._noted: Point2 = (math.inf, math.inf)
        """Its last point."""
        self._known = 0.0
        """The place from which on the trail is the way of a robot: before that it may lead through walls."""
        self._left: tuple[float, float] | None = None
        """The last place on that part at which it was, and where that is on its own way; None: it was at none."""
        self.apart = 0.0
        """Metres to the robot ahead."""
        self._has_place = False
        """Whether it has been in its place since it began."""
        self._around, self._escape, self._making_room = Around(), Escape(), MakingRoom()
        self._got_on: tuple[int, float] | None = None
        """When (ns) and where on the trail it got on last on its way past a lost head; None: it is past."""
        self._passed = 0
        """When it was asked last to drive past one (ns)."""

    def rest(self) -> None:
        """It leads, was stopped, or does not see its head: the time until now is no reason to get free."""
        self._making_room.rest()
        self._escape.rest()

    def forget(self) -> None:
        """The robot leads: when it follows again, it may be far from the trail that it has left."""
        self._leads = None

    def note(self, own: Pose2) -> None:
        """The own pose in map: part of its way, also while it leads."""
        moved = math.dist(own[:2], self._noted)
        if moved > JUMP:
            self.own_way, self._left = Polyline(), None
        if moved >= SPACING:
            self._noted = own[:2]
            self.own_way.append(*self._noted)
            self.own_way.drop_before(self.own_way.end - KEPT)

    def step(
        self, view: View, own: Pose2, role: LineRole, gap: float, stale_after: float, limits: SpeedLimits
    ) -> tuple[Twist, str]:
        """The velocity of a robot at `own` (map) behind the robots `role.before`, and why it is zero."""
        before, trail, length = role.before, self._trail, gap * len(role.before)
        head, reason = see_robot(view, before[-1], stale_after)
        ahead = head if len(before) == 1 else see_robot(view, before[0])[0]
        if head is None or ahead is None:
            self.rest()
            return Twist(), reason or f"leader {names.robot_name(before[0])} not seen"
        self._update(view, before, head, own, length)
        self._find_place(view, own)
        path = trail.path
        if self._is_far_behind(length):
            self._place, self._off = after_loop(path, self._place, self._off, own, ahead[0])
        here, passed, (pose, stamp) = self._place, role.gone, ahead
        self.apart = math.hypot(pose.x - own.x, pose.y - own.y)
        (speed, error, driven_on), comes_past = trail.follow(
            own, here, length, pose, self.apart, stamp, head[1], view.now
        )
        # In a line that can be led from its other end the head hands over, and a robot keeps the place that it has had.
        alone = not (role.may_turn and self._has_place)
        if error > LAGS:
            passed = {*passed, *overtaken(view, path, here, role.after)}
        else:
            self._has_place = True
        # One that is in the way of a robot behind it does not wait for that.
        goes_on = role.behind in passed or not role.stopped.isdisjoint(role.after)
        share, reason = (1.0, "") if goes_on else keep_together(view, own, role)
        if not alone:
            self._making_room.asking = None
        else:
            command, does = self._making_room.step(view, own, role, head[0], length, limits, driven_on=driven_on)
            if does:
                behind = [own.locate(*path.point(here - LEAD))]
                return command or self._escape.free(view, back_up(own, path, here), behind), does
        if share == 0.0:
            return Twist(), reason
        if alone and len(before) > 1 and comes_past:
            return Twist(), waits_for(before[0], "comes past")
        command = self._along(view, own, min(speed, limits.linear) * share, limits, passed, before[0])
        is_slow = view.odom is None or view.odom.twist.twist.linear.x < WANTED
        way = self._way_ahead(own) if speed * share > WANTED and (is_slow or self._escape.is_moving) else ()
        command = self._escape.free(view, command, way)
        return command, "is stuck: leaves its way" if self._escape.is_moving else ""

    def _way_ahead(self, own: Pose2) -> list[Point2]:
        """Points of the trail ahead, in the own base frame."""
        count = max(1, min(LEADS, int((self._trail.path.end - self._place) / LEAD)))
        return [own.locate(*self._trail.path.point(self._place + LEAD * (i + 1))) for i in range(count)]

    def _update(self, view: View, before: Sequence[int], head: Seen, own: Pose2, length: float) -> None:
        """The newest pose of the robot that leads; a new trail if it is another one, or was set down elsewhere."""
        trail, (pose, stamp) = self._trail, head
        stamp, is_other = stamp or view.now, before[-1] != self._leads
        far_behind = not is_other and self._is_far_behind(length)
        if far_behind and self._is_far_behind(length_in_sight(view, before, own)):
            way = places_of(view, before[:-1])
        elif is_other or not trail.add(pose, stamp, trail.place - self._place + KEPT):
            way = self._way_to(view, before, pose, length)
        else:
            return
        trail.begin(own, way, pose, stamp)
        self._leads, self._place, self._known, self._left = before[-1], trail.path.start, trail.path.end, None

    def _way_to(self, view: View, before: Sequence[int], head: Pose2, length: float) -> list[Point2]:
        """The way to a new head: back over the own one if it stands there, else over the places of those between."""
        # The own way may have crossed itself: the head stands on the newest part of it.
        low, high = self.own_way.end - 1.3 * length - JUMP, self.own_way.end - 0.5 * length
        place, off = self.own_way.near(head, low, high) if high > self.own_way.start else (0.0, math.inf)
        return self.own_way.way_back(place) if off < JUMP else places_of(view, before[:-1])

    def _is_far_behind(self, length: float) -> bool:
        """Whether the trail up to the head is much longer than a way of this length: the head has driven to and fro."""
        return self._trail.place - self._place > SCRIBBLE * length + OFF

    def pass_by(self, view: View, own: Pose2, head: Pose2 | None, limits: SpeedLimits, gone: Set[int]) -> Twist | None:
        """The velocity along the trail to a lost head, and straight on past it (both in map); None once it is there."""
        path = self._trail.path
        if head is None:
            return None
        if self._leads is not None or not len(path):
            # What lies beyond the lost head is no robot's way: this one does not go back to it.
            self._leads, self._known, self._left = None, math.inf, None
            if not len(path):
                path.append(*own[:2])
            path.append(*head[:2])
            path.append(*head.compose(Pose2(BEYOND, 0.0, 0.0))[:2])
            self._got_on = view.now, self._place
        if self._got_on is None:
            return None
        self._find_place(view, own)
        is_new, self._passed = view.now - self._passed > AGAIN, view.now
        if is_new or self._place > self._got_on[1] + PROGRESS:
            self._got_on = view.now, self._place
        if path.end - self._place < NEARLY or view.now - self._got_on[0] > STALLED:
            self._got_on = None
            return None
        return self._along(view, own, min(PASSING, limits.linear), limits, gone)

    def _find_place(self, view: View, own: Pose2) -> None:
        """Where it is on the trail. Where a wall parts it from that, the trail begins anew."""
        path = self._trail.path
        self._place, self._off = path.near(own, self._place - BACK, self._place + AHEAD)
        if self._off > OFF:
            self._place, self._off = path.near(own)
            if self._left is not None and is_walled_off(view, own, path.point(self._place)):
                self._place, self._off = self._go_back(own, *self._left), 0.0
        if self._place >= self._known and self._off < OFF:
            self._left = self._place, self.own_way.end

    def _go_back(self, own: Pose2, left: float, left_at: float) -> float:
        """The beginning of a new trail: over the own way back to `left_at`, and along the old one from `left` on."""
        trail = self._trail
        on = (trail.path.point(left + i * STEP) for i in range(int((trail.path.end - left) / STEP)))
        trail.begin(own, (*self.own_way.way_back(left_at), *on), trail.leader, trail.stamp)
        self._known = trail.path.start
        return self._known

    def _along(
        self, view: View, own: Pose2, speed: float, limits: SpeedLimits, passed: Set[int], ahead: int | None = None
    ) -> Twist:
        """Along the trail; past these robots where they are on it, and to the trail from elsewhere."""
        path, here = self._trail.path, self._place
        beyond = here + LOOK_ON if passed and is_blocked(view, own, path, here, passed) else here
        if speed > 0.0 and (beyond > here or self._off > OFF):
            x, y = own.locate(*path.point(beyond + LOOK_AHEAD))
            return self._around.drive_to(view, x, y, limits, ahead)
        return pursue(own, path, here, speed, limits)


def after_loop(path: Polyline, here: float, off: float, own: Pose2, ahead: Pose2) -> tuple[float, float]:
    """Where the path comes back to the robot, which is `off` metres from its place `here`, and the metres from there;
    its place where it does not, or the robot ahead is on the way there."""
    there, aside = path.near(own, here + AHEAD, path.end)
    comes_back = there > here + AHEAD and aside < ASIDE and path.near(ahead, here, there)[1] > OFF
    return (there, aside) if comes_back else (here, off)


def find_silent(view: View, role: LineRole) -> int | None:
    """A robot of the line that is silent, or a neighbour or head whose pose is old; None without one."""
    if view.silent and (silent := [robot for robot in (*role.before, *role.after) if robot in view.silent]):
        return silent[0]
    for robot in role.watched:
        seen = view.map_from_robot(robot)
        if seen is not None and seen[1] and abs(view.now - seen[1]) > SILENT_AFTER * 1e9:
            return robot
    return None


HEAD_SPEED, HEAD_TURN_RATE = 0.4, 1.0
"""m/s and rad/s of a robot to which the head has handed over."""
STALE_AFTER = 0.5
"""Seconds: older poses of the robot that it follows do not count."""


class LineMember(Behavior):
    """A robot that may be in a line."""

    inputs: ClassVar[Mapping[str, tuple[str, type[Message]]]] = STATUSES

    def __init__(self, params: Any) -> None:
        super().__init__(params)
        self._line, self._trail, self._head, self._spreading = Line(), Trail(), Head(), Spreading()
        self.steering = Steering()
        self._silent: int | None = None
        """A robot of its line that is silent, or whose pose is old."""

    @property
    def _may_turn(self) -> bool:
        """Whether it can follow the robot behind it."""
        return bool(self.params.hand_over)

    @property
    def turns(self) -> int:  # type: ignore[override]
        """See Behavior."""
        return self._line.turns if self._may_turn else NO_TURNS

    def on_release(self) -> None:
        """See Behavior: that it did not get on meanwhile is no reason to hand over or to leave its way."""
        self._trail.rest()
        self._head.rest()

    def _find_role(self, view: View, leader: int | None, on_lost: OnLeaderLost = "relink") -> LineRole:
        self._silent = None
        return self._line.find_role(view, leader, on_lost, may_turn=self._may_turn)

    def _drive_in_line(self, view: View, role: LineRole, limits: SpeedLimits, speed: float, turn_rate: float) -> Twist:
        """The velocity of a robot that leads the line at this speed and turn rate, or is in it."""
        ahead, own = role.ahead, own_pose(view)
        if not role.reason:
            self.follows = ahead
        self.reason = role.reason or (NO_POSE if own is None else "")
        if own is None or role.reason:
            self.on_release()
            return Twist()
        self._silent = find_silent(view, role)
        if self._silent is not None:
            # That the line does not get on meanwhile is no reason for anything.
            self.on_release()
        elif self._spreading.is_due(view, role):
            self._head.rest()
            self._trail.rest()
            self._trail.forget()
            self.reason = "spreads out: neither end of the line can advance"
            return spread(view, role, limits)
        self._trail.note(own)
        # What it does as the other one does not count: to lead, or to follow.
        if ahead is None:
            self._trail.rest()
            return self._lead(view, own, role, limits, speed, turn_rate)
        self._head.rest()
        if role.may_reverse and not role.after and self._silent is None and head_comes_round(view, own, role):
            self._line.turn_on()
        return self._follow(view, own, role, limits)

    def _follow(self, view: View, own: Pose2, role: LineRole, limits: SpeedLimits) -> Twist:
        """The velocity of a robot that is in the line."""
        command, self.reason = self._trail.step(view, own, role, role.gap, STALE_AFTER, limits)
        return command

    def _lead(self, view: View, own: Pose2, role: LineRole, limits: SpeedLimits, speed: float, rate: float) -> Twist:
        """The velocity as the robot that leads; it hands over where it gets on no more."""
        if self._silent is not None:
            self.reason = waits_for(self._silent, "is silent")
            return Twist()
        self._trail.forget()
        command, self.reason = self._head.step(view, own, role, speed, rate)
        if command is not None:
            return command
        self._head.rest()
        self._line.turn_on()
        self.reason = "hands over to the other end of the line"
        log.info("%s", self.reason)
        return Twist()

    def why_it_rests(self) -> str:
        if self._silent is not None:
            return waits_for(self._silent, "is silent")
        if self.follows is None:
            return "it looks for a way to lead the line"
        return waits_for(self.follows, f"is {self._trail.apart:.1f} m away")
