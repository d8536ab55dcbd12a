"""One robot's way to its goal: plan, drive, recover, arrive or give up. Without a bus and without a clock."""

import math

import msgspec

from zteam.geometry import Pose2, Velocity
from zteam.messages import NavigationState, PoseStamped
from zteam.messages.base import Base
from zteam.navigation.planning.controller import BlockedError, Controller, GoalChecker, ProgressChecker
from zteam.navigation.planning.grid import Floats
from zteam.navigation.planning.parameters import Parameters
from zteam.navigation.planning.planner import NoPathError, Planner
from zteam.navigation.planning.recovery import Recovery
from zteam.navigation.process.costmaps import Costmaps, Situation
from zteam.robot.client import ON_THE_WAY

STOP = Velocity()
MISSING_LIMIT = 10.0
"""Seconds that a robot stands without what it needs, such as its place, before it gives up its goal."""
_AGAIN = 0.3
"""Seconds between two plans of a robot whose way is blocked."""
_IN_VAIN = 3
"""Times `number_of_retries`: so many recoveries may bring a robot no nearer to its goal, wherever it moves."""


class Navigator:
    """The state machine of one robot."""

    def __init__(self, parameters: Parameters, planner: Planner, controller: Controller) -> None:
        """`planner` may be shared: it keeps nothing from one plan to the next."""
        self._parameters, self._planner, self.controller = parameters, planner, controller
        self._goal_checker = GoalChecker(parameters.goal)
        self._progress = ProgressChecker(parameters.progress)
        self._recovery = Recovery(parameters.recovery)
        self.reset()

    def reset(self) -> None:
        """There is no goal, and there never was one."""
        self.state, self.text = NavigationState.IDLE, ""
        self.goal: Pose2 | None = None
        """In `map`."""
        self.message = PoseStamped()
        """The newest goal as it was sent, also one that was refused."""
        self._begin()

    def _begin(self) -> None:
        """Forget what belongs to one goal."""
        self._goal_checker.reset()
        self._progress.reset()
        self._recovery.reset()
        self.recoveries = 0
        """How many were begun for this goal."""
        self._recovered_at: Pose2 | None = None
        """Where the robot was when it began to recover, until it has moved on from there."""
        self._least_left = math.inf
        """Metres to the goal when it began to recover, until it has got nearer."""
        self._in_vain = 0
        """Recoveries since the robot last got nearer to its goal."""
        self._held_since: float | None = None
        self._forget_path()

    def _forget_path(self) -> None:
        """There is no path, and a plan is due."""
        self.path: Floats | None = None
        """(n, 3) in `map`; another object for each plan."""
        self._planned = -math.inf
        self._blocked_since: float | None = None

    @property
    def active(self) -> bool:
        return self.state in ON_THE_WAY

    @property
    def distance_remaining(self) -> float:
        """Metres of the path before the robot."""
        return 0.0 if self.path is None else self.controller.remaining()

    def accept(self, message: PoseStamped, goal: Pose2) -> None:
        """Go to `goal` (in `map`), as `message` asks for: it replaces the goal that there was."""
        self._begin()
        self.goal, self.message = goal, message
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
        self._forget_path()

    def plan_anew(self) -> None:
        """There is another map or controller: what was planned does not count."""
        self._forget_path()
        if self.active:
            self.state = NavigationState.PLANNING

    def rest(self) -> None:
        """That the robot did not get on until now does not count."""
        self._progress.reset()
        self._blocked_since = None

    def wait(self, now: float, reason: str, *, for_ever: bool = False) -> Velocity:
        """Something that is needed is missing: stand, say why; give up after MISSING_LIMIT unless it is `for_ever`."""
        self.rest()
        self._held_since = now if self._held_since is None or for_ever else self._held_since
        if now - self._held_since > MISSING_LIMIT:
            self._end(NavigationState.ABORTED, f"{reason}, for {MISSING_LIMIT:g} s")
        else:
            self.text = reason
        return STOP

    def step(self, here: Situation, costmaps: Costmaps) -> Velocity:
        assert self.goal is not None
        if self._held_since is not None:
            self._held_since, self.text = None, ""
        if self.state is NavigationState.RECOVERING:
            velocity = self._recovery.step(here.now, here.pose, costmaps.local, costmaps.whole)
            if velocity is not None:
                return velocity
            self._progress.reset()
            self.plan_anew()
            return STOP
        # There, no other path is of use, and the controller goes on to turn.
        there, frequency = self._goal_checker.there, self._parameters.planner_server.expected_planner_frequency
        interval = math.inf if there else 1.0 / (frequency or 1.0)
        if self._blocked_since is not None:
            interval = min(interval, _AGAIN)
        if here.now - self._planned >= interval - 1e-6 and not self._plan(here, costmaps, self.goal):
            return STOP
        return self._drive(here, costmaps, self.goal)

    def _plan(self, here: Situation, costmaps: Costmaps, goal: Pose2) -> bool:
        """Whether there is a path to follow now; if there is none, a recovery begins, or the goal is given up."""
        self._planned = here.now
        costmaps.look_far(here)
        try:
            plan = self._planner.plan(costmaps.whole, here.pose, goal)
        except NoPathError as error:
            if self.path is not None:
                # What is in the way may go away; the controller stops before it.
                return True
            try:
                self._planner.plan(costmaps.of_map(), here.pose, goal)
            except NoPathError as lasting:
                self._end(NavigationState.ABORTED, str(lasting))
            else:
                self._fail(here, goal, str(error))
            return False
        self.path = plan.path
        self.controller.set_path(plan.path)
        self.text = f"plans to {plan.short_of_goal:.2f} m from the goal" if plan.short_of_goal else ""
        self.state = NavigationState.DRIVING
        return True

    def _drive(self, here: Situation, costmaps: Costmaps, goal: Pose2) -> Velocity:
        assert self.path is not None
        pose, left = here.pose, self.controller.remaining()
        if self._goal_checker.is_reached(pose, Pose2(*self.path[-1].tolist())):
            self._end(NavigationState.SUCCEEDED, self.text)
            return STOP
        if not self._progress.makes_progress(here.now, pose):
            needed, allowed = msgspec.structs.astuple(self._parameters.progress)
            return self._fail(here, goal, f"moved less than {needed:g} m in {allowed:g} s")
        self._note_progress(pose, left)
        ahead = move(pose, here.pending, here.seconds)
        try:
            velocity = self.controller.command(costmaps.local, ahead, here.pending, here.seconds)
        except BlockedError as error:
            if self._blocked_since is None:
                self._blocked_since, self._planned = here.now, -math.inf
            tolerance = self._parameters.controller.failure_tolerance
            if 0.0 <= tolerance < here.now - self._blocked_since:
                return self._fail(here, goal, str(error))
            return STOP
        self._blocked_since = None
        return velocity

    def _note_progress(self, pose: Pose2, left: float) -> None:
        """The robot is `left` metres from its goal: after a recovery that helped, all may be tried again.

        To have moved is enough a few times only: a robot that backs up and comes back has moved.
        """
        enough = self._parameters.progress.required_movement_radius
        if self._recovered_at is not None and math.dist(pose[:2], self._recovered_at[:2]) > enough:
            self._recovery.reset()
            self._recovered_at = None
        if left < self._least_left - enough and self._in_vain:
            self._least_left, self._in_vain = math.inf, 0

    def _fail(self, here: Situation, goal: Pose2, reason: str) -> Velocity:
        pose = here.pose
        if self._in_vain >= _IN_VAIN * self._parameters.recovery.number_of_retries > 0:
            end = f"{reason}: gave up after {self._in_vain} recoveries that brought it no nearer to the goal"
            self._end(NavigationState.ABORTED, end)
        elif (given_up := self._recovery.begin(here.now, pose, reason)) is not None:
            self._end(NavigationState.ABORTED, given_up)
        else:
            left = self.distance_remaining or math.dist(pose[:2], goal[:2])
            self.recoveries, self._in_vain = self.recoveries + 1, self._in_vain + 1
            self._recovered_at, self._least_left = self._recovered_at or pose, min(self._least_left, left)
            self.state, self.text = NavigationState.RECOVERING, reason
        return STOP


def slow_down(velocity: Velocity, before: Velocity, limits: Base, seconds: float) -> Velocity:
    """`velocity`, or a slower one on the same arc, `seconds` after `before`. Braking has no limit here."""
    share = 1.0
    for wanted, last, most, gain in (
        (velocity.x, before.x, limits.max_vel_x if velocity.x > 0.0 else -limits.min_vel_x, limits.acc_lim_x),
        (velocity.turn, before.turn, limits.max_vel_theta, limits.acc_lim_theta),
    ):
        most = min(most, (abs(last) if last * wanted > 0.0 else 0.0) + gain * seconds)
        share = min(share, most / abs(wanted)) if abs(wanted) > most else share
    return velocity if share == 1.0 else Velocity(share * velocity.x, share * velocity.y, share * velocity.turn)


def move(pose: Pose2, velocity: Velocity, seconds: float) -> Pose2:
    """Where a robot is after it has driven so, on an arc."""
    heading = pose.yaw + 0.5 * velocity.turn * seconds
    cos, sin = math.cos(heading), math.sin(heading)
    x = pose.x + (cos * velocity.x - sin * velocity.y) * seconds
    y = pose.y + (sin * velocity.x + cos * velocity.y) * seconds
    return Pose2(x, y, pose.yaw + velocity.turn * seconds)
