"""How a car does what a behaviour wants of a base that can turn on the spot: on arcs, and by turns in several moves."""

import math

from zteam.clock import to_ns
from zteam.geometry import Velocity
from zteam.messages import Twist
from zteam.robot.safety.motion import limits_of
from zteam.robot.view import View

WHEEL_ANGLE = math.radians(45.0)
"""Of the steered wheels, at most: hardly a car turns them further."""
SLOW, SPEED = 0.1, 0.2
"""m/s of a move of such a turn, at least and at most."""
MOVE = 0.6
"""Metres of one move; it ends before where something is in the way."""
HAS_MOVED, WITHIN = 0.02, 0.4
"""Metres, and the seconds at full speed within which a robot that has moved less is stopped and drives back."""


class Steering:
    """Forward on the sharpest arc, back on the opposite one, and so on, until the way that is wanted can be driven."""

    def __init__(self) -> None:
        self._gear = 0.0
        """1 while it moves forward, -1 back; 0 while it needs no such moves."""
        self._from = self._last = (0.0, 0.0)
        """In odometry: where the move began, and where the robot was at `_since`."""
        self._since = 0

    def drive(self, view: View, wanted: Twist) -> Twist:
        """The car's command, speed and angle of its wheels, for a velocity in m/s and rad/s."""
        limits, x, turn = limits_of(view.base), wanted.linear.x, wanted.angular.z
        sharpest = math.tan(WHEEL_ANGLE) / limits.wheelbase
        if abs(turn) <= abs(x) * sharpest or view.odom is None:
            self._gear = 0.0
            return limits.command_of(Velocity(x, 0.0, turn))
        place, now = view.odom.pose.pose.position, view.now
        at = place.x, place.y
        is_over = math.dist(at, self._from) > MOVE
        speed = max(SLOW, min(SPEED, abs(x))) if x else SPEED
        # At first it slows down from the last move, then it gains speed.
        turning = speed / -view.base.decel_lim_x + speed / view.base.acc_lim_x
        if now - self._since >= to_ns(WITHIN + turning):
            is_over = is_over or math.dist(at, self._last) < HAS_MOVED
            self._last, self._since = at, now
        if not self._gear or is_over:
            self._gear = -self._gear or (-1.0 if x < 0.0 else 1.0)
            self._from, self._last, self._since = at, at, now
        return limits.command_of(Velocity(self._gear * speed, 0.0, math.copysign(speed * sharpest, turn)))
