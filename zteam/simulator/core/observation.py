"""What an engine observes at a tick's end."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import msgspec

from zteam import names
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import Blob, Fiducial
from zteam.simulator.core.lasers import Reading, Readings
from zteam.simulator.core.motion import WheelJoints
from zteam.simulator.world.model import Robot

Detections = Mapping[str, tuple[Any, ...]]
"""What the devices of one robot detect: by topic, in file order."""


class Joints(NamedTuple):
    """A robot's wheels: angles since the start in radians, rates in rad/s."""

    names: tuple[str, ...]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]


class RobotObservation(msgspec.Struct, frozen=True, eq=False):
    """What one robot senses at a tick's end."""

    robot: Robot
    velocity: tuple[float, float, float]
    """In its own frame: forward and left in m/s, yaw rate in rad/s; what the base did, not what was commanded."""
    stall: bool
    """Commanded to move, but blocked."""
    _pose: Sequence[float]
    """x, y, yaw in `map`, not wrapped; so is that of its odometry."""
    _odom: Sequence[float]
    index: int
    """Among the engine's robots; so in what follows, which all share but for the detections."""
    detections: Detections
    """What its other devices detect, by topic."""
    _readings: Readings
    _wheels: WheelJoints

    @property
    def readings(self) -> tuple[Reading, ...]:
        """Of its rangers, in file order, as all devices."""
        return tuple(self.reading(place) for place in range(len(self.robot.rangers)))

    def reading(self, place: int) -> Reading:
        return self._readings[self.index, place]

    @property
    def truth(self) -> Pose2:
        """In `map`."""
        return pose_of(self._pose)

    @property
    def odom(self) -> Pose2:
        """Since the start, by its own wheels: starts at zero, and follows what the base did."""
        return pose_of(self._odom)

    @property
    def joints(self) -> Joints:
        wheels, i = self._wheels, self.index
        own = slice(wheels.first[i], wheels.first[i + 1])
        return Joints(wheels.names[i], tuple(wheels.angles[own].tolist()), tuple(wheels.rates[own].tolist()))

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
