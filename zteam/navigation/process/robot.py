"""The navigation of one robot: its inputs, localiser, costmaps and navigator, step by step."""

from collections.abc import Mapping

from zteam import names
from zteam.errors import log
from zteam.geometry import Pose2, Velocity
from zteam.messages import PoseStamped
from zteam.messages.planar import goal_in_map, is_finite, planar
from zteam.navigation.planning.grid import GridMap
from zteam.navigation.planning.parameters import Parameters
from zteam.navigation.planning.planner import Planner
from zteam.navigation.planning.scans import Teammate
from zteam.navigation.process.costmaps import Costmaps, Situation
from zteam.navigation.process.inputs import OLD, Inputs
from zteam.navigation.process.localisers import Localiser, deviations_of, make_localiser
from zteam.navigation.process.navigator import STOP, Navigator, slow_down
from zteam.navigation.process.outputs import Outputs

NO_CARS = "navigation turns on the spot, as no car does: give the robot a base that drives 'diff' or 'omni'"
NO_MAP = f"no map has come on '{names.MAP}': zteam-map serves a file"


class RobotNavigation:
    """One robot. Everything runs under the node's lock."""

    def __init__(self, inputs: Inputs, parameters: Parameters, outputs: Outputs, planner: Planner, seed: int) -> None:
        self.inputs, self.outputs = inputs, outputs
        self._is_placed = False
        """Whether the last step knew where it is."""
        self._parameters, self._seed, self._limits = parameters, seed, parameters.limits
        self._grid: GridMap | None = None
        self.navigator = Navigator(parameters, planner, parameters.make_controller(inputs.base))
        self._costmaps: Costmaps | None = None
        self._localiser: Localiser | None = None
        self._command = STOP
        self._unfit = ""
        """Why the parameters do not fit this map or this base."""

    def set_map(self, grid: GridMap) -> None:
        """Another map: everything is made anew on it, and the robot is where it was."""
        pose = self._localiser.pose if self._localiser is not None else None
        self._grid, self._costmaps, self._unfit = grid, None, ""
        self._localiser = make_localiser(grid, self._parameters, self._seed, pose)
        self.navigator.plan_anew()

    def set_base(self) -> None:
        """The robot's base is another one than before: its outline or its limits."""
        self._costmaps, self._unfit = None, ""
        self.navigator.controller = self._parameters.make_controller(self.inputs.base)
        self.navigator.plan_anew()

    def forget(self) -> None:
        """Time jumped back: nothing of before counts, the goal neither."""
        self.inputs.forget()
        self.outputs.forget()
        self._command = STOP
        self.navigator.reset()
        self._localiser = None
        if self._grid is not None:
            self.set_map(self._grid)

    def why_not_localized_globally(self) -> str:
        """Why the particles cannot be spread; empty if they can."""
        return NO_MAP if self._localiser is None else self._localiser.why_not_localized_globally()

    def localize_globally(self) -> None:
        """Spread the particles, if that can be done."""
        if self._localiser is not None and not self._localiser.why_not_localized_globally():
            self._localiser.localize_globally()

    @property
    def has_goal(self) -> bool:
        """Whether there is a goal, also one that has come since the last step."""
        return self.navigator.active or names.GOAL_POSE in self.inputs.newest

    def cancel(self) -> bool:
        """Give up the goal, also one that has come since the last step; whether there was one."""
        self._take_goal()
        return self.navigator.cancel()

    def step(self, now: int, seconds: float, robots: Mapping[int, Teammate]) -> None:
        """One step at `now` (ns); the next one is in `seconds`. `robots` are those of the team, this one too."""
        self._take_initial_pose()
        self._take_goal()
        here = self._localise(now, seconds, robots)
        self._command = slow_down(self._move(now, here), self._command, self._limits, seconds)
        self.outputs.drive(now, self._command, active=self.navigator.active)
        if self._costmaps is not None:
            self.outputs.show(now, self.navigator, None if here is None else here.pose, self._costmaps)
        self.outputs.tell(now, self.navigator)
        self.outputs.log(self.navigator)
        self._is_placed = here is not None

    def show_costmaps(self, now: int) -> None:
        """Let others look at the costmaps, which are large: all that robots drive by leaves before."""
        if self._costmaps is not None and self._is_placed:
            self.outputs.show_costmaps(now, self._costmaps)

    def _take_initial_pose(self) -> None:
        message = self.inputs.newest.pop(names.INITIAL_POSE, None)
        if message is None:
            return
        frame = names.strip_slash(message.header.frame_id) or names.MAP_FRAME
        pose = planar(message.pose.pose)
        if frame != names.MAP_FRAME:
            problem = f"its frame is {frame!r}, not {names.MAP_FRAME!r}"
        elif pose is None:
            problem = "it is not finite, too far away, or its orientation is no rotation"
        else:
            problem = NO_MAP if self._localiser is None else self._localiser.set_pose(pose, deviations_of(message))
        if problem:
            log.warning("%s: the initial pose does not count: %s", names.robot_name(self.inputs.robot_id), problem)

    def _take_goal(self) -> None:
        message = self.inputs.newest.pop(names.GOAL_POSE, None)
        if isinstance(message, str):
            self.navigator.refuse(PoseStamped(), f"the goal cannot be read: {message}")
        elif message is not None:
            goal = goal_in_map(message, self.inputs.robot_id, self.inputs.find)
            if isinstance(goal, Pose2):
                self.navigator.accept(message, goal)
            else:
                # A status with numbers that are not finite would be dropped.
                self.navigator.refuse(message if is_finite(message.pose) else PoseStamped(message.header), goal)

    def _localise(self, now: int, seconds: float, robots: Mapping[int, Teammate]) -> Situation | None:
        """What the robot sees, and from where; None if it does not know where it is."""
        localiser = self._localiser
        if localiser is None:
            return None
        scan = self.inputs.planning_scan()
        teammates = [mate for robot_id, mate in robots.items() if robot_id != self.inputs.robot_id]
        localiser.step(now, self.inputs, scan, teammates)
        # What is published in this tick counts in the next one, and must hold there.
        self.outputs.localise(now, round(seconds * 1e9), localiser)
        pose = localiser.pose
        if pose is None:
            return None
        map_from_odom = localiser.map_from_odom
        if map_from_odom is None:
            odom = self.inputs.odom_pose()
            # Without odometry in the transforms, what lasers have seen stays where it is in `map`.
            map_from_odom = Pose2(0.0, 0.0, 0.0) if odom is None else pose.compose(odom[0].inverse())
        fresh = now - self.inputs.stamp(names.BASE_SCAN) <= OLD
        status = self.inputs.newest.get(names.STATUS)
        is_stopped = status is not None and bool(status.reason)
        pending, scan = STOP if is_stopped else self._command, scan if fresh else None
        return Situation(now / 1e9, seconds, pose, map_from_odom, scan, teammates, pending)

    def _move(self, now: int, here: Situation | None) -> Velocity:
        navigator = self.navigator
        if here is not None and self._costmaps is None and self._grid is not None and not self._unfit:
            try:
                self._costmaps = Costmaps(self._parameters, self.inputs.base, self._grid)
            except ValueError as error:
                self._unfit = str(error)
        if here is not None and self._costmaps is not None:
            self._costmaps.look(here)
        if not navigator.active:
            return STOP
        problem, for_ever = self._find_problem(now, here)
        if problem:
            return navigator.wait(now / 1e9, problem, for_ever=for_ever)
        assert here is not None and self._costmaps is not None
        return navigator.step(here, self._costmaps)

    def _find_problem(self, now: int, here: Situation | None) -> tuple[str, bool]:
        """What keeps the robot from driving, empty if nothing does; and whether that is no reason to give up."""
        inputs, localiser = self.inputs, self._localiser
        # It knew its place and saw, and what it goes by has stopped to come.
        has_old_scan = 0 <= inputs.stamp(names.BASE_SCAN) < now - OLD
        unfit = NO_CARS if inputs.base.drive == "car" else self._unfit
        problem = unfit or (NO_MAP if localiser is None else localiser.problem) or inputs.scan_problem
        if not problem and (here is None or here.scan is None):
            key = names.robot_key(inputs.robot_id, names.BASE_SCAN)
            problem = f"no scan on {key} for {OLD / 1e9:g} s" if has_old_scan else f"no scan on {key}"
        if problem:
            return problem, has_old_scan or (localiser is not None and localiser.is_outdated)
        return inputs.is_held(now), True
