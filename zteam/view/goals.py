"""Goals from their sending to their end, as the document `goals` tells them."""

from collections.abc import Callable, Collection, Iterator

import msgspec

from zteam import names
from zteam.errors import short
from zteam.geometry import Pose2
from zteam.messages import NavigationState, NavigationStatus, PoseStamped, ns_from_time
from zteam.messages.planar import pose2_of
from zteam.robot.client import GONE, ON_THE_WAY, SETTLED, is_same_goal
from zteam.view.received import Arrival, Received

SENT = "sent"
"""Of a goal of which its robot has said nothing yet; all other states are those of `NavigationState`, in lower case."""


class GoalRow(msgspec.Struct):
    """The newest goal of a robot, in `map`."""

    robot: int
    x: float
    y: float
    yaw: float
    stamp: int
    """Nanoseconds at which it was sent."""
    state: str
    distance: float | None = None
    """Metres that are left."""
    seconds: float | None = None
    """What they take."""
    recoveries: int = 0
    text: str = ""
    """Why the robot does not get on, or why it has given up."""


def newest_goal(sent: Arrival | None, told: Arrival | None) -> tuple[PoseStamped, NavigationStatus | None] | None:
    """The newest goal of a robot and the status about it, of the goal that was sent last and of what the robot told
    last; None if it has none."""
    goal, status = sent and sent.read(PoseStamped), told and told.read(NavigationStatus)
    if status is None or told is None:
        return None if goal is None else (goal, None)
    if goal is not None and sent is not None and not is_same_goal(goal, status.goal):
        # The robot may still speak of the goal before.
        ahead = ns_from_time(status.header.stamp) - ns_from_time(goal.header.stamp)
        if told.number < sent.number or -SETTLED < ahead < SETTLED:
            return goal, None
    return None if status.state == NavigationState.IDLE else (status.goal, status)


def goal_row(robot_id: int, goal: PoseStamped, status: NavigationStatus | None, frame: Pose2) -> GoalRow:
    """A goal, whose frame's pose in `map` is `frame`."""
    row = GoalRow(robot_id, *frame.compose(pose2_of(goal.pose)), ns_from_time(goal.header.stamp), SENT)
    if status is None:
        return row
    row.state = NavigationState(min(status.state, NavigationState.CANCELED)).name.lower()
    row.recoveries, row.text = status.recoveries, short(status.text)
    if status.state in ON_THE_WAY:
        left = status.estimated_time_remaining
        row.distance = round(status.distance_remaining, 1) or None
        # In whole seconds: a document that says more would change with every status.
        row.seconds = round(left.sec + left.nanosec / 1e9) or None
    return row


class Goals:
    """The newest goals of all robots. One thread makes all calls; the caller passes the host's time."""

    def __init__(
        self, received: Received, alive: Callable[[str], bool], pose_of: Callable[[str], Pose2 | None]
    ) -> None:
        """`alive`: whether a process holds a name; `pose_of`: the pose of a frame in `map`."""
        self._received, self._alive, self._pose_of = received, alive, pose_of
        self._told: dict[int, Arrival] = {}
        """The newest status of what takes the robot's goals."""
        self._gone: dict[int, float] = {}
        """Since when the process that drives to a goal is gone."""

    def rows(self, robots: Collection[int], now: float) -> Iterator[GoalRow]:
        for robot_id in sorted(robots):
            sent = self._received.read(names.robot_key(robot_id, names.GOAL_POSE), PoseStamped)
            found = newest_goal(sent and sent[0], self._newest_told(robot_id))
            frame = found and self._pose_of(found[0].header.frame_id or names.MAP_FRAME)
            if found and frame:
                row = goal_row(robot_id, *found, frame)
                if found[1] is not None and found[1].state in ON_THE_WAY:
                    self._end_with_process(row, found[1], now)
                yield row

    def _newest_told(self, robot_id: int) -> Arrival | None:
        found = self._received.read(names.robot_key(robot_id, names.NAVIGATION_STATUS), NavigationStatus)
        if found is None:
            self._told.pop(robot_id, None)
        elif not (_is_behavior(robot_id, found[1]) and self._alive(names.navigation_name(robot_id))):
            # The header's frame tells a behaviour from navigation, which wins over it.
            self._told[robot_id] = found[0]
        return self._told.get(robot_id)

    def _end_with_process(self, row: GoalRow, status: NavigationStatus, now: float) -> None:
        name = names.robot_name if _is_behavior(row.robot, status) else names.navigation_name
        if self._alive(name(row.robot)):
            self._gone.pop(row.robot, None)
        elif now - self._gone.setdefault(row.robot, now) > GONE:
            row.state, row.text = "aborted", f"the process {name(row.robot)} is gone"


def _is_behavior(robot_id: int, status: NavigationStatus) -> bool:
    return status.header.frame_id == names.robot_name(robot_id)
