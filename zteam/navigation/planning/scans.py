"""A scan as planning takes it, and other robots."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2


class Scan(NamedTuple):
    """What a laser saw (sensor_msgs/LaserScan)."""

    ranges: NDArray[np.float32]
    """Metres, one a beam, as in the message: `zteam.messages.laser` tells what they mean."""
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    sensor: Pose2
    """Pose of the laser in the base frame of its robot."""


class Teammate(NamedTuple):
    """Another robot, as a disc."""

    x: float
    y: float
    radius: float


def seen_from(base: Pose2, teammates: Iterable[Teammate]) -> Iterator[Teammate]:
    """Teammates in the base frame of a robot at `base`; most scans need none."""
    return (Teammate(*base.locate(mate.x, mate.y), mate.radius) for mate in teammates)
