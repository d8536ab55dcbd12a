"""The robots of a world at one time, as arrays: what they do in a tick, and what they sense."""

from collections.abc import Mapping, Sequence

import numpy as np
from msgspec.structs import replace

from zteam.clock import to_ns
from zteam.geometry import Pose2
from zteam.sim.bodies import Bodies, make_bodies
from zteam.sim.devices import Devices
from zteam.sim.fields import Fields
from zteam.sim.lasers import NO_SCANS, Lasers
from zteam.sim.motion import keep_what_is_left, make_bases
from zteam.sim.observation import Observation, Robots, Snapshot, pose_of
from zteam.sim.odometry import Odometry
from zteam.sim.surroundings import Surroundings
from zteam.simulation_options import Options
from zteam.world.model import Floorplan, Robot, World

WATCHDOG = to_ns(0.2)
"""A command moves its robot for this long (simulated ns); then the wheels stop."""


class Team:
    """One set of robots as arrays, in the order of their ids; it takes over the state of the previous set."""

    def __init__(
        self,
        world: World,
        robots: Mapping[int, Robot],
        floorplans: Sequence[tuple[Floorplan, Fields]],
        options: Options,
        seed: int,
        old: "Team | None",
    ) -> None:
        self.ids = {robot_id: i for i, robot_id in enumerate(robots)}
        self._robots = list(robots.values())
        self._pushed = [obstacle for obstacle in world.obstacles if obstacle.mass is not None]
        self._physics = options.physics or world.physics
        count = len(self._robots)
        self.commands = np.zeros((count, 3))
        self.commanded = np.full(count, -WATCHDOG, np.int64)
        self.bases, self._wheels = make_bases(self._robots)
        self.odometry = Odometry(self.bases, self._robots, list(self.ids), options.odom_alphas, seed)
        poses = np.array([r.pose for r in self._robots] + [o.pose for o in self._pushed], float).reshape(-1, 3)
        kept = self._adopt(old, poses) if old is not None else []
        self.bodies: Bodies = make_bodies(self._physics, self._robots, poses, world, floorplans)
        if old is not None:
            self.bodies.adopt(old.bodies, kept)
        self._surroundings = Surroundings(self._robots, world.obstacles, floorplans)
        self._lasers = Lasers(self._robots, list(self.ids), self._surroundings.visible, options, seed)
        self._devices = Devices(self._surroundings)
        self._begun: Snapshot | None = None
        """Without readings, if `begin_observing` was called and `observe` is to follow."""

    def _adopt(self, old: "Team", poses: np.ndarray) -> list[tuple[int, int]]:
        """Take over the state of the robots that stay; return the pairs (index here, index there) of the movers."""
        kept = [(i, old.ids[robot_id]) for robot_id, i in self.ids.items() if robot_id in old.ids]
        for here, there in kept:
            poses[here] = old.bodies.poses[there]
            self.commands[here], self.bases.setpoint[here] = old.commands[there], old.bases.setpoint[there]
            self.bases.velocity[here], self.commanded[here] = old.bases.velocity[there], old.commanded[there]
            mine = slice(self._wheels.first[here], self._wheels.first[here + 1])
            theirs = slice(old._wheels.first[there], old._wheels.first[there + 1])
            self._wheels.angles[mine] = old._wheels.angles[theirs]
        poses[len(self._robots) :] = old.bodies.poses[len(old._robots) :]
        self.odometry.adopt(old.odometry, kept)
        return kept + [(len(self._robots) + i, len(old._robots) + i) for i in range(len(self._pushed))]

    def at_present(self, world: World) -> tuple[World, dict[int, Robot]]:
        """The world with the things that can be pushed where they are now, and the robots by id where they are now."""
        poses, first = self.bodies.poses.tolist(), len(self._robots)
        robots = {robot_id: replace(self._robots[i], pose=pose_of(poses[i])) for robot_id, i in self.ids.items()}
        pushed = iter(poses[first:])
        things = [
            thing if thing.mass is None else replace(thing, pose=Pose2(*next(pushed))) for thing in world.obstacles
        ]
        return replace(world, obstacles=tuple(things)), robots

    def move(self, now: int, tick: int, seconds: float) -> None:
        """One tick, from `now` (ns) on."""
        fresh = now - self.commanded < WATCHDOG
        bases, count = self.bases, len(self.ids)
        bases.obey(self.commands, fresh, seconds)
        before = self.bodies.poses[:count].copy()
        self.bodies.step(seconds, bases.setpoint)
        after = self.bodies.poses[:count]
        bases.note_motion(before, after, seconds, tangents=self._physics == "stage")
        self.odometry.advance(before, after, tick)
        if self.bodies.met.any():
            keep_what_is_left(bases.is_car, self.bodies.met, bases.velocity, bases.setpoint)

    def begin_observing(self, now: int, tick: int) -> Observation:
        """What the bases sense at `now` (ns)."""
        self._surroundings.move(self.bodies.poses)
        self._lasers.begin(self.bodies.poses)
        self._begun = Snapshot(
            ids=self.ids,
            robots=self._robots,
            scans=NO_SCANS,
            poses=self.bodies.poses.tolist(),
            odom=self.odometry.poses.tolist(),
            velocity=self.bases.velocity.tolist(),
            stalled=self.bodies.stalled.copy(),
            wheels=self._wheels._replace(angles=self._wheels.angles.copy(), rates=self._wheels.rates.copy()),
            detections={},
        )
        return self._observation(now, tick, self._begun)

    def observe(self, now: int, tick: int) -> Observation:
        """What all robots sense at `now` (ns)."""
        if self._begun is None:
            self.begin_observing(now, tick)
        assert self._begun is not None
        scans, detections = self._lasers.measure(tick), self._devices.sense(self.bodies.poses)
        whole, self._begun = self._begun._replace(scans=scans, detections=detections), None
        return self._observation(now, tick, whole)

    def _observation(self, now: int, tick: int, snapshot: Snapshot) -> Observation:
        pushed = snapshot.poses[len(self._robots) :]
        by_name = {obstacle.name: pose_of(pose) for obstacle, pose in zip(self._pushed, pushed, strict=True)}
        return Observation(now, tick, Robots(snapshot), by_name)
