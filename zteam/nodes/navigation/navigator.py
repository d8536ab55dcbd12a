"""One robot's way to its goal: plan, drive, recover, arrive or give up. Without a bus and without a clock."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.messages import NavigationState, PoseStamped
from zteam.nodes.navigation.costmaps import Costmaps
from zteam.nodes.navigation.recovering import Recovering
from zteam.nodes.navigation.way import STOP, Goal, Moment, Way
from zteam.planning.controller import BlockedError, Controller, GoalChecker, ProgressChecker, Velocity
from zteam.planning.parameters import Parameters
from zteam.planning.planner import NoPathError, Planner
from zteam.services.goals import ON_THE_WAY

Floats = NDArray[np.float64]

PATIENCE = 10.0
"""Seconds that a robot stands without what it needs, such as its place, before it gives up its goal."""


class Navigator:
    """The state machine of one robot."""

    def __init__(self, parameters: Parameters, planner: Planner, controller: Controller) -> None:
        self._parameters = parameters
        self._way = Way(parameters, planner, controller)
        self._goal_checker = GoalChecker(parameters.goal)
        self._progress = ProgressChecker(parameters.progress)
        self._recovering = Recovering(parameters)
        self.reset()

    def reset(self) -> None:
        """There is no goal, and there never was one."""
        self.state, self.text = NavigationState.IDLE, ""
        self.goal: Goal | None = None
        self.message = PoseStamped()
        """The newest goal as it was sent, also one that was refused."""
        self._begin()

    def _begin(self) -> None:
        """Forget what belongs to one goal."""
        self._goal_checker.reset()
        self._progress.reset()
        self._recovering.forget()
        self._way.forget()
        self._held_since: float | None = None

    @property
    def active(self) -> bool:
        """Whether the robot is on its way."""
        return self.state in ON_THE_WAY

    @property
    def path(self) -> Floats | None:
        """(n, 3) in `map`; another object for each plan."""
        return self._way.path

    @property
    def distance_remaining(self) -> float:
        """Metres of the path before the robot."""
        return self._way.remaining

    @property
    def recoveries(self) -> int:
        """How many were begun for this goal."""
        return self._recovering.count

    def use_controller(self, controller: Controller) -> None:
        """Drive with this one from now on."""
        self._way.controller = controller
        self.plan_anew()

    def accept(self, goal: Goal) -> None:
        """Go there: it replaces the goal that there was."""
        self._begin()
        self.goal, self.message = goal, goal.message
        self.state, self.text = NavigationState.PLANNING, ""

    def refuse(self, message: PoseStamped, reason: str) -> None:
        """A goal that cannot be: the one that there was is given up as well."""
        self._begin()
        self.message = message
        self._end(NavigationState.ABORTED, reason)

    def cancel(self) -> bool:
        """Give up the goal; False if there is none."""
        if not self.active:
            return False
        self._end(NavigationState.CANCELED, "canceled")
        return True

    def _end(self, state: NavigationState, text: str) -> None:
        self.state, self.text, self.goal = state, text, None
        self._way.forget()

    def plan_anew(self) -> None:
        """There is another map: what was planned on the old one does not count."""
        self._way.forget()
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
        if self._held_since is not None:
            self._held_since, self.text = None, ""
        if self.state is NavigationState.RECOVERING:
            return self._recover(moment, costmaps)
        if self._way.is_plan_due(moment.now) and not self._plan(moment, costmaps):
            return STOP
        return self._drive(moment, costmaps)

    def _plan(self, moment: Moment, costmaps: Costmaps) -> bool:
        """Whether there is a path to follow now; if there is none, a recovery begins, or the goal is given up."""
        assert self.goal is not None
        try:
            self.text = self._way.plan(moment, costmaps, self.goal.pose)
        except NoPathError as error:
            if self.path is not None:
                # What is in the way may go away; the controller stops before it.
                return True
            reason = self._way.lasting_reason(moment, costmaps, self.goal.pose)
            if reason:
                self._end(NavigationState.ABORTED, reason)
            else:
                self._fail(moment, str(error))
            return False
        self.state = NavigationState.DRIVING
        return True

    def _drive(self, moment: Moment, costmaps: Costmaps) -> Velocity:
        assert self.path is not None
        pose, end = moment.sight.pose, self.path[-1]
        if self._goal_checker.is_reached(pose, Pose2(*end.tolist())):
            self._end(NavigationState.SUCCEEDED, self.text)
            return STOP
        if not self._progress.makes_progress(moment.now, pose):
            return self._fail(moment, "moved less than {:g} m in {:g} s".format(*self._parameters.progress))
        self._recovering.note_progress(pose, self._way.remaining)
        try:
            return self._way.follow(moment, costmaps)
        except BlockedError as error:
            return self._fail(moment, str(error))

    def _fail(self, moment: Moment, reason: str) -> Velocity:
        """Begin the next recovery, or give up."""
        assert self.goal is not None
        end = self._recovering.begin(moment, self._way.remaining or _distance(moment, self.goal), reason)
        if end is not None:
            self._end(NavigationState.ABORTED, end)
        else:
            self.state, self.text = NavigationState.RECOVERING, reason
        return STOP

    def _recover(self, moment: Moment, costmaps: Costmaps) -> Velocity:
        step = self._recovering.step(moment, costmaps)
        if not step.is_over:
            return step.velocity
        self._progress.reset()
        self.plan_anew()
        return STOP


def _distance(moment: Moment, goal: Goal) -> float:
    return math.dist(moment.sight.pose[:2], goal.pose[:2])
