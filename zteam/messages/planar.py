"""Poses of messages in the plane, and back; and velocities that a step returns."""

import logging
import math
from numbers import Real
from typing import Any

from zteam.clock import Every
from zteam.errors import BehaviorError
from zteam.geometry import FAR, Pose2, quaternion_from_yaw, turn_problem, yaw_from_quaternion
from zteam.messages.geometry_msgs import Point, Pose, Quaternion, Twist, Vector3

log = logging.getLogger("zteam")
_MAY_WARN = Every(60.0)


def pose2_of(pose: Pose) -> Pose2:
    """The planar part of a pose (m, rad), whose orientation is a unit quaternion."""
    place, turn = pose.position, pose.orientation
    return Pose2(place.x, place.y, yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w))


def pose_message(pose: Pose2) -> Pose:
    """A pose in the plane (m, rad) as a message."""
    return Pose(Point(pose.x, pose.y), Quaternion(*quaternion_from_yaw(pose.yaw)))


def planar(pose: Pose) -> Pose2 | None:
    """A pose of the wire in the plane; None if it is not finite, too far away, or its orientation is no rotation."""
    p, q = pose.position, pose.orientation
    norm = math.hypot(q.x, q.y, q.z, q.w)
    if not (abs(p.x) <= FAR and abs(p.y) <= FAR and 0.9 < norm < 1.1):
        return None
    return Pose2(p.x, p.y, yaw_from_quaternion(q.x / norm, q.y / norm, q.z / norm, q.w / norm))


def is_finite(pose: Pose) -> bool:
    p, q = pose.position, pose.orientation
    return all(map(math.isfinite, (p.x, p.y, p.z, q.x, q.y, q.z, q.w)))


def checked_command(command: Any, what: str) -> Twist:
    """`command`, returned by `what`. Raises BehaviorError if it is no velocity."""
    if isinstance(command, Twist):
        if isinstance(command.linear, Vector3) and isinstance(command.angular, Vector3):
            for speed in (command.linear.x, command.angular.z):
                if not isinstance(speed, (float, Real)):
                    raise BehaviorError(f"{what} returned the speed {speed!r}; give numbers, m/s and rad/s")
            if abs(command.angular.z) > math.tau and _MAY_WARN.due():
                # Most likely its author means degrees; the base turns slower.
                log.warning("%s: the turn rate %s", what, turn_problem(command.angular.z))
            return command
        raise BehaviorError(f"{what} returned {command!r}; return a Twist(Vector3(forward), Vector3(z=turn))")
    shown = "None" if command is None else f"a {type(command).__name__}"
    raise BehaviorError(f"{what} returned {shown}; return a Twist")
