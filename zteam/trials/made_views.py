"""Views by hand: scans of made-up ranges, and look-ups in made-up poses."""

from collections.abc import Mapping, Sequence

import numpy as np

from zteam import names
from zteam.behaviors.view import FindPose
from zteam.geometry import Pose2
from zteam.messages import Header, LaserScan

RANGE_MAX = 30.0
"""Metres."""
_HERE = Pose2(0.0, 0.0, 0.0)


def make_scan(ranges: Sequence[float], fov: float, header: Header) -> LaserScan:
    """A scan of these metres, evenly spread over `fov` radians from right to left."""
    return LaserScan(
        header=header,
        angle_min=-0.5 * fov,
        angle_max=0.5 * fov,
        angle_increment=fov / (len(ranges) - 1) if len(ranges) > 1 else 0.0,
        range_max=RANGE_MAX,
        ranges=np.array(ranges, np.float32),
    )


def lookup_in(poses: Mapping[int, tuple[float, float, float]], stamp: int) -> FindPose:
    """Look-ups among `map` and the bases of robots with these poses (x, y in m, yaw in rad) in `map`, at `stamp` (ns).

    Every look-up fails where no robot is known.
    """
    known = {names.robot_frame(i, names.BASE_FOOTPRINT): Pose2(*pose) for i, pose in poses.items()}
    if known:
        known[names.MAP_FRAME] = _HERE

    def lookup(target: str, source: str) -> tuple[Pose2, int] | None:
        if target not in known or source not in known:
            return None
        return known[target].inverse().compose(known[source]), stamp

    return lookup


def laser_frame(robot_id: int) -> str:
    """The frame of a robot's laser."""
    return names.robot_frame(robot_id, names.BASE_LASER_LINK)
