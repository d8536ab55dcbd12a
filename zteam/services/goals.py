"""Goals of robots: as messages, and what becomes of each. Pure: fed with statuses."""

import math
from enum import IntEnum

from zteam import names
from zteam.behaviors.go_to import GOAL_REACHED, NO_WAY
from zteam.behaviors.goals import REFUSED
from zteam.clock import to_ns
from zteam.geometry import Pose2, quaternion_from_yaw, yaw_from_quaternion
from zteam.messages import (
    Header,
    NavigationState,
    NavigationStatus,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    RobotStatus,
    Time,
    ns_from_time,
)

SETTLED = to_ns(1.0)
"""A status of the behaviour go_to names no goal: only after this time (ns) it is about a new one for certain."""


class TaskResult(IntEnum):
    """How a task ended; UNKNOWN while it lasts. The values are Nav2's."""

    UNKNOWN = 0
    SUCCEEDED = 1
    CANCELED = 2
    FAILED = 3


_ENDS: dict[int, TaskResult] = {
    NavigationState.SUCCEEDED: TaskResult.SUCCEEDED,
    NavigationState.ABORTED: TaskResult.FAILED,
    NavigationState.CANCELED: TaskResult.CANCELED,
}


def goal_message(pose: Pose2, frame: str = names.MAP_FRAME, stamp: Time | None = None) -> PoseStamped:
    """A planar pose (m, rad) as a message."""
    turn = Quaternion(*quaternion_from_yaw(pose.yaw))
    return PoseStamped(Header(stamp or Time(), frame), Pose(Point(pose.x, pose.y), turn))


def goal_text(goal: PoseStamped) -> str:
    """A goal for users: `x 3.2, y 4, yaw 1.57`, with its frame if that is not the map's."""
    place, turn = goal.pose.position, goal.pose.orientation
    yaw = yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w)
    frame = goal.header.frame_id
    where = "" if frame in ("", names.MAP_FRAME) else f" in {frame}"
    x, y, yaw = (round(number, 3) + 0.0 for number in (place.x, place.y, yaw))
    return f"x {x:g}, y {y:g}, yaw {yaw:g}{where}"


class GoalWatch:
    """One goal from its sending to its end."""

    def __init__(self, goal: PoseStamped) -> None:
        self.goal = goal
        self.status: NavigationStatus | None = None
        """The newest that is about this goal."""
        self.result = TaskResult.UNKNOWN
        self.text = ""
        """Why it ended as it did, or why the robot does not get on; empty where there is nothing to say."""

    @property
    def ended(self) -> bool:
        """Whether there is a result."""
        return self.result != TaskResult.UNKNOWN

    def take(self, status: NavigationStatus) -> None:
        """Navigation said something, about this goal or another one. After the end nothing counts."""
        if self.ended:
            return
        if _is_same(status.goal, self.goal):
            self.status, self.text = status, status.text
            if status.state in _ENDS:
                self.end(_ENDS[status.state], status.text)
        elif self.status is not None:
            # It had taken this goal: what it has now came later.
            forgotten = status.state == NavigationState.IDLE
            why = "navigation began anew and has forgotten the goal" if forgotten else "another goal took its place"
            self.end(TaskResult.FAILED, why if forgotten else f"{why}: {goal_text(status.goal)}")

    def end(self, result: TaskResult, text: str) -> None:
        """Give it a result, unless it has one."""
        if not self.ended:
            self.result, self.text = result, text


def _is_same(one: PoseStamped, other: PoseStamped) -> bool:
    # Navigation may have resolved the frame.
    return one.header.stamp == other.header.stamp and one.pose == other.pose


def status_of_go_to(status: RobotStatus, goal: PoseStamped) -> NavigationStatus | None:
    """What a robot that runs the behaviour go_to says of its goal; None if it may still speak of the one before.

    Its distance is not known (NaN).
    """
    if ns_from_time(status.header.stamp) < ns_from_time(goal.header.stamp) + SETTLED:
        return None
    state = NavigationState.DRIVING
    if status.reason == GOAL_REACHED:
        state = NavigationState.SUCCEEDED
    elif status.reason == NO_WAY or status.reason.startswith(REFUSED):
        state = NavigationState.ABORTED
    text = "" if state == NavigationState.SUCCEEDED else status.reason
    return NavigationStatus(status.header, state, goal, distance_remaining=math.nan, text=text)
