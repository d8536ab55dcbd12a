"""A robot's path, and how it follows it: the planner, the controller, and when to plan anew."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.messages import PoseStamped
from zteam.nodes.navigation.costmaps import Costmaps, Sight
from zteam.planning.controller import BlockedError, Controller, Velocity
from zteam.planning.parameters import Parameters
from zteam.planning.planner import NoPathError, Planner

Floats = NDArray[np.float64]

_AGAIN = 0.3
"""Seconds between two plans of a robot whose way is blocked."""
STOP = Velocity()


class Goal(NamedTuple):
    """Where to go."""

    message: PoseStamped
    """As it was sent."""
    pose: Pose2
    """In `map`."""


class Moment(NamedTuple):
    """What one step goes by. Times are in seconds."""

    now: float
    seconds: float
    """To the next step."""
    sight: Sight
    pending: Velocity
    """The command that moves the robot until the one of this step does."""
    is_stopped: bool = False
    """Whether something else, such as its safety layer, does not let the robot move."""


class Way:
    """The path to one goal after the other."""

    def __init__(self, parameters: Parameters, planner: Planner, controller: Controller) -> None:
        """`planner` may be shared: it keeps nothing from one plan to the next."""
        self._parameters = parameters
        self._planner = planner
        self.controller = controller
        self.forget()

    def forget(self) -> None:
        """There is no path, and a plan is due."""
        self.path: Floats | None = None
        """(n, 3) in `map`; another object for each plan."""
        self._planned = -math.inf
        self._blocked_since: float | None = None

    @property
    def remaining(self) -> float:
        """Metres of the path before the robot."""
        return 0.0 if self.path is None else self.controller.remaining()

    def is_plan_due(self, now: float) -> bool:
        """Whether it is time for another plan."""
        interval = 1.0 / self._parameters.planner_server.expected_planner_frequency
        interval = interval if self._blocked_since is None else min(interval, _AGAIN)
        return now - self._planned >= interval - 1e-6

    def plan(self, moment: Moment, costmaps: Costmaps, goal: Pose2) -> str:
        """Plan; return what is to be said of the plan. Raises NoPathError."""
        self._planned = moment.now
        costmaps.look_far(moment.now, moment.sight)
        plan = self._planner.plan(costmaps.whole, moment.sight.pose, goal)
        self.path = plan.path
        self.controller.set_path(plan.path)
        return f"plans to {plan.short_of_goal:.2f} m from the goal" if plan.short_of_goal else ""

    def lasting_reason(self, moment: Moment, costmaps: Costmaps, goal: Pose2) -> str:
        """Why there is no way on the map itself, whatever lasers have seen; empty if there is one."""
        try:
            self._planner.plan(costmaps.static, moment.sight.pose, goal)
        except NoPathError as error:
            return str(error)
        return ""

    def follow(self, moment: Moment, costmaps: Costmaps) -> Velocity:
        """The command along the path; zero while it is blocked. Raises BlockedError if it stays so."""
        ahead = move(moment.sight.pose, moment.pending, moment.seconds)
        try:
            velocity = self.controller.command(costmaps.local, ahead, moment.pending, moment.seconds)
        except BlockedError:
            if self._blocked_since is None:
                self._blocked_since, self._planned = moment.now, -math.inf
            if moment.now - self._blocked_since > self._parameters.controller.failure_tolerance:
                raise
            return STOP
        self._blocked_since = None
        return velocity


def move(pose: Pose2, velocity: Velocity, seconds: float) -> Pose2:
    """Where a robot is after it has driven so, on an arc."""
    heading = pose.yaw + 0.5 * velocity.turn * seconds
    cos, sin = math.cos(heading), math.sin(heading)
    x = pose.x + (cos * velocity.x - sin * velocity.y) * seconds
    y = pose.y + (sin * velocity.x + cos * velocity.y) * seconds
    return Pose2(x, y, pose.yaw + velocity.turn * seconds)
