"""How a robot gets free that has to turn on the spot where there is no room to turn."""

from zteam.behaviors.view import View
from zteam.clock import to_ns
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import Twist, Vector3

PATIENCE = to_ns(1.5)
"""Nanoseconds without turning after which it moves."""
TURNED = 0.05
"""Radians that count as turning."""
AGAIN = to_ns(0.5)
"""Nanoseconds after which what it wanted before does not count."""
SPEED, FOR = 0.2, to_ns(1.0)
"""m/s at which it moves, and nanoseconds for which it does."""


class Escape:
    """Back first, then forward, and so on, until it turns again; the safety layer lets it move where there is room."""

    def __init__(self) -> None:
        self._yaw = 0.0
        self._since = 0
        """Nanoseconds: since when it has not turned by TURNED from `_yaw` though it wants to."""
        self._way = 1.0
        """-1 while it moves back."""
        self._until = self._asked = 0

    def free(self, view: View, own: Pose2, command: Twist) -> Twist:
        """The velocity instead of `command` of a robot at `own` in map."""
        is_new, self._asked = view.now - self._asked > AGAIN, view.now
        if view.now < self._until:
            return Twist(Vector3(self._way * SPEED))
        wants = command.linear.x == 0.0 and command.angular.z != 0.0
        if is_new or not wants or abs(normalize_angle(own.yaw - self._yaw)) > TURNED:
            self._yaw, self._since = own.yaw, view.now
        elif view.now - self._since > PATIENCE:
            self._way, self._until = -self._way, view.now + FOR
            self._since = self._until
        return command
