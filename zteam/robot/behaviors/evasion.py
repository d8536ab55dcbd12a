"""How a robot gets past what stands between it and a place, and free where it has no room to turn."""

import math

from zteam.clock import to_ns
from zteam.geometry import normalize_angle, yaw_from_quaternion
from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.path import SpeedLimits
from zteam.robot.view import View, is_clear

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


PATIENCE = to_ns(1.0)
"""Nanoseconds without turning after which it moves."""
TURNED = 0.05
"""Radians that count as turning."""
AGAIN = to_ns(0.5)
"""Nanoseconds without being asked after which what it wanted before does not count."""
SPEED, FOR = 0.2, to_ns(1.0)
"""m/s at which it moves, and nanoseconds for which it does."""
MOVED, TRIED = 0.02, to_ns(0.4)
"""Metres that it has to come in so many nanoseconds; else it moves the other way."""


class Escape:
    """Back first, then forward, and so on, until it turns again; the safety layer lets it move where there is room."""

    def __init__(self) -> None:
        self._yaw = 0.0
        self._since = 0
        """Nanoseconds: since when it has not turned by TURNED from `_yaw` though it wants to."""
        self._way = 1.0
        """-1 while it moves back."""
        self._from, self._due = (0.0, 0.0), 0
        """Where it began to move, and when it has to have come away from there (ns)."""
        self._until = self._asked = 0

    def rest(self) -> None:
        """That it has not turned until now does not count."""
        self._until = self._asked = 0

    def free(self, view: View, command: Twist) -> Twist:
        """The velocity instead of `command`; odometry says whether the robot turns and moves."""
        if view.odom is None:
            return command
        pose, now = view.odom.pose.pose, view.now
        at, facing = (pose.position.x, pose.position.y), pose.orientation
        is_new, self._asked = now - self._asked > AGAIN, now
        if now < self._until:
            if now >= self._due and math.dist(at, self._from) < MOVED:
                self._move(now, at)
            return Twist(Vector3(self._way * SPEED))
        yaw = yaw_from_quaternion(facing.x, facing.y, facing.z, facing.w)
        wants = command.linear.x == 0.0 and command.angular.z != 0.0
        if is_new or not wants or abs(normalize_angle(yaw - self._yaw)) > TURNED:
            self._yaw, self._since = yaw, now
        elif now - self._since > PATIENCE:
            self._move(now, at)
            self._since = self._until = now + FOR
        return command

    def _move(self, now: int, at: tuple[float, float]) -> None:
        self._way, self._from, self._due = -self._way, at, now + TRIED
