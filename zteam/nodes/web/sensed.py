"""The documents `sonars` and `fiducials`: what robots sense besides their lasers, in `map`. Pure."""

import math
from collections.abc import Callable

import msgspec

from zteam.geometry import Pose2
from zteam.messages import Fiducials, Range

PoseOf = Callable[[str], Pose2 | None]
"""The pose of a frame in `map`."""


class Sonar(msgspec.Struct):
    """One reading, with the sensor's pose in `map`."""

    robot: int
    x: float
    y: float
    yaw: float
    field_of_view: float
    range: float | None
    """None: no return."""
    max_range: float


class SeenFiducial(msgspec.Struct):
    """A marked model in sight, with its pose in `map`; id 0 is too far to be read."""

    robot: int
    """That sees it."""
    id: int
    x: float
    y: float
    yaw: float


def sonar_of(robot_id: int, reading: Range, pose_of: PoseOf) -> Sonar | None:
    """A reading in `map`; None while its frame is not known."""
    frame = pose_of(reading.header.frame_id)
    if frame is None:
        return None
    hit = reading.min_range <= reading.range < reading.max_range
    most = reading.max_range if math.isfinite(reading.max_range) else 0.0
    view = reading.field_of_view if math.isfinite(reading.field_of_view) else 0.0
    return Sonar(robot_id, *_rounded(frame), view, round(reading.range, 3) if hit else None, most)


def fiducials_of(robot_id: int, message: Fiducials, pose_of: PoseOf) -> list[SeenFiducial]:
    """What a fiducial finder sees, in `map`."""
    frame = pose_of(message.header.frame_id)
    if frame is None:
        return []
    found = []
    for seen in message.fiducials:
        place = Pose2(seen.range * math.cos(seen.bearing), seen.range * math.sin(seen.bearing), seen.orientation)
        if all(map(math.isfinite, place)):
            found.append(SeenFiducial(robot_id, seen.id, *_rounded(frame.compose(place))))
    return found


def _rounded(pose: Pose2) -> tuple[float, float, float]:
    return round(pose.x, 4), round(pose.y, 4), round(pose.yaw, 4)
