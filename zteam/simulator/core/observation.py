"""What an engine observes at a tick's end."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam import names
from zteam.geometry import Pose2, normalize_angle
from zteam.messages import Blob, Fiducial
from zteam.simulator.core.lasers import Reading, Readings
from zteam.simulator.core.motion import WheelJoints
from zteam.simulator.world.model import Robot

Detections = Mapping[str, tuple[Any, ...]]
"""What the devices of one robot detect: by topic, in file order."""
Rows = list[list[float]]
"""Plain numbers: each row is read several times a tick."""


class Joints(NamedTuple):
    """A robot's wheels: angles since the start in radians, rates in rad/s."""

    names: tuple[str, ...]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]


class Snapshot(NamedTuple):
    """The state from which the observations of single robots are made."""

    robots: Sequence[Robot]
    readings: Readings
    poses: Rows
    """x, y, yaw in `map`, by index."""
    odom: Rows
    velocity: Rows
    stalled: NDArray[np.bool_]
    wheels: WheelJoints
    detections: Mapping[int, Detections]
    """By index; robots without devices are left out."""


class RobotObservation:
    """What one robot senses at a tick's end; each part is made when it is asked for."""

    __slots__ = ("_index", "_snapshot")

    def __init__(self, snapshot: Snapshot, index: int) -> None:
        self._snapshot, self._index = snapshot, index

    @property
    def robot(self) -> Robot:
        return self._snapshot.robots[self._index]

    @property
    def readings(self) -> tuple[Reading, ...]:
        """Of its rangers, in file order, as all devices."""
        return tuple(self.reading(place) for place in range(len(self.robot.rangers)))

    def reading(self, place: int) -> Reading:
        return self._snapshot.readings[self._index, place]

    @property
    def truth(self) -> Pose2:
        """In `map`."""
        return pose_of(self._snapshot.poses[self._index])

    @property
    def odom(self) -> Pose2:
        """Since the start, by its own wheels: starts at zero, and follows what the base did."""
        return pose_of(self._snapshot.odom[self._index])

    @property
    def velocity(self) -> tuple[float, float, float]:
        """In its own frame: forward and left in m/s, yaw rate in rad/s; what the base did, not what was commanded."""
        vx, vy, w = self._snapshot.velocity[self._index]
        return vx, vy, w

    @property
    def stall(self) -> bool:
        """Commanded to move, but blocked."""
        return bool(self._snapshot.stalled[self._index])

    @property
    def joints(self) -> Joints:
        wheels, i = self._snapshot.wheels, self._index
        own = slice(wheels.first[i], wheels.first[i + 1])
        return Joints(wheels.names[i], tuple(wheels.angles[own].tolist()), tuple(wheels.rates[own].tolist()))

    @property
    def detections(self) -> Detections:
        """What its other devices detect, by topic."""
        return self._snapshot.detections.get(self._index, {})

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
