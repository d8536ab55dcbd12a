"""Poses of messages in the plane, and back; and velocities that a step returns."""

import math
from collections import defaultdict
from collections.abc import Callable
from numbers import Real
from typing import Any

from zteam import names
from zteam.clock import Every
from zteam.errors import BehaviorError, log
from zteam.geometry import FAR, Pose2, quaternion_from_yaw, turn_problem, yaw_from_quaternion
from zteam.messages.geometry_msgs import Point, Pose, PoseStamped, Quaternion, Twist, Vector3
from zteam.messages.std_msgs import ns_from_time

_MAY_WARN: dict[int, Every] = defaultdict(lambda: Every(60.0))
"""By robot."""


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
    if not (abs(p.x) <= FAR and abs(p.y) <= FAR and 1e-3 <= norm < math.inf):
        return None
    return Pose2(p.x, p.y, yaw_from_quaternion(q.x / norm, q.y / norm, q.z / norm, q.w / norm))


def goal_in_map(goal: PoseStamped, robot_id: int, find: Callable[..., tuple[Pose2, int] | None]) -> Pose2 | str:
    """A robot's goal in `map`, or why it is none.

    `find(target, source, time=0)` is the pose of `source` in `target`, the newest with time 0, and its stamp (ns). The
    goal counts at its own time, or at the newest known one if it has no time or a later one. Its frame is one of the
    tree or, without the prefix, one of the robot; without a frame it is in `map`.
    """
    pose, time = planar(goal.pose), ns_from_time(goal.header.stamp)
    frame = names.strip_slash(goal.header.frame_id) or names.MAP_FRAME
    if pose is None:
        return "the goal is not finite, too far away, or its orientation is no rotation"
    if frame == names.MAP_FRAME:
        return pose
    for known in (frame, names.robot_frame(robot_id, frame)):
        if place := find(names.MAP_FRAME, known):
            place = find(names.MAP_FRAME, known, time) if 0 < time < place[1] else place
            return place[0].compose(pose) if place else f"the goal is too old: where {known} was then is not known"
    return f"the goal is in the frame {frame!r:.60}, from which no transform leads to {names.MAP_FRAME}"


def is_finite(pose: Pose) -> bool:
    p, q = pose.position, pose.orientation
    return all(map(math.isfinite, (p.x, p.y, p.z, q.x, q.y, q.z, q.w)))


def checked_command(command: Any, what: str, robot_id: int) -> Twist:
    """`command` for a robot, returned by `what`. Raises BehaviorError if it is no velocity."""
    if isinstance(command, Twist):
        if isinstance(command.linear, Vector3) and isinstance(command.angular, Vector3):
            for speed in (command.linear.x, command.angular.z):
                if not isinstance(speed, (float, Real)):
                    raise BehaviorError(f"{what} returned the speed {speed!r}; give numbers, m/s and rad/s")
            if abs(command.angular.z) > math.tau and _MAY_WARN[robot_id].due():
                # Most likely its author means degrees; the base turns slower.
                log.warning("%s: the turn rate %s", what, turn_problem(command.angular.z))
            return command
        raise BehaviorError(f"{what} returned {command!r}; return a Twist(Vector3(forward), Vector3(z=turn))")
    shown = "None" if command is None else f"a {type(command).__name__}"
    raise BehaviorError(f"{what} returned {shown}; return a Twist")
