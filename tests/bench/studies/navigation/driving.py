"""Robots that drive in the simulator's core: along a plan that knows the truth, or about at random."""

import math
from collections.abc import Callable, Iterator

import msgspec

from studies.navigation.scene import Way, make_robot, scan_of, twist_of
from zteam.clock import NS_PER_S
from zteam.geometry import Pose2, Velocity
from zteam.messages import Twist
from zteam.navigation.planning.controller import (
    BlockedError,
    GoalChecker,
    ProgressChecker,
    RegulatedPurePursuit,
)
from zteam.navigation.planning.costmap import Costmap
from zteam.navigation.planning.planner import AStarPlanner, NoPathError
from zteam.navigation.planning.recovery import Recovery
from zteam.robot.behaviors.wander import Wander, WanderParams
from zteam.robot.view import View
from zteam.sim import Engine, Options
from zteam.simulator.core.observation import Observation, RobotObservation
from zteam.simulator.core.to_messages import odometry_message, scan_message
from zteam.world import World

_REPLAN = 1.0
"""Seconds from one plan to the next."""
_PATIENCE = 1.0
"""Seconds without a way on before it recovers."""
_SLOWEST = 0.1
"""m/s: a tour that gets on no faster than this is over."""


class Drive(msgspec.Struct):
    """How a drive went."""

    reached: bool = False
    contacts: int = 0
    """Ticks in which the robot was blocked by something that it touched."""
    recoveries: int = 0
    seconds: float = 0.0
    why: str = ""
    """Why it did not reach its goal."""


class Pilot:
    """Brings one robot to a goal: plans once a second, follows the path, and recovers."""

    def __init__(self, costmap: Costmap, goal: Pose2, seconds: float) -> None:
        self.costmap, self.goal, self._seconds = costmap, goal, seconds
        self._planner, self._controller = AStarPlanner(), RegulatedPurePursuit()
        self._progress, self._checker, self.recovery = ProgressChecker(), GoalChecker(), Recovery()
        self._planned = -math.inf
        self._blocked = 0
        self.result = Drive()

    def step(self, now: float, pose: Pose2, robot: RobotObservation) -> Twist | None:
        """The command at `now` (s) for a robot that believes to be at `pose`; None at the end."""
        self.costmap.observe(scan_of(robot), pose)
        self.costmap.clear_footprint(pose)
        self.costmap.update()
        if self._checker.is_reached(pose, self.goal):
            self.result.reached = True
            return None
        if self.recovery.current:
            velocity = self.recovery.step(now, pose, self.costmap)
            if velocity is not None:
                return twist_of(velocity)
            self._planned = -math.inf
        try:
            command = self._drive(now, pose, Velocity(*robot.velocity))
        except (NoPathError, BlockedError) as error:
            self.result.why = str(error)
            self._blocked += 1
            if self._blocked * self._seconds < _PATIENCE:
                return Twist()
            return self._recover(now, pose)
        self._blocked = 0
        if not self._progress.makes_progress(now, pose):
            self.result.why = "no progress"
            return self._recover(now, pose)
        return command

    def _drive(self, now: float, pose: Pose2, velocity: Velocity) -> Twist:
        if now - self._planned >= _REPLAN or self._blocked:
            self._controller.set_path(self._planner.plan(self.costmap, pose, self.goal).path)
            self._planned = now
        return twist_of(self._controller.command(self.costmap, pose, velocity, self._seconds))

    def _recover(self, now: float, pose: Pose2) -> Twist | None:
        self._blocked = 0
        self._progress.reset()
        given_up = self.recovery.begin(now, pose, self.result.why)
        if given_up:
            self.result.why = given_up
            return None
        self.result.recoveries += 1
        return Twist()


def make_engine(world: World, start: Pose2, options: Options, seed: int) -> Engine:
    """The world with one robot, 0, at this pose."""
    return Engine(world, seed=seed, robots={0: make_robot(world, start)}, options=options)


def drive_way(
    engine: Engine, costmap: Costmap, way: Way, see: Callable[[RobotObservation], Pose2]
) -> Iterator[tuple[RobotObservation, Drive]]:
    """Drive robot 0 along a way: each tick, and how it went so far. `see` tells where the robot believes to be."""
    seconds = engine.world.interval / NS_PER_S
    pilot = Pilot(costmap, way.goal, seconds)
    command: Twist | None = Twist()
    for tick in range(int(way.plan.length / _SLOWEST / seconds) + 1000):
        if command is None:
            return
        robot = engine.step({0: command}).robots[0]
        pilot.result.seconds += seconds
        pilot.result.contacts += robot.stall
        command = pilot.step(tick * seconds, see(robot), robot)
        yield robot, pilot.result
    pilot.result.why = pilot.result.why or "out of time"


def wander(engine: Engine, seconds: float, seed: int) -> Iterator[RobotObservation]:
    """Robot 0 wanders for so many simulated seconds; each tick's observation."""
    behavior = Wander(WanderParams())
    interval = engine.world.interval
    command, before = Twist(), 0
    for _ in range(int(seconds * NS_PER_S / interval)):
        observation = engine.step({0: command})
        yield observation.robots[0]
        command = behavior.step(_view(observation, before, seed)) or Twist()
        before = observation.stamp


def _view(observation: Observation, before: int, seed: int) -> View:
    return View(
        now=observation.stamp,
        dt=(observation.stamp - before) / NS_PER_S if before else 0.0,
        robot_id=0,
        scan=scan_message(observation, 0, 0),
        odom=odometry_message(observation, 0),
        lookup=lambda _target, _source: None,
        team=(0,),
        seed=seed,
    )
