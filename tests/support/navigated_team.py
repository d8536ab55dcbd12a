"""A team whose robots are navigated, as a test sees it: goals in, the newest status out."""

import math

from support.goals import make_goal
from zteam import names
from zteam.bus.presence import ProcessInfo
from zteam.messages import Message, NavigationState, NavigationStatus
from zteam.robot.client import CANCEL, CancelReply, CancelRequest, navigation_query
from zteam.team.testing.team import TeamFixture

FAKE = """
[team]
world = "arena"
seed = 4
[[robots]]
id = 0
navigation = {localizer = "fake", planner_server.GridBased.tolerance = 0.2}
[[robots]]
id = 1
behavior = "idle"
"""
"""A navigated robot with perfect poses, and one that stands."""
DONE = frozenset({NavigationState.SUCCEEDED, NavigationState.ABORTED, NavigationState.CANCELED})


class NavigatedTeam:
    """Sends goals to robots of a running team, and keeps what their navigation says."""

    def __init__(self, team: TeamFixture) -> None:
        self.team = team
        self.statuses: dict[int, list[NavigationStatus]] = {}
        team.bus.subscribe(names.all_robots_key(names.NAVIGATION_STATUS), NavigationStatus, self._take)

    def _take(self, key: str, status: NavigationStatus) -> None:
        target = names.split_robot_key(key)
        assert target is not None
        self.statuses.setdefault(target[0], []).append(status)

    def send(self, robot_id: int, topic: str, message: Message) -> None:
        """Publish below a robot, and wait until its navigation has it."""
        publisher = self.team.bus.publisher(names.robot_key(robot_id, topic), type(message))
        publisher.put(message)
        # What this session sends later comes later.
        self.team.bus.ask(navigation_query(robot_id, "info"), ProcessInfo, timeout=20.0)
        publisher.close()

    def go(self, robot_id: int, x: float, y: float, yaw: float = 0.0, frame: str = "map") -> None:
        """Send a goal; what was said before it is forgotten."""
        self.send(robot_id, names.GOAL_POSE, make_goal(x, y, yaw, frame))
        self.statuses.pop(robot_id, None)

    def cancel(self, robot_id: int) -> bool:
        """Cancel its goal; whether there was one."""
        key = navigation_query(robot_id, CANCEL)
        return self.team.bus.ask(key, CancelReply, CancelRequest(), timeout=20.0).canceled

    def state(self, robot_id: int) -> NavigationState:
        """The newest."""
        return NavigationState(self.newest(robot_id).state)

    def newest(self, robot_id: int) -> NavigationStatus:
        """The newest status; an empty one before the first."""
        return self.statuses.get(robot_id, [NavigationStatus()])[-1]

    def wait(self, robot_id: int, *states: NavigationState, within: float) -> None:
        """Let the world go on until the newest status has one of these states."""
        self.team.until(lambda: self.state(robot_id) in states, within)

    def distance(self, robot_id: int, x: float, y: float) -> float:
        """Metres from the robot to a point."""
        pose = self.team.robot(robot_id).pose
        return math.hypot(pose.x - x, pose.y - y)
