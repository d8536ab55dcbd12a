"""A scan as planning takes it: ranges, and where its beams end."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.messages.laser import read_ranges
from zteam.navigation.planning.grid import Floats


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


def find_ends(
    scan: Scan, base: Pose2, far: float, chosen: NDArray[np.int64] | None = None
) -> tuple[Floats, NDArray[np.bool_]]:
    """Where the beams of a robot at `base` end, in the frame of that pose, and whether each has met something there.

    (n, 2) and (n): beams that say nothing are left out, and those that met something too close to measure. A beam
    longer than `far` (m) ends there and meets nothing. `chosen` are the numbers of the beams to look at; None is all.
    """
    ranges = scan.ranges if chosen is None else scan.ranges[chosen]
    distances = read_ranges(ranges, scan.range_min, scan.range_max).distances
    # What is not a number is not above 0 either.
    said = np.flatnonzero(distances > 0.0)
    distances = distances[said]
    met = distances <= far
    distances = np.minimum(distances, min(scan.range_max, far))
    laser = base.compose(scan.sensor)
    angles = scan.angle_increment * (said if chosen is None else chosen[said]) + (scan.angle_min + laser.yaw)
    points = np.empty((len(said), 2))
    points[:, 0] = laser.x + distances * np.cos(angles)
    points[:, 1] = laser.y + distances * np.sin(angles)
    return points, met


def on_teammates(points: Floats, teammates: Iterable[Teammate], margin: float) -> NDArray[np.bool_]:
    """Which points (n, 2) lie on a teammate, or up to `margin` (m) beside it; all in one frame."""
    found = np.zeros(len(points), bool)
    for mate in teammates:
        found |= np.hypot(points[:, 0] - mate.x, points[:, 1] - mate.y) <= mate.radius + margin
    return found


def seen_from(base: Pose2, teammates: Iterable[Teammate]) -> Iterator[Teammate]:
    """Teammates in the base frame of a robot at `base`; most scans need none."""
    return (Teammate(*base.locate(mate.x, mate.y), mate.radius) for mate in teammates)
