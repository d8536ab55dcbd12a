"""How a robot keeps to a path: it drives in an arc to a point of the path a little ahead (pure pursuit)."""

import math

import msgspec

from zteam.behaviors.polyline import Polyline
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3

LOOK_AHEAD = 0.3
"""Metres along the path from the robot to the point that it drives to."""
TURN_ON_THE_SPOT = 1.0
"""Radians: it turns on the spot while the point is further to the side."""
TURN_GAIN = 4.0
"""1/s: the turn on the spot, by the angle that is left."""
_NEAR = 0.02
"""Metres: a nearer point tells no direction."""


class Limits(msgspec.Struct, frozen=True):
    """What limits a robot on a path."""

    linear: float = math.inf
    """m/s."""
    angular: float = math.pi
    """rad/s, both ways."""
    lateral: float = math.inf
    """m/s²: acceleration to the side. It slows down in a bend so far."""


def pursue(
    pose: Pose2, path: Polyline, s: float, speed: float, limits: Limits, look_ahead: float = LOOK_AHEAD
) -> Twist:
    """The velocity of a robot at `pose` that keeps to `path` at `speed` (m/s, not negative) from its place `s` on.

    It slows down where the arc is too narrow for that speed, and it turns on the spot where the path leads to the side
    or back. At the end of the path it drives straight on: give a speed of 0 there. Raises IndexError without a path.
    """
    target_x, target_y, yaw = path.at(s + look_ahead)
    beyond = s + look_ahead - path.end
    if beyond > 0.0:
        target_x, target_y = target_x + beyond * math.cos(yaw), target_y + beyond * math.sin(yaw)
    dx, dy = target_x - pose.x, target_y - pose.y
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    x, y = cos * dx + sin * dy, cos * dy - sin * dx
    square = x * x + y * y
    if square < _NEAR * _NEAR and beyond < 0.0:
        # The path goes on, back past this place.
        return pursue(pose, path, s, speed, limits, 2.0 * look_ahead)
    if square < _NEAR * _NEAR or speed <= 0.0:
        return Twist()
    angle = math.atan2(y, x)
    if abs(angle) > TURN_ON_THE_SPOT:
        return Twist(angular=Vector3(z=min(max(TURN_GAIN * angle, -limits.angular), limits.angular)))
    curvature = 2.0 * y / square
    speed = slow_down(speed, curvature, limits)
    return Twist(linear=Vector3(x=speed), angular=Vector3(z=speed * curvature))


def slow_down(speed: float, curvature: float, limits: Limits) -> float:
    """The largest speed (m/s) up to `speed` with which a robot may drive an arc of this curvature (1/m)."""
    bend = abs(curvature)
    speed = min(speed, limits.linear)
    if speed * bend > limits.angular:
        speed = limits.angular / bend
    return math.sqrt(limits.lateral / bend) if speed * speed * bend > limits.lateral else speed
