"""Poses of messages in the plane, and back."""

from zteam.geometry import Pose2, quaternion_from_yaw, yaw_from_quaternion
from zteam.messages.geometry_msgs import Point, Pose, Quaternion


def pose2_of(pose: Pose) -> Pose2:
    """The planar part of a pose (m, rad), whose orientation is a unit quaternion."""
    place, turn = pose.position, pose.orientation
    return Pose2(place.x, place.y, yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w))


def pose_message(pose: Pose2) -> Pose:
    """A pose in the plane (m, rad) as a message."""
    return Pose(Point(pose.x, pose.y), Quaternion(*quaternion_from_yaw(pose.yaw)))
