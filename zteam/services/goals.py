"""Goals of robots: as messages, and what becomes of each. Pure: fed with statuses."""

import math
from enum import IntEnum

import msgspec

from zteam import names
from zteam.behaviors.go_to import GOAL_REACHED, NO_WAY, REFUSED
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
    time_from_ns,
)

SETTLED = to_ns(1.0)
"""After this time (ns) a status is about a new goal for certain; one of the behaviour go_to names no goal."""


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
ON_THE_WAY = frozenset({NavigationState.PLANNING, NavigationState.DRIVING, NavigationState.RECOVERING})
"""States of a goal that lasts."""


def goal_message(pose: Pose2, frame: str = names.MAP_FRAME, stamp: Time | None = None) -> PoseStamped:
    """A planar pose (m, rad) as a message."""
    turn = Quaternion(*quaternion_from_yaw(pose.yaw))
    return PoseStamped(Header(stamp or Time(), frame), Pose(Point(pose.x, pose.y), turn))


def stamped(goal: PoseStamped, stamp: int) -> PoseStamped:
    """The goal with another stamp (ns)."""
    header = msgspec.structs.replace(goal.header, stamp=time_from_ns(stamp))
    return msgspec.structs.replace(goal, header=header)


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
        self.is_replaced = False
        """Whether it ended because another goal took its place."""

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
            if status.state == NavigationState.IDLE:
                self.end(TaskResult.FAILED, "navigation began anew and has forgotten the goal")
            else:
                self.replace(status.goal)

    def replace(self, goal: PoseStamped) -> None:
        """Another goal has taken its place."""
        self.is_replaced |= not self.ended
        self.end(TaskResult.FAILED, f"another goal took its place: {goal_text(goal)}")

    def end(self, result: TaskResult, text: str) -> None:
        """Give it a result, unless it has one."""
        if not self.ended:
            self.result, self.text = result, text


class OtherGoal:
    """The goal of another sender while it lasts. Times are the team's, in ns."""

    def __init__(self) -> None:
        self.goal: PoseStamped | None = None
        """None while there is none."""
        self._came = 0
        """When it was heard."""

    @property
    def lack(self) -> str:
        """What is waited for while it lasts; else empty."""
        return "" if self.goal is None else f"the end of another goal: {goal_text(self.goal)}"

    def hear(self, goal: PoseStamped, own: GoalWatch | None, now: int) -> bool:
        """It was sent, and ends one's own goal; whether it should be sent again, to be the newest for certain."""
        self.goal, self._came = goal, now
        if own is None:
            return False
        # Both were sent at about the same time, and navigation may have heard one's own last.
        again = not own.ended and own.status is None
        own.replace(goal)
        return again

    def take(self, status: NavigationStatus, own: GoalWatch | None, now: int) -> None:
        """Navigation said something, about this goal, one's own or a third one."""
        if status.state in ON_THE_WAY and not (own is not None and _is_same(status.goal, own.goal)):
            self.goal, self._came = status.goal, now
        elif self.goal is not None and (_is_same(status.goal, self.goal) or not 0 <= now - self._came < SETTLED):
            # Before it has settled, navigation may still speak of the goal before.
            self.goal = None

    def take_go_to(self, status: RobotStatus) -> None:
        """A robot that runs the behaviour go_to said something."""
        told = None if self.goal is None else status_of_go_to(status, stamped(self.goal, self._came))
        if told is not None and told.state not in ON_THE_WAY:
            self.goal = None


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
