"""Poses in the plane, and as messages."""

import math

from zteam.geometry import Pose2, quaternion_from_yaw, yaw_from_quaternion
from zteam.messages import Point, Pose, Quaternion


def planar(pose: Pose) -> Pose2 | None:
    """A pose of the wire in the plane; None if it is not finite or its orientation is no rotation."""
    p, q = pose.position, pose.orientation
    norm = math.hypot(q.x, q.y, q.z, q.w)
    if not all(map(math.isfinite, (p.x, p.y, norm))) or not 0.9 < norm < 1.1:
        return None
    return Pose2(p.x, p.y, yaw_from_quaternion(q.x / norm, q.y / norm, q.z / norm, q.w / norm))


def pose_message(pose: Pose2) -> Pose:
    """A pose in the plane as a message."""
    return Pose(Point(pose.x, pose.y), Quaternion(*quaternion_from_yaw(pose.yaw)))


def is_finite(pose: Pose) -> bool:
    """Whether all of its numbers are."""
    p, q = pose.position, pose.orientation
    return all(map(math.isfinite, (p.x, p.y, p.z, q.x, q.y, q.z, q.w)))
