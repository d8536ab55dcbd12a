"""Rigid transforms as tuples of seven floats, which is faster than numpy arrays or objects."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.kernels.transforms import Floats, compose, invert
from zteam.messages import Header, LaserScan, Quaternion, Time, Transform, TransformStamped, Twist, Vector3
from zteam.messages.laser import read_ranges

Array = NDArray[np.float64]

IDENTITY: Floats = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def floats_of(transform: Transform) -> Floats:
    """The seven numbers x, y, z, qx, qy, qz, qw of a transform."""
    t, r = transform.translation, transform.rotation
    return (t.x, t.y, t.z, r.x, r.y, r.z, r.w)


def stamped_transform(stamp: Time, parent: str, child: str, floats: Floats) -> TransformStamped:
    x, y, z, i, j, k, w = floats
    return TransformStamped(Header(stamp, parent), child, Transform(Vector3(x, y, z), Quaternion(i, j, k, w)))


def rotation_matrix(floats: Floats) -> Array:
    """The rotation of a transform, (3, 3)."""
    axes = np.eye(3).tolist()
    return np.array([compose((0.0, 0.0, 0.0, *floats[3:]), (x, y, z, 0.0, 0.0, 0.0, 1.0))[:3] for x, y, z in axes]).T


def scan_points(scan: LaserScan) -> Array:
    """(beams, 3) end points in the scan's own frame; NaN for beams that met nothing, or at no known place."""
    distances = read_ranges(scan.ranges, scan.range_min, scan.range_max).distances
    ranges = np.where((distances > 0.0) & np.isfinite(distances), distances, np.nan)
    angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
    return np.column_stack((ranges * np.cos(angles), ranges * np.sin(angles), 0.0 * ranges))


def twist_between(start: Floats, end: Floats, seconds: float) -> Twist:
    """The mean velocity between two poses of a frame; poses and twist are in the same observing frame."""
    turn = compose((0.0, 0.0, 0.0, *end[3:]), invert((0.0, 0.0, 0.0, *start[3:])))
    i, j, k, w = turn[3:]
    sine = math.sqrt(i * i + j * j + k * k)
    # The rotation by at most half a turn.
    angle = 2.0 * math.atan2(sine, w if w >= 0.0 else -w) * (1.0 if w >= 0.0 else -1.0)
    share = angle / sine / seconds if sine > 0.0 else 0.0
    x, y, z = ((b - a) / seconds for a, b in zip(start[:3], end[:3], strict=True))
    return Twist(Vector3(x, y, z), Vector3(i * share, j * share, k * share))
