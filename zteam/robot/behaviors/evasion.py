"""How a robot gets past what stands between it and a place, and free where it has no room to turn.

The robot that leads a line turns as little as it can, and hands over when it cannot advance. The robots behind it make
room for a head that keeps its place, and that may turn back into its line.
"""

import math

import numpy as np

from zteam import names
from zteam.clock import to_ns
from zteam.geometry import Point2, Pose2, curvature_to, in_polygon, normalize_angle
from zteam.kernels.polylines import Polyline
from zteam.messages import LaserScan, Twist, Vector3
from zteam.robot.behaviors.escape import Escape
from zteam.robot.behaviors.line import LineRole, keep_together
from zteam.robot.behaviors.path import LOOK_AHEAD, SpeedLimits
from zteam.robot.view import View, is_clear, is_seen, look_along

LINEAR_GAIN, ANGULAR_GAIN = 0.5, 4.0
"""1/s: the lectures' v = 0.5 d and w = 4 atan2(y, x)."""
SPOT_ANGLE = 1.0
"""Radians: where something stands between, it turns on the spot towards a heading that is further off."""
REACH = 0.6
"""Metres ahead of the laser that have to be clear of walls."""
SIDE_MARGIN = 0.075
"""Metres that have to be free on either side of the base."""
MATE_REACH, MATE_MARGIN = 1.2, 0.24
"""Metres ahead within which another robot is in the way, and metres beside it that have to be free."""
STEP, STEPS = math.radians(10.0), 12
"""It looks for a way up to so far from the bearing."""


class Around:
    """Keeps the side on which it passes until the straight way is clear, so it does not swing in front of a post."""

    def __init__(
        self, gain: float = LINEAR_GAIN, mate_reach: float = MATE_REACH, mate_margin: float = MATE_MARGIN
    ) -> None:
        """`gain` is the speed by the distance (1/s). For the others see above."""
        self._gain, self._mate_reach, self._mate_margin = gain, mate_reach, mate_margin
        self._side = 0.0
        """1 while it passes on the left, -1 on the right, 0 with a clear way."""

    def drive_to(
        self, view: View, x: float, y: float, limits: SpeedLimits, but: int | None = None, room: float = 0.0
    ) -> Twist:
        """The velocity towards (x, y) in the base frame; neither `but` nor what is `room` m from it is in the way."""
        distance, bearing = math.hypot(x, y), math.atan2(y, x)
        heading = self.find_heading(view, bearing, distance - room, but)
        heading = bearing if heading is None else heading
        # A place behind is turned to on the spot: driving would lead away from it.
        speed = 0.0 if abs(heading) > 0.5 * math.pi else min(self._gain * distance, limits.linear)
        if self._side:
            speed *= max(0.0, 1.0 - abs(heading) / SPOT_ANGLE)
        return Twist(Vector3(speed), Vector3(z=limits.clamp_turn(ANGULAR_GAIN * heading)))

    def find_heading(self, view: View, bearing: float, reach: float, but: int | None = None) -> float | None:
        """The bearing (rad), or the nearest to it that is clear for `reach` metres; None without any."""
        if self._is_clear(view, bearing, reach, but):
            self._side = 0.0
            return bearing
        turns = [side * step * STEP for step in range(1, STEPS + 1) for side in (1.0, -1.0)]
        # First those of the side that is kept, if one is.
        for turn in sorted(turns, key=lambda turn: turn * self._side < 0.0):
            if self._is_clear(view, bearing + turn, reach, but):
                self._side = math.copysign(1.0, turn)
                return normalize_angle(bearing + turn)
        self._side = 0.0
        return None

    def _is_clear(self, view: View, heading: float, reach: float, but: int | None) -> bool:
        """Whether neither a wall nor a robot stands in the way towards a heading (rad)."""
        half_width = view.base.half_width
        if view.scan is not None and not is_clear(view.scan, half_width + SIDE_MARGIN, min(REACH, reach), heading):
            return False
        for mate in view.teammates:
            along, across = mate.along(heading)
            in_reach = 0.0 < along < min(self._mate_reach, reach + mate.base.radius)
            if in_reach and abs(across) < half_width + mate.base.radius + self._mate_margin and mate.robot_id != but:
                return False
        return True


FREE, CLOSER = 0.75, 0.55
"""Metres ahead that have to be free for it to drive straight on, and where it finds no heading: it sees round a corner
from near the wall. The nearer it drives to the walls of a room, the longer is the line that fits into it."""
ROOMY, TIGHT = 1.0, 0.85
"""Metres that have to be free along a new heading; and with a long line, which itself fills a room."""
INTO = 0.6
"""Metres ahead at which a heading leads into the ring of a long line, or does not."""
HALF_WIDTH, MATE = 0.06, 0.62
"""Metres beside the base's radius that have to be free on either side; and within which a robot is in the way."""
HEADINGS = tuple(math.radians(10.0 * step) for step in range(-11, 12))
"""Of which it takes one: never back past its own line."""
OTHER_SIDE = 0.5
"""Radians by which a turn to the other side than last time, or to the middle of a long line, has to be smaller: so it
goes round a room."""
CHANCE, LONG = 0.01, 5
"""How often in a step it draws a direction without need, unless its line is long: so many robots behind it."""
ON_THE_SPOT, NARROW = 0.8, 0.7
"""Radians: it turns on the spot to a heading that is further off; and metres: so it does where less is free ahead."""
ALIGNED, TURN_GAIN = 0.1, 2.0
"""Radians to its heading from which on it drives straight; and 1/s."""
GIVES_UP, PROGRESS = (to_ns(6.0), to_ns(40.0)), (0.4, 2.0)
"""It hands over if it has not come so many metres away in so many nanoseconds."""
FIRST = to_ns(3.0)
"""Nanoseconds in which a new head does not hand over for lack of a heading: its line still moves."""


class Head:
    """The law of the robot that leads: straight on, with turns that are as small as there is room."""

    def __init__(self) -> None:
        self._since: int | None = None
        """Nanoseconds: when it began to lead; None while it does not."""
        self._heading: float | None = None
        """In map (rad), while it turns."""
        self._side = 0.0
        """Its last turn (rad)."""
        self._anchors: list[tuple[Point2, int]] = []
        """Where in map it got on last by each distance of PROGRESS, and when (ns)."""
        self._escape = Escape()

    def rest(self) -> None:
        """It does not lead, or stands for a reason."""
        self._since = None

    def step(self, view: View, own: Pose2, role: LineRole, speed: float, turn_rate: float) -> tuple[Twist | None, str]:
        """The velocity, and why it is zero; None where it is to hand over."""
        scan = view.scan
        if scan is None:
            return Twist(), "no scan yet"
        if self._since is None:
            self._since, self._heading = view.now, None
            self._anchors = [(own[:2], view.now)] * len(PROGRESS)
            self._escape.rest()
            behind = view.base_from_robot(role.after[0]) if role.after else None
            if behind is not None and behind[0].x > 0.0:
                # A new head mostly looks along its line.
                self._heading = normalize_angle(own.yaw + math.atan2(-behind[0].y, -behind[0].x))
        share, reason = keep_together(view, own, role)
        if share == 0.0:
            # While it waits for its line it has time.
            self._anchors[0] = own[:2], view.now
        self._anchors = [
            (own[:2], view.now) if math.dist(own[:2], at) > metres else (at, since)
            for (at, since), metres in zip(self._anchors, PROGRESS, strict=True)
        ]
        waits = [(view.now - since) / most for (_, since), most in zip(self._anchors, GIVES_UP, strict=True)]
        if waits[0] > (2 if self._escape.is_moving else 1) or waits[1] > 1:
            return None, ""
        if self._heading is not None and abs(normalize_angle(self._heading - own.yaw)) < ALIGNED:
            self._heading = None
        ahead = self._room(view, scan, 0.0)
        if share == 0.0 and ahead < FREE:
            # It finds no way while its line is not there.
            self._escape.rest()
            return Twist(), reason
        if self._escape.is_moving:
            turn = self._least_turn(view, scan, role) if ahead > NARROW else None
            if turn is None or abs(turn) > ON_THE_SPOT:
                return self._escape.free(view, Twist(angular=Vector3(z=turn_rate))), ""
            self._escape.rest()
            self._heading = normalize_angle(own.yaw + turn)
        draws = ahead >= FREE and len(role.after) < LONG and view.random() < CHANCE
        if self._heading is None and (ahead < FREE or draws):
            turn = self._least_turn(view, scan, role, draws=draws)
            if ahead > CLOSER and turn is None:
                return Twist(Vector3(speed * share)), "" if share else reason
            if turn is None and view.now - self._since > FIRST:
                return None, ""
            self._heading = normalize_angle(own.yaw + (math.pi if turn is None else turn))
        error = 0.0 if self._heading is None else normalize_angle(self._heading - own.yaw)
        turn = max(-turn_rate, min(turn_rate, TURN_GAIN * error))
        if abs(error) > ON_THE_SPOT or ahead < NARROW:
            return self._escape.free(view, Twist(angular=Vector3(z=turn))), ""
        return Twist(Vector3(speed * share), Vector3(z=turn * share)), "" if share else reason

    def _least_turn(self, view: View, scan: LaserScan, role: LineRole, *, draws: bool = False) -> float | None:
        """The heading with room (rad) that is the least to the side, or a drawn one; None without any.

        A long line turns away from its own middle, and not into the ring that it makes: that is a dead end.
        """
        is_long, side = len(role.after) >= LONG, self._side
        least = TIGHT if is_long else ROOMY
        free = [heading for heading in HEADINGS if self._room(view, scan, heading) > least and is_seen(scan, heading)]
        if draws and free:
            return free[int(len(free) * view.random(1))]
        if is_long:
            at = {mate.robot_id: mate.pose[:2] for mate in view.teammates}
            ring = np.array([(0.0, 0.0), *(at[robot] for robot in role.after if robot in at)])
            is_in = in_polygon(ring, INTO * np.cos(free), INTO * np.sin(free))
            side, free = -ring[:, 1].sum(), [heading for heading, leads in zip(free, is_in, strict=True) if not leads]
        turn = min(free, key=lambda heading: abs(heading) + OTHER_SIDE * (heading * side < 0.0), default=None)
        self._side = turn or self._side
        return turn

    def _room(self, view: View, scan: LaserScan, heading: float) -> float:
        """Metres that are free of walls and robots towards a heading (rad)."""
        room = look_along(scan, view.base.radius + HALF_WIDTH, heading)
        for mate in view.teammates:
            along, across = mate.along(heading)
            if along > 0.0 and abs(across) < MATE:
                room = min(room, along)
        return room


NEAR, MET = 0.58, 1.0
"""Metres from base to base within which a robot drives back from the one ahead; and where that one comes towards it."""
BESIDE = 0.4
"""Metres beside each other up to which two robots that come towards each other cannot pass."""
BACK_SPEED = 0.2
"""m/s at which it drives back."""
PATIENCE, MOVED, TURNED, FREED = to_ns(2.5), 0.1, math.cos(1.0), 0.5
"""A leader is boxed in that has not moved so many metres in so many nanoseconds, but has turned (cosine of the angle);
until it has moved so many metres."""
ROOM = 1.6
"""Metres from base to base that it then gets."""
FACING, FACED = 1.2, 2.0
"""Metres from the head within which a robot begins to stand face to face with it, and beyond which it does no more."""
FACED_FOR = to_ns(4.0)
"""Nanoseconds face to face after which it drives round the head to its place behind it, because that cannot get on."""


class BoxedIn:
    """Whether a leader has no room to get on."""

    def __init__(self) -> None:
        self._leader, self._since = Pose2(0.0, 0.0, 0.0), 0
        """Where it has got on last, and when (ns)."""
        self._has_turned = self._is_boxed = False

    def rest(self) -> None:
        """What kept it until now is no reason to act."""
        self._since = 0

    def look(self, now: int, leader: Pose2) -> bool:
        """Whether it is boxed in, at `leader` in map at time `now` (ns)."""
        if not self._since or math.dist(leader[:2], self._leader[:2]) > (FREED if self._is_boxed else MOVED):
            self._leader, self._since, self._has_turned = leader, now, False
        self._has_turned = self._has_turned or math.cos(leader.yaw - self._leader.yaw) < TURNED
        self._is_boxed = self._has_turned and now - self._since > PATIENCE
        return self._is_boxed


class MakingRoom:
    """What a robot does instead of following: it goes round a head that faces it, or drives back."""

    def __init__(self) -> None:
        self._around, self._escape = Around(), Escape()
        self._faced_since: int | None = None
        """Nanoseconds: since when it stands face to face with the head."""
        self._boxed_in = BoxedIn()
        self.asking: int | None = None
        """The robot for which it drives back."""

    def rest(self) -> None:
        """What stands in its way does so from now on."""
        self._escape.rest()
        self._faced_since = None
        self._boxed_in.rest()

    def step(
        self, view: View, own: Pose2, role: LineRole, head: Pose2, back: float, limits: SpeedLimits, *, driven_on: float
    ) -> tuple[Twist | None, str]:
        """The velocity of a robot at `own` (map) with this `role` behind a head that keeps its place, as one that is
        driven by hand does, and is at `head` (map); and what it does.

        An empty text means: follow. A text without a velocity means: back up from a robot that comes too near from
        ahead, or is boxed in, or says that this one is in its way.

        `back`: metres behind the head where it belongs. `driven_on`: metres that the robot ahead has driven away since
        its pose, which may be late.
        """
        before, asked, is_ahead, at = role.before, self.asking, False, None
        self.asking = None
        # Those between the first and the last one only ask in words, and until they have room.
        for robot in before if role.stopped or asked is not None else before[:: max(1, len(before) - 1)]:
            found, at = view.map_from_robot(robot), None
            if found is None:
                continue
            pose, is_first = found[0], robot == before[0]
            x, y = own.locate(pose.x, pose.y)
            at = Pose2(x + driven_on if is_first else x, y, pose.yaw - own.yaw)
            is_boxed = robot == before[-1] and self._boxed_in.look(view.now, head)
            near = ROOM if is_boxed else MET if robot == asked else 0.0
            is_near = at.x > 0.0 and ((near and math.hypot(at.x, at.y) < near) or (is_first and is_too_near(at)))
            if self.asking is None and (is_near or robot in role.stopped):
                self.asking, is_ahead = robot, at.x > 0.0
        command = self._go_round(view, at, back, limits)
        if command is not None:
            return self._escape.free(view, command), f"drives round {names.robot_name(before[-1])}"
        return None, f"makes room for {names.robot_name(self.asking)}" if is_ahead else ""

    def _go_round(self, view: View, head: Pose2 | None, back: float, limits: SpeedLimits) -> Twist | None:
        """To the place behind a head that has faced it for long, if there is a way; `head` is in the own base frame."""
        apart = math.inf if head is None else math.hypot(head.x, head.y)
        if head is None or apart > FACED or head.locate(0.0, 0.0)[0] <= 0.0:
            self._faced_since = None
        elif self._faced_since is None and head.x > 0.0 and apart < FACING:
            self._faced_since = view.now
        if head is None or self._faced_since is None or view.now - self._faced_since <= FACED_FOR:
            return None
        x, y, _ = head.compose(Pose2(-back, 0.0, 0.0))
        if self._around.find_heading(view, math.atan2(y, x), math.hypot(x, y)) is None:
            return None
        return self._around.drive_to(view, x, y, limits)


def is_too_near(ahead: Pose2) -> bool:
    """Whether a robot has to drive back from the one at `ahead` (own base frame)."""
    apart = math.hypot(ahead.x, ahead.y)
    if ahead.x <= 0.0 or apart >= MET:
        return False
    x, y = ahead.locate(0.0, 0.0)
    is_met = x > 0.0 and max(abs(ahead.y), abs(y)) < BESIDE
    return is_met or apart < NEAR


def back_up(own: Pose2, path: Polyline, place: float) -> Twist:
    """The velocity back along the way behind `place`."""
    x, y = own.locate(*path.point(place - LOOK_AHEAD))
    square = x * x + y * y
    turn = 0.0 if x >= 0.0 or square < 1e-4 else -BACK_SPEED * curvature_to(y, square)
    return Twist(Vector3(-BACK_SPEED), Vector3(z=max(-1.0, min(1.0, turn))))
