"""How a robot drives to its slot and stays in it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from zteam.behaviors.yielding import HORIZON, Other, give_way
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import Twist, Vector3

SLOT_GAIN = 2.0
"""1/s: speed towards the slot."""
TURN_GAIN = 3.0
"""1/s."""
SPOT_ANGLE = 1.0
"""Radians: it turns on the spot towards a direction that is further off."""
STANDING = 0.02
"""m/s: what is slower stands."""
CLOSE = 0.45
"""Metres: near its slot no robot is passed nearer. In bends the inner robots come nearer to each other."""
LEAST_FORWARD = 0.05
"""m/s along the slot's heading while the slot moves."""
ALIGNED = 0.05
"""Radians to a heading from which on it does not turn."""
NEAR = 0.5
"""Metres to the slot within which it moves and turns as the slot does."""


class Target(NamedTuple):
    """A slot now, in map."""

    pose: Pose2
    speed: float
    """m/s along its heading."""
    turn: float
    """rad/s."""


def velocity_to(
    here: Pose2, target: Target, others: Sequence[Other], room: float, max_linear: float
) -> tuple[float, float]:
    """The velocity (m/s, in map) that takes the slot's motion and closes the distance to it, past the others.

    No other is passed nearer than `room` (m).
    """
    x, y = target.pose.x - here.x, target.pose.y - here.y
    distance = math.hypot(x, y)
    cos, sin = math.cos(target.pose.yaw), math.sin(target.pose.yaw)
    pull = SLOT_GAIN * min(1.0, max_linear / max(SLOT_GAIN * distance, 1e-9))
    forward, side = target.speed + pull * (cos * x + sin * y), pull * (cos * y - sin * x)
    if target.speed > STANDING:
        # A robot ahead of its slot waits for it and does not turn back.
        forward = max(forward, LEAST_FORWARD)
    # Once it is in its slot it moves with the others.
    soon = min(HORIZON, distance / max(math.hypot(forward - target.speed, side), STANDING))
    room = room if distance > NEAR else min(room, CLOSE)
    return give_way(here, cos * forward - sin * side, sin * forward + cos * side, others, room, soon)


def steer(x: float, y: float, yaw: float, turn: float, max_linear: float, max_angular: float) -> Twist:
    """The unicycle's command for a velocity (m/s, in map) and a turn rate besides (rad/s)."""
    angle = normalize_angle(math.atan2(y, x) - yaw)
    speed = min(math.hypot(x, y), max_linear) * math.cos(angle) if abs(angle) < SPOT_ANGLE else 0.0
    return Twist(Vector3(speed), Vector3(z=_limit(TURN_GAIN * angle + turn, max_angular)))


def turn_to(angle: float, max_angular: float) -> Twist:
    """Turn on the spot by this angle (rad)."""
    angle = normalize_angle(angle)
    return Twist(angular=Vector3(z=0.0 if abs(angle) < ALIGNED else _limit(TURN_GAIN * angle, max_angular)))


def _limit(turn: float, most: float) -> float:
    return max(-most, min(most, turn))
