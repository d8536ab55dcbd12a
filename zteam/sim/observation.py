"""What an engine observes at a tick's end."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.geometry import Pose2, normalize_angle
from zteam.sim.devices import Blob, Detections, Sighting
from zteam.sim.lasers import Reading, Scans
from zteam.sim.odometry import Wheels
from zteam.world.model import Robot

Floats = NDArray[np.float64]


class Joints(NamedTuple):
    """A robot's wheels: angles since the start in radians, rates in rad/s."""

    names: tuple[str, ...]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]


class RobotObservation(msgspec.Struct, frozen=True, eq=False):
    """What one robot senses at a tick's end."""

    robot: Robot
    readings: tuple[Reading, ...]
    """Of its rangers, in file order, as all devices."""
    truth: Pose2
    """In `map`."""
    odom: Pose2
    """Since the start, by its own wheels: starts at zero, and follows what the base did."""
    velocity: tuple[float, float, float]
    """In its own frame: forward and left in m/s, yaw rate in rad/s; what the base did, not what was commanded."""
    stall: bool
    """Commanded to move, but blocked."""
    joints: Joints
    detections: Detections = msgspec.field(default_factory=dict)
    """What its other devices detect, by topic."""

    @property
    def fiducials(self) -> tuple[tuple[Sighting, ...], ...]:
        """Of its fiducial finders."""
        return self.detections.get(names.FIDUCIALS, ())

    @property
    def bumpers(self) -> tuple[bool, ...]:
        """Pressed or not."""
        return self.detections.get(names.BUMPER, ())

    @property
    def blobs(self) -> tuple[tuple[Blob, ...], ...]:
        """Of its blob finders, right to left."""
        return self.detections.get(names.BLOBS, ())


class Snapshot(NamedTuple):
    """The state from which observations of single robots are made, each at its first use."""

    ids: Mapping[int, int]
    """Robot id -> index."""
    robots: Sequence[Robot]
    scans: Scans
    poses: Floats
    odom: Floats
    velocity: Floats
    stalled: NDArray[np.bool_]
    wheels: Wheels
    detections: Mapping[int, Detections]
    """By index; robots without devices are left out."""


class Robots(Mapping[int, RobotObservation]):
    """Observations by robot id, ascending; each is made when it is first asked for."""

    def __init__(self, snapshot: Snapshot) -> None:
        self._snapshot = snapshot
        self._made: dict[int, RobotObservation] = {}

    def __iter__(self) -> Iterator[int]:
        return iter(self._snapshot.ids)

    def __len__(self) -> int:
        return len(self._snapshot.ids)

    def __getitem__(self, robot_id: int) -> RobotObservation:
        if robot_id not in self._made:
            self._made[robot_id] = self._make(self._snapshot.ids[robot_id])
        return self._made[robot_id]

    def _make(self, i: int) -> RobotObservation:
        s = self._snapshot
        robot = s.robots[i]
        vx, vy, w = s.velocity[i].tolist()
        return RobotObservation(
            robot,
            tuple(s.scans.reading(i, place) for place in range(len(robot.rangers))),
            pose_of(s.poses, i),
            pose_of(s.odom, i),
            (vx, vy, w),
            bool(s.stalled[i]),
            self._joints(i),
            s.detections.get(i, {}),
        )

    def _joints(self, i: int) -> Joints:
        wheels = self._snapshot.wheels
        own = slice(wheels.first[i], wheels.first[i + 1])
        return Joints(wheels.names[i], tuple(wheels.angles[own].tolist()), tuple(wheels.rates[own].tolist()))


def pose_of(poses: Floats, i: int) -> Pose2:
    """Row `i` of poses (x, y, yaw), its yaw in [-pi, pi]."""
    x, y, yaw = poses[i].tolist()
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
