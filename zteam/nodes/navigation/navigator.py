"""One robot's way to its goal: plan, drive, recover, arrive or give up. Without a bus and without a clock."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.messages import NavigationState, PoseStamped
from zteam.nodes.navigation.costmaps import Costmaps, Sight
from zteam.planning.checkers import GoalChecker, ProgressChecker
from zteam.planning.collisions import Velocity
from zteam.planning.controller import BlockedError, Controller
from zteam.planning.parameters import Parameters
from zteam.planning.planner import NoPathError, Planner
from zteam.planning.recovery import Recovery

Floats = NDArray[np.float64]

PATIENCE = 10.0
"""Seconds that a robot stands without what it needs, such as its place, before it gives up its goal."""
_AGAIN = 0.3
"""Seconds between two plans of a robot whose way is blocked."""
_ACTIVE = frozenset({NavigationState.PLANNING, NavigationState.DRIVING, NavigationState.RECOVERING})
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
    velocity: Velocity
    """Of the robot."""
    pending: Velocity
    """The command that moves it until the one of this step does."""


class Navigator:
    """The state machine of one robot."""

    def __init__(self, parameters: Parameters, planner: Planner, controller: Controller) -> None:
        """`planner` may be shared: it keeps nothing from one plan to the next."""
        self._parameters = parameters
        self._planner = planner
        self.controller = controller
        self._goal_checker = GoalChecker(parameters.goal)
        self._progress = ProgressChecker(parameters.progress)
        self._recovery = Recovery(parameters.recovery)
        self.state = NavigationState.IDLE
        self.goal: Goal | None = None
        self.message = PoseStamped()
        """The newest goal as it was sent, also one that was refused."""
        self.text = ""
        self.recoveries = 0
        self.path: Floats | None = None
        """(n, 3) in `map`; another object for each plan."""
        self._begin()

    def _begin(self) -> None:
        """Forget what belongs to one goal."""
        self._goal_checker.reset()
        self._progress.reset()
        self._recovery.reset()
        self.recoveries = 0
        self.path = None
        self._planned = -math.inf
        self._blocked_since: float | None = None
        self._held_since: float | None = None
        self._reached_from: Pose2 | None = None
        """Where the robot was when it last got on, since a recovery."""

    def reset(self) -> None:
        """Time jumped back: there is no goal."""
        self._begin()
        self._end(NavigationState.IDLE, "")
        self.message = PoseStamped()

    @property
    def active(self) -> bool:
        """Whether the robot is on its way."""
        return self.state in _ACTIVE

    @property
    def distance_remaining(self) -> float:
        """Metres of the path before the robot; the straight way where there is no path yet."""
        return self.controller.remaining() if self.active and self.path is not None else 0.0

    def accept(self, goal: Goal) -> None:
        """Go there: it replaces the goal that there was."""
        self._begin()
        self.goal, self.message = goal, goal.message
        self.state, self.text = NavigationState.PLANNING, ""

    def refuse(self, message: PoseStamped, reason: str) -> None:
        """A goal that cannot be: the one that there was is given up as well."""
        self.message = message
        self._end(NavigationState.ABORTED, reason)

    def cancel(self) -> bool:
        """Give up the goal; False if there is none."""
        if not self.active:
            return False
        self._end(NavigationState.CANCELED, "canceled")
        return True

    def _end(self, state: NavigationState, text: str) -> None:
        self.state, self.text = state, text
        self.goal = self.path = None

    def plan_anew(self) -> None:
        """There is another map: what was planned on the old one does not count."""
        self.path, self._planned = None, -math.inf
        if self.active:
            self.state = NavigationState.PLANNING

    def wait(self, now: float, reason: str, *, patiently: bool = False) -> Velocity:
        """Something that is needed is missing: stand, say why, and give up after PATIENCE unless `patiently`."""
        self._progress.reset()
        self._held_since = now if self._held_since is None or patiently else self._held_since
        if now - self._held_since > PATIENCE:
            self._end(NavigationState.ABORTED, f"{reason}, for {PATIENCE:g} s")
        else:
            self.text = reason
        return STOP

    def step(self, moment: Moment, costmaps: Costmaps) -> Velocity:
        """The velocity for a robot on its way."""
        self._held_since = None
        if self.state is NavigationState.RECOVERING:
            return self._recover(moment, costmaps)
        if self._is_plan_due(moment.now) and not self._plan(moment, costmaps):
            return STOP
        return self._drive(moment, costmaps)

    def _is_plan_due(self, now: float) -> bool:
        interval = 1.0 / self._parameters.planner_server.expected_planner_frequency
        interval = interval if self._blocked_since is None else min(interval, _AGAIN)
        return now - self._planned >= interval - 1e-6

    def _plan(self, moment: Moment, costmaps: Costmaps) -> bool:
        """Whether there is a path to follow now; if there is none, a recovery begins, or the goal is given up."""
        assert self.goal is not None
        self._planned = moment.now
        costmaps.look_far(moment.now, moment.sight)
        try:
            plan = self._planner.plan(costmaps.whole, moment.sight.pose, self.goal.pose)
        except NoPathError as error:
            if self.path is not None:
                # What is in the way may go away; the controller stops before it.
                return True
            reason = self._lasting_reason(moment, costmaps)
            if reason:
                self._end(NavigationState.ABORTED, reason)
            else:
                self._fail(moment, str(error))
            return False
        self.path = plan.path
        self.controller.set_path(plan.path)
        self.state = NavigationState.DRIVING
        self.text = f"plans to {plan.short_of_goal:.2f} m from the goal" if plan.short_of_goal else ""
        return True

    def _lasting_reason(self, moment: Moment, costmaps: Costmaps) -> str:
        """Why there is no way on the map itself, whatever lasers have seen; empty if there is one."""
        assert self.goal is not None
        try:
            self._planner.plan(costmaps.static, moment.sight.pose, self.goal.pose)
        except NoPathError as error:
            return str(error)
        return ""

    def _drive(self, moment: Moment, costmaps: Costmaps) -> Velocity:
        assert self.path is not None
        pose, end = moment.sight.pose, self.path[-1]
        if self._goal_checker.is_reached(pose, Pose2(*end.tolist())):
            self._end(NavigationState.SUCCEEDED, self.text)
            return STOP
        if not self._progress.makes_progress(moment.now, pose):
            options = self._parameters.progress
            distance, allowance = options.required_movement_radius, options.movement_time_allowance
            return self._fail(moment, f"moved less than {distance:g} m in {allowance:g} s")
        self._note_progress(pose)
        ahead = _move(pose, moment.pending, moment.seconds)
        try:
            velocity = self.controller.command(costmaps.local, ahead, moment.pending, moment.seconds)
        except BlockedError as error:
            if self._blocked_since is None:
                self._blocked_since, self._planned = moment.now, -math.inf
            if moment.now - self._blocked_since > self._parameters.controller.failure_tolerance:
                return self._fail(moment, str(error))
            return STOP
        self._blocked_since = None
        return velocity

    def _note_progress(self, pose: Pose2) -> None:
        """After a recovery that helped, all of them may be tried again."""
        start = self._reached_from
        radius = self._parameters.progress.required_movement_radius
        if start is not None and math.hypot(pose.x - start.x, pose.y - start.y) > radius:
            self._recovery.reset()
            self._reached_from = None

    def _fail(self, moment: Moment, reason: str) -> Velocity:
        """Begin the next recovery, or give up."""
        end = self._recovery.begin(moment.now, moment.sight.pose, reason)
        if end is not None:
            self._end(NavigationState.ABORTED, end)
        else:
            self.recoveries += 1
            self.state, self.text = NavigationState.RECOVERING, reason
            self._reached_from = self._reached_from or moment.sight.pose
        return STOP

    def _recover(self, moment: Moment, costmaps: Costmaps) -> Velocity:
        options = self._parameters.recovery
        clears = options.behaviors[(self._recovery.count - 1) % len(options.behaviors)] == "clear_costmap"
        step = self._recovery.step(moment.now, moment.sight.pose, costmaps.local)
        if clears:
            costmaps.clear_around(moment.sight.pose, options.clear_distance)
        if not step.is_over:
            return step.velocity
        self._progress.reset()
        self._planned, self._blocked_since = -math.inf, None
        self.path = None
        self.state = NavigationState.PLANNING
        return STOP


def _move(pose: Pose2, velocity: Velocity, seconds: float) -> Pose2:
    """Where a robot is after it has driven so, on an arc."""
    heading = pose.yaw + 0.5 * velocity.turn * seconds
    cos, sin = math.cos(heading), math.sin(heading)
    x = pose.x + (cos * velocity.x - sin * velocity.y) * seconds
    y = pose.y + (sin * velocity.x + cos * velocity.y) * seconds
    return Pose2(x, y, pose.yaw + velocity.turn * seconds)
