"""How a robot gets free that has to turn on the spot where there is no room to turn."""

import math

from zteam.behaviors.view import View
from zteam.clock import to_ns
from zteam.geometry import normalize_angle, yaw_from_quaternion
from zteam.messages import Twist, Vector3

PATIENCE = to_ns(1.0)
"""Nanoseconds without turning after which it moves."""
TURNED = 0.05
"""Radians that count as turning."""
AGAIN = to_ns(0.5)
"""Nanoseconds after which what it wanted before does not count."""
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
