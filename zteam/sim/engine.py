"""The simulator's core: commands in, observations out. No bus and no clock.

`Engine(world).step({0: Twist(...)})` advances the world by one tick (`interval_sim`) and returns what all robots
sense at its end. The same world, seed and commands give the same bytes.
"""

import math
from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from zteam.clock import NS_PER_S
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.messages import Twist
from zteam.robot_ids import format_robot_ids
from zteam.sim.fields import build_fields
from zteam.sim.lasers import Reading
from zteam.sim.observation import Observation, RobotObservation, pose_of
from zteam.sim.team import WATCHDOG, Team
from zteam.simulation_options import Options
from zteam.world.model import Obstacle, Robot, World
from zteam.world.placing import find_hindrance

Floats = NDArray[np.float64]

__all__ = ["WATCHDOG", "Engine", "Observation", "Options", "Reading", "RobotObservation"]


class Standing(NamedTuple):
    """How all robots stand, in the order of their ids. The arrays are the engine's own: they change with it."""

    ids: Collection[int]
    poses: Floats
    """(robots, 3): x, y, yaw in `map`; yaws are not wrapped."""
    stalled: NDArray[np.bool_]
    """Whether each is blocked."""


class Engine:
    """A world in motion. Robots have ids; by default they are the world's own, numbered in file order."""

    def __init__(
        self,
        world: World,
        *,
        seed: int = 1,
        robots: Mapping[int, Robot] | None = None,
        options: Options | None = None,
    ) -> None:
        self.world = world
        self.seed = seed
        self.options = options or Options()
        self.tick = 0
        # Floor plans of one bitmap share its fields.
        bitmaps = {id(plan.occupied): plan.occupied for plan in world.floorplans}
        fields = {number: build_fields(bitmap) for number, bitmap in bitmaps.items()}
        self._floorplans = [(plan, fields[id(plan.occupied)]) for plan in world.floorplans]
        self._at_first = dict(enumerate(world.robots)) if robots is None else dict(robots)
        self._robots = dict(self._at_first)
        self._team: Team | None = None
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

    def move(self, commands: Mapping[int, Twist]) -> None:
        """One tick with these new commands; a robot without one keeps its last for WATCHDOG.

        Raises UsageError for a command to a robot that is not there, or one that is not finite.
        """
        team = self._assembled()
        for robot_id, twist in commands.items():
            i = self._index(team, robot_id)
            command = twist.linear.x, twist.linear.y, twist.angular.z
            if not all(map(math.isfinite, command)):
                raise UsageError(f"the command of robot {robot_id} is not finite: {command}")
            team.commands[i] = command
            team.commanded[i] = self.now
        team.move(self.now, self.tick + 1, self.world.interval / NS_PER_S)
        self.tick += 1

    def begin_observing(self) -> Observation:
        """What the bases sense now: no sensor and no other device has measured yet. Nothing may change before `observe`
        follows.
        """
        return self._assembled().begin_observing(self.now, self.tick)

    def observe(self) -> Observation:
        """What all robots sense now."""
        return self._assembled().observe(self.now, self.tick)

    def odom_origin(self, robot_id: int) -> Pose2:
        """Where in `map` a robot's `odom` frame is: its start, until it is placed elsewhere."""
        team = self._assembled()
        return team.odometry.start(self._index(team, robot_id))

    def truth(self, robot_id: int) -> Pose2:
        """A robot's pose in `map`."""
        team = self._assembled()
        return pose_of(team.bodies.poses[self._index(team, robot_id)].tolist())

    def standing(self) -> Standing:
        """How all robots stand."""
        team = self._assembled()
        return Standing(team.ids.keys(), team.bodies.poses[: len(team.ids)], team.bodies.stalled)

    def obstacles(self) -> tuple[Obstacle, ...]:
        """Those of the world, where they are now; for any thread."""
        return self.world.obstacles if self._team is None else self._team.at_present(self.world)[0].obstacles

    def reset(self) -> None:
        """Set everything back to the start: time, the set of robots, and things that were pushed."""
        self.tick = 0
        self._robots = dict(self._at_first)
        self._team, self._outdated = None, True

    def spawn(self, robot_id: int, robot: Robot, *, checked: bool = False) -> None:
        """Put a further robot into the world, at its pose. Raises UsageError if there is one of that id.

        With `checked`, also if it has no room there: in a wall, a robot or a thing, or outside of the world.
        """
        if robot_id in self._robots:
            raise UsageError(f"robot {robot_id} is in this world already: remove it first, or take another id")
        if checked:
            self._check_room(robot_id, robot, robot.pose)
        self._robots[robot_id] = robot
        self._outdated = True

    def remove(self, robot_id: int) -> None:
        """Take a robot out of the world. Raises UsageError if it is not there."""
        if robot_id not in self._robots:
            raise _no_robot(robot_id, self._robots)
        del self._robots[robot_id]
        if self._team is not None:
            # Another robot of this id starts anew. Observations keep the old table.
            self._team.ids = {kept: i for kept, i in self._team.ids.items() if kept != robot_id}
        self._outdated = True

    def place(self, robot_id: int, pose: Pose2, *, checked: bool = False) -> None:
        """Place a robot at a pose in `map`, where it stands still; its odometry goes on as if it had not moved.

        Raises UsageError if the robot is not there, or the pose is not finite; with `checked`, also if it has no room.
        """
        if not all(np.isfinite(pose)):
            raise UsageError(f"the pose for robot {robot_id} is not finite: {tuple(pose)}")
        team = self._assembled()
        i = self._index(team, robot_id)
        if checked:
            self._check_room(robot_id, self._robots[robot_id], pose)
        team.bodies.place(i, pose)
        team.odometry.carry(i, pose)
        team.setpoint[i] = team.velocity[i] = 0.0

    def _check_room(self, robot_id: int, robot: Robot, pose: Pose2) -> None:
        """Raise UsageError if a robot of this id has no room at `pose`; where it stands now does not count."""
        world, robots = self._assembled().at_present(self.world)
        robots.pop(robot_id, None)
        if why := find_hindrance(world, replace(robot, pose=pose), robots):
            place = f"x {pose.x:g}, y {pose.y:g}"
            raise UsageError(f"robot {robot_id} has no room at {place}: {why} (--force puts it there)")

    def _assembled(self) -> Team:
        """The team as it is now; it is made again only when robots came or went since the last call."""
        if self._team is None or self._outdated:
            self._team = Team(self.world, self.robots, self._floorplans, self.options, self.seed, self._team)
            self._outdated = False
        return self._team

    def _index(self, team: Team, robot_id: int) -> int:
        if robot_id not in team.ids:
            raise _no_robot(robot_id, self._robots)
        return team.ids[robot_id]


def _no_robot(robot_id: int, present: Collection[int]) -> UsageError:
    return UsageError(f"no robot {robot_id} in this world: it has {format_robot_ids(present) or 'none'}")
