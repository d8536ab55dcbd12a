"""The simulator's core: commands in, observations out. No bus, no clock, no randomness of its own.

`Engine(world).step({0: Twist(...)})` advances the world by one tick (`interval_sim`) and returns what all robots
sense at its end. The same world, seed and commands give the same bytes.
"""

from collections.abc import Mapping

import msgspec
import numpy as np

from zteam.clock import NS_PER_S, to_ns
from zteam.errors import UsageError
from zteam.geometry import Pose2, compose2, inverse2
from zteam.messages import Twist
from zteam.sim.lasers import Lasers, Reading
from zteam.sim.physics import Physics
from zteam.world.model import Robot, World

WATCHDOG = to_ns(0.2)
"""A command moves its robot for this long (simulated ns); then the wheels stop."""


class RobotObservation(msgspec.Struct, frozen=True, eq=False):
    """What one robot senses at a tick's end."""

    robot: Robot
    readings: tuple[Reading, ...]
    """Of its rangers, in file order."""
    truth: Pose2
    """In `map`."""
    odom: Pose2
    """Since the start, by its own wheels: starts at zero, and follows what the base did."""
    velocity: tuple[float, float, float]
    """In its own frame: forward and left in m/s, yaw rate in rad/s; what the base did, not what it was told."""
    stall: bool
    """Told to move, but blocked."""


class Observation(msgspec.Struct, frozen=True, eq=False):
    """The world at a tick's end."""

    stamp: int
    """Nanoseconds of simulated time."""
    tick: int
    robots: dict[int, RobotObservation]


class Engine:
    """A world in motion. Robots are known by id; by default the world's own, numbered in file order."""

    def __init__(self, world: World, *, seed: int = 1, robots: Mapping[int, Robot] | None = None) -> None:
        chosen = dict(enumerate(world.robots)) if robots is None else dict(robots)
        self._ids = sorted(chosen)
        self._index = {robot_id: i for i, robot_id in enumerate(self._ids)}
        self._robots = [chosen[robot_id] for robot_id in self._ids]
        self._interval = world.interval
        self.seed = seed
        self.tick = 0
        self._physics = Physics(self._robots, world.floorplans, world.obstacles)
        self._lasers = Lasers(self._robots, world.floorplans, world.obstacles)
        self._start = [robot.pose for robot in self._robots]
        self._velocity = np.zeros((len(self._robots), 3))
        self._commands = np.zeros((len(self._robots), 3))
        self._commanded = np.full(len(self._robots), -WATCHDOG, np.int64)
        limits = [robot.velocity for robot in self._robots]
        self._low = np.array([[v.x[0], v.y[0], v.yaw[0]] for v in limits], float).reshape(-1, 3)
        self._high = np.array([[v.x[1], v.y[1], v.yaw[1]] for v in limits], float).reshape(-1, 3)
        sideways = np.array([robot.drive == "omni" for robot in self._robots], bool)
        self._low[~sideways, 1] = self._high[~sideways, 1] = 0.0

    @property
    def now(self) -> int:
        """Simulated time in ns: 0 before the first tick."""
        return self.tick * self._interval

    def step(self, commands: Mapping[int, Twist]) -> Observation:
        """One tick with these new commands, and what the robots sense then: `move` and `observe`."""
        self.move(commands)
        return self.observe()

    def move(self, commands: Mapping[int, Twist]) -> None:
        """One tick with these new commands; a robot without one keeps its last for WATCHDOG.

        Raises UsageError for a command to a robot that is not there.
        """
        for robot_id, twist in commands.items():
            i = self._index.get(robot_id)
            if i is None:
                raise UsageError(f"no robot {robot_id} in this world: it has {self._ids}")
            self._commands[i] = twist.linear.x, twist.linear.y, twist.angular.z
            self._commanded[i] = self.now
        fresh = self.now - self._commanded < WATCHDOG
        velocities = np.clip(self._commands, self._low, self._high) * fresh[:, None]
        before = self._physics.poses.copy()
        self._physics.step(self._interval / NS_PER_S, velocities)
        self._measure_velocity(before, velocities)
        self.tick += 1

    def _measure_velocity(self, before: np.ndarray, told: np.ndarray) -> None:
        seconds = self._interval / NS_PER_S
        after = self._physics.poses
        turn = after[:, 2] - before[:, 2]
        # The way made good, seen from half the turn and stretched from the chord to the arc.
        heading = before[:, 2] + 0.5 * turn
        dx, dy = (after[:, 0] - before[:, 0]) / seconds, (after[:, 1] - before[:, 1]) / seconds
        cos, sin = np.cos(heading), np.sin(heading)
        stretch = 1.0 / np.sinc(0.5 * turn / np.pi)
        self._velocity[:, 0] = (cos * dx + sin * dy) * stretch
        self._velocity[:, 1] = (cos * dy - sin * dx) * stretch
        self._velocity[:, 2] = turn / seconds

    def observe(self) -> Observation:
        """What all robots sense now."""
        readings = self._lasers.measure(self._physics.poses)
        return Observation(
            self.now, self.tick, {robot_id: self._observe(i, readings) for i, robot_id in enumerate(self._ids)}
        )

    def _observe(self, i: int, readings: Mapping[tuple[int, int], Reading]) -> RobotObservation:
        truth = self._pose(i)
        vx, vy, w = self._velocity[i].tolist()
        robot = self._robots[i]
        return RobotObservation(
            robot,
            tuple(readings[i, place] for place in range(len(robot.rangers))),
            truth,
            self._odom(i),
            (vx, vy, w),
            bool(self._physics.stalled[i]),
        )

    def _pose(self, i: int) -> Pose2:
        x, y, yaw = self._physics.poses[i].tolist()
        return Pose2(x, y, yaw)

    def _odom(self, i: int) -> Pose2:
        return compose2(inverse2(self._start[i]), self._pose(i))

    def odom(self, robot_id: int) -> Pose2:
        """A robot's pose since its start."""
        return self._odom(self._index[robot_id])

    def truth(self, robot_id: int) -> Pose2:
        """A robot's pose in `map`."""
        return self._pose(self._index[robot_id])

    def stalled(self, robot_id: int) -> bool:
        """Whether a robot is blocked."""
        return bool(self._physics.stalled[self._index[robot_id]])
