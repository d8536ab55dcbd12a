"""Goals for tests of behaviours, and a floor on which robot 0 has one."""

import math
from collections.abc import Sequence

import msgspec

from support.flat_floor import Floor, Segment
from zteam.behaviors import View
from zteam.geometry import Pose2, quaternion_from_yaw
from zteam.messages import Header, Point, Pose, PoseStamped, Quaternion


def make_goal(x: float, y: float, yaw: float = 0.0, frame: str = "map") -> PoseStamped:
    """A goal pose as a tool publishes it."""
    return PoseStamped(header=Header(frame_id=frame), pose=Pose(Point(x, y), Quaternion(*quaternion_from_yaw(yaw))))


class GoalFloor(Floor):
    """A floor on which each robot has the goal of its id in `goals`, or none."""

    def __init__(self, poses: Sequence[Pose2], walls: Sequence[Segment], *goals: PoseStamped | None) -> None:
        super().__init__(poses, walls)
        self.goals = list(goals)

    def view(self, robot_id: int) -> View:
        """As on any floor, with the robot's goal."""
        goal = self.goals[robot_id] if robot_id < len(self.goals) else None
        return msgspec.structs.replace(super().view(robot_id), inputs={"goal": goal})

    def left(self, robot_id: int = 0) -> tuple[float, float]:
        """Metres and radians from a robot to its goal."""
        goal, pose = self.goals[robot_id], self.poses[robot_id]
        assert goal is not None
        place, turn = goal.pose.position, goal.pose.orientation
        yaw = math.remainder(2.0 * math.atan2(turn.z, turn.w) - pose.yaw, math.tau)
        return math.hypot(place.x - pose.x, place.y - pose.y), yaw
