"""The simulator's core: commands in, observations out. No bus and no clock.

`Engine(world).step({0: Twist(...)})` advances the world by one tick (`interval_sim`) and returns what all robots
sense at its end. The same world, seed and commands give the same bytes.
"""

from collections.abc import Collection, Mapping, Sequence
from math import isfinite
from typing import NamedTuple

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from zteam import names
from zteam.clock import NS_PER_S, to_ns
from zteam.config.robot_ids import format_robot_ids
from zteam.config.simulation_options import Options
from zteam.errors import UsageError
from zteam.geometry import Pose2, normalize_angle
from zteam.kernels.binding import Floats
from zteam.messages import Blob, Fiducial, Time, Twist, time_from_ns
from zteam.simulator.core.casting import Plans, SensedWorld, prepare_plans
from zteam.simulator.core.devices import Detections, prepare_devices
from zteam.simulator.core.lasers import Lasers, Reading, Readings
from zteam.simulator.core.motion import JOINTS, Bodies, WheelOdometry, keep_what_is_left, make_bases, make_bodies
from zteam.simulator.world.model import Obstacle, Robot, World
from zteam.simulator.world.placing import find_hindrance

WATCHDOG = to_ns(0.2)
"""A command moves its robot for this long (simulated ns); then the wheels stop."""


class Joints(NamedTuple):
    """A robot's wheels: angles since the start in radians, rates in rad/s."""

    names: tuple[str, ...]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]


class Sensed(msgspec.Struct, eq=False, gc=False):
    """What all robots sense at a tick's end, in the order of their ids."""

    poses: list[list[float]]
    """(movers, 3): x, y, yaw in `map`, not wrapped."""
    velocity: list[list[float]]
    """(robots, 3)"""
    stalled: list[bool]
    """(robots)"""
    angles: Floats
    """(wheels): in radians; rates in rad/s."""
    rates: Floats
    readings: Readings = []
    detections: Mapping[int, Detections] = {}


class RobotObservation(msgspec.Struct, frozen=True, eq=False, gc=False):
    """What one robot senses at a tick's end."""

    robot: Robot
    odom: Pose2
    """Since the start, by its own wheels: starts at zero, and follows what the base did."""
    _all: Sensed
    _index: int
    _wheels: slice

    @property
    def velocity(self) -> tuple[float, float, float]:
        """In its own frame: forward and left in m/s, yaw rate in rad/s; what the base did, not what was commanded."""
        vx, vy, yaw_rate = self._all.velocity[self._index]
        return vx, vy, yaw_rate

    @property
    def stall(self) -> bool:
        """Commanded to move, but blocked."""
        return self._all.stalled[self._index]

    @property
    def truth(self) -> Pose2:
        """In `map`."""
        return pose_of(self._all.poses[self._index])

    @property
    def joints(self) -> Joints:
        wheels = tuple(name for name, _ in JOINTS[self.robot.drive])
        angles, rates = self._all.angles[self._wheels], self._all.rates[self._wheels]
        return Joints(wheels, tuple(angles.tolist()), tuple(rates.tolist()))

    @property
    def readings(self) -> Sequence[Reading]:
        """Of its rangers, in file order, as all devices."""
        return self._all.readings[self._index] if self._all.readings else ()

    @property
    def detections(self) -> Detections:
        """What its other devices detect, by topic."""
        return self._all.detections.get(self._index, {})

    @property
    def fiducials(self) -> tuple[tuple[Fiducial, ...], ...]:
        return self.detections.get(names.FIDUCIALS, ())

    @property
    def bumpers(self) -> tuple[bool, ...]:
        """Pressed or not."""
        return self.detections.get(names.BUMPER, ())

    @property
    def blobs(self) -> tuple[tuple[Blob, ...], ...]:
        """Of its blob finders, right to left."""
        return self.detections.get(names.BLOBS, ())


def pose_of(row: Sequence[float]) -> Pose2:
    """The pose of x, y and yaw, its yaw in [-pi, pi]."""
    x, y, yaw = row
    return Pose2(x, y, normalize_angle(yaw))


class Observation(msgspec.Struct, frozen=True, eq=False):
    """The world at a tick's end."""

    stamp: int
    """Nanoseconds of simulated time."""
    tick: int
    robots: Mapping[int, RobotObservation]
    """By id."""
    pushed: Mapping[str, Pose2]
    """Where the things that can be pushed are, in `map`, by name."""
    time: Time
    """`stamp` for messages."""
    sensed: Sensed
    """What all robots sense: a RobotObservation reads its part of it."""


class RobotArrays:
    """One set of robots as arrays, in the order of their ids: what they do in a tick, and what they sense. It takes
    over the state of the previous set."""

    def __init__(
        self, world: World, robots: Mapping[int, Robot], plans: Plans, options: Options, seed: int,
        old: "RobotArrays | None",
    ) -> None:  # fmt: skip
        self.ids = {robot_id: i for i, robot_id in enumerate(robots)}
        self._robots = list(robots.values())
        self._pushed = [obstacle for obstacle in world.obstacles if obstacle.mass is not None]
        self._physics = options.physics or world.physics
        count = len(self._robots)
        self.commands = np.zeros((count, 3))
        self.commanded = np.full(count, -WATCHDOG, np.int64)
        self.bases, self._wheels = make_bases(self._robots)
        self.odometry = WheelOdometry(self.bases, self._robots, list(self.ids), options.odom_alphas, seed)
        self._state: list[np.ndarray] = [self.commands, self.commanded, self.bases.setpoint, self.bases.velocity]
        self._state += [self.bases.start, self.bases.odom, self.odometry.counted]
        """Arrays with a row for each robot, which it keeps when others come and go."""
        poses = np.array([r.pose for r in self._robots] + [o.pose for o in self._pushed], float).reshape(-1, 3)
        kept = self._adopt(old, poses) if old is not None else []
        self.bodies: Bodies = make_bodies(self._physics, self._robots, poses, world.obstacles, plans)
        if old is not None:
            self.bodies.adopt(old.bodies, kept)
        self._scene = SensedWorld(self._robots, world.obstacles, plans)
        self._lasers = Lasers(self._robots, list(self.ids), self._scene.visible, options, seed)
        self._sense = prepare_devices(self._scene)

    def _adopt(self, old: "RobotArrays", poses: np.ndarray) -> list[tuple[int, int]]:
        """Take over the state of the robots that stay; return the pairs (index here, index there) of the movers."""
        kept = [(i, old.ids[robot_id]) for robot_id, i in self.ids.items() if robot_id in old.ids]
        for here, there in kept:
            poses[here] = old.bodies.poses[there]
            for mine, theirs in zip(self._state, old._state, strict=True):
                mine[here] = theirs[there]
            self.bases.angles[self._wheels[here]] = old.bases.angles[old._wheels[there]]
            self.bases.rates[self._wheels[here]] = old.bases.rates[old._wheels[there]]
        poses[len(self._robots) :] = old.bodies.poses[len(old._robots) :]
        return kept + [(len(self._robots) + i, len(old._robots) + i) for i in range(len(self._pushed))]

    def at_present(self, world: World) -> tuple[World, dict[int, Robot]]:
        """The world with the things that can be pushed where they are now, and the robots by id where they are now."""
        poses, first = self.bodies.poses.tolist(), len(self._robots)
        robots = {robot_id: replace(self._robots[i], pose=pose_of(poses[i])) for robot_id, i in self.ids.items()}
        pushed = iter(poses[first:])
        things = [o if o.mass is None else replace(o, pose=Pose2(*next(pushed))) for o in world.obstacles]
        return replace(world, obstacles=tuple(things)), robots

    def move(self, now: int, tick: int, seconds: float, held: Collection[int]) -> None:
        """One tick, from `now` (ns) on; the wheels of the robots `held` (ids) aim for zero velocity."""
        fresh = now - self.commanded < WATCHDOG
        for robot_id in held:
            fresh[self.ids[robot_id]] = False
        bases, count = self.bases, len(self.ids)
        bases.obey(self.commands, fresh, seconds)
        before = self.bodies.poses[:count].copy()
        self.bodies.step(seconds, bases.setpoint)
        after = self.bodies.poses[:count]
        bases.note_motion(before, after, seconds, tangents=self._physics == "stage")
        self.odometry.advance(before, after, tick)
        if np.count_nonzero(self.bodies.met):
            keep_what_is_left(bases.is_car, self.bodies.met, bases.velocity, bases.setpoint)

    def observe_bases(self, now: int, tick: int) -> Observation:
        """What the bases of all robots sense at `now` (ns)."""
        bases, robots, odom = self.bases, self._robots, self.odometry.poses.tolist()
        poses, velocity, stalled = self.bodies.poses.tolist(), bases.velocity.tolist(), self.bodies.stalled.tolist()
        sensed = Sensed(poses, velocity, stalled, bases.angles.copy(), bases.rates.copy())
        seen = {
            robot_id: RobotObservation(robots[i], pose_of(odom[i]), sensed, i, self._wheels[i])
            for robot_id, i in self.ids.items()
        }
        pushed = zip(self._pushed, poses[len(robots) :], strict=True)
        things = {thing.name: pose_of(pose) for thing, pose in pushed}
        return Observation(now, tick, seen, things, time_from_ns(now), sensed)

    def measure(self, sensed: Sensed, tick: int) -> None:
        """Add what all other sensors measure."""
        poses = self.bodies.poses
        self._scene.visible.move(poses)
        sensed.readings, sensed.detections = self._lasers.measure(poses, tick), self._sense(poses)


class Engine:
    """A world in motion. Robots have ids; by default they are the world's own, numbered in file order."""

    def __init__(
        self, world: World, *, seed: int = 1, robots: Mapping[int, Robot] | None = None, options: Options | None = None
    ) -> None:
        self.world, self.seed, self.options = world, seed, options or Options()
        self.tick = 0
        self._plans = prepare_plans(world.floorplans)
        self._at_first = dict(enumerate(world.robots)) if robots is None else dict(robots)
        self._robots = dict(self._at_first)
        self._arrays: RobotArrays | None = None
        self._outdated = True

    @property
    def now(self) -> int:
        """Simulated time in ns: 0 before the first tick."""
        return self.tick * self.world.interval

    @property
    def robots(self) -> dict[int, Robot]:
        """All robots by id, ascending."""
        return dict(sorted(self._robots.items()))

    def step(self, commands: Mapping[int, Twist]) -> Observation:
        """One tick with these new commands, and what the robots sense then: `move` and `observe`."""
        self.move(commands)
        return self.observe()

    def move(self, commands: Mapping[int, Twist], held: Collection[int] = ()) -> None:
        """One tick with these new commands; a robot without one keeps its last for WATCHDOG. Those in `held` (ids) obey
        none: they brake as hard as their bases can.

        Raises UsageError for a command to a robot that is not there, or one that is not finite.
        """
        arrays = self._assembled()
        now, rows = self.now, dict[int, tuple[float, float, float]]()
        for robot_id, twist in commands.items():
            if robot_id not in arrays.ids:
                self._check_there(robot_id)
            x, y, yaw = command = twist.linear.x, twist.linear.y, twist.angular.z
            if not (isfinite(x) and isfinite(y) and isfinite(yaw)):
                raise UsageError(f"the command of robot {robot_id} is not finite: {command}")
            rows[arrays.ids[robot_id]] = command
        if rows:
            places = [*rows]
            arrays.commands[places], arrays.commanded[places] = [*rows.values()], now
        arrays.move(now, self.tick + 1, self.world.interval / NS_PER_S, held)
        self.tick += 1

    def observe(self) -> Observation:
        """What the robots sense now."""
        observation = self.observe_bases()
        self.measure(observation)
        return observation

    def observe_bases(self) -> Observation:
        """What the robots sense now, before `measure`: no sensor and no other device has measured."""
        return self._assembled().observe_bases(self.now, self.tick)

    def measure(self, observation: Observation) -> None:
        """Add to the observation of now what sensors and other devices measure."""
        self._assembled().measure(observation.sensed, observation.tick)

    def odom_origin(self, robot_id: int) -> Pose2:
        """Where in `map` a robot's `odom` frame is: its start, until it is placed elsewhere."""
        return Pose2(*self._assembled().bases.start[self._index(robot_id)].tolist())

    def truth(self, robot_id: int) -> Pose2:
        """A robot's pose in `map`."""
        return pose_of(self._assembled().bodies.poses[self._index(robot_id)].tolist())

    def standing(self) -> tuple[Collection[int], Floats, NDArray[np.bool_]]:
        """The robots' ids, their poses (robots, 3: x, y, yaw in `map`, not wrapped), and whether each is blocked. The
        arrays are the engine's own: they change with it."""
        arrays = self._assembled()
        return arrays.ids.keys(), arrays.bodies.poses[: len(arrays.ids)], arrays.bodies.stalled

    def obstacles(self) -> tuple[Obstacle, ...]:
        """Those of the world, where they are now; for any thread."""
        return self.world.obstacles if self._arrays is None else self._arrays.at_present(self.world)[0].obstacles

    def reset(self) -> None:
        """Set everything back to the start: time, the set of robots, and things that were pushed."""
        self.tick = 0
        self._robots = dict(self._at_first)
        self._arrays, self._outdated = None, True

    def spawn(self, robot_id: int, robot: Robot, *, checked: bool = False) -> None:
        """Put a further robot into the world, at its pose. Raises UsageError if there is one of that id. With
        `checked`, also if it has no room there: in a wall, a robot or a thing, or outside of the world."""
        if robot_id in self._robots:
            raise UsageError(f"robot {robot_id} is in this world already: remove it first, or take another id")
        if checked:
            self._check_room(robot_id, robot, robot.pose)
        self._robots[robot_id] = robot
        self._outdated = True

    def remove(self, robot_id: int) -> None:
        """Take a robot out of the world. Raises UsageError if it is not there."""
        self._check_there(robot_id)
        del self._robots[robot_id]
        if self._arrays is not None:
            # Another robot of this id starts anew.
            self._arrays.ids = {kept: i for kept, i in self._arrays.ids.items() if kept != robot_id}
        self._outdated = True

    def place(self, robot_id: int, pose: Pose2, *, checked: bool = False) -> None:
        """Place a robot at a pose in `map`, where it stands still; its odometry goes on as if it had not moved. Raises
        UsageError if the robot is not there, or the pose is not finite; with `checked`, also if it has no room."""
        if not all(np.isfinite(pose)):
            raise UsageError(f"the pose for robot {robot_id} is not finite: {tuple(pose)}")
        arrays = self._assembled()
        i = self._index(robot_id)
        if checked:
            self._check_room(robot_id, self._robots[robot_id], pose)
        arrays.bodies.place(i, pose)
        arrays.odometry.carry(i, pose)
        arrays.bases.setpoint[i] = arrays.bases.velocity[i] = 0.0

    def _check_room(self, robot_id: int, robot: Robot, pose: Pose2) -> None:
        """Raise UsageError if a robot of this id has no room at `pose`; where it stands now does not count."""
        world, robots = self._assembled().at_present(self.world)
        robots.pop(robot_id, None)
        if why := find_hindrance(world, replace(robot, pose=pose), robots):
            place = f"x {pose.x:g}, y {pose.y:g}"
            raise UsageError(f"robot {robot_id} has no room at {place}: it {why}; choose a free place, or force it")

    def _assembled(self) -> RobotArrays:
        """The robots as they are now; it is made again only when robots came or went since the last call."""
        if self._arrays is None or self._outdated:
            self._arrays = RobotArrays(self.world, self.robots, self._plans, self.options, self.seed, self._arrays)
            self._outdated = False
        return self._arrays

    def _index(self, robot_id: int) -> int:
        """A robot's place in the arrays. Raises UsageError if it is not there."""
        self._check_there(robot_id)
        return self._assembled().ids[robot_id]

    def _check_there(self, robot_id: int) -> None:
        if robot_id not in self._robots:
            there = format_robot_ids(self._robots) or "none"
            raise UsageError(f"no robot {robot_id} in this world: it has {there}")
