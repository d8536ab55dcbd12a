"""Functions that apply transforms to points, poses and scans, and that compute velocities from two look-ups."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.laser import read_ranges
from zteam.messages import LaserScan, Point, Pose, Quaternion, Transform, Twist, Vector3
from zteam.tf.rigid import Floats, compose, invert

Array = NDArray[np.float64]


def floats_of(transform: Transform) -> Floats:
    """The seven numbers x, y, z, qx, qy, qz, qw of a transform."""
    t, r = transform.translation, transform.rotation
    return (t.x, t.y, t.z, r.x, r.y, r.z, r.w)


def apply_to_pose(target_from_source: Transform, pose: Pose) -> Pose:
    """A pose in `source` as one in `target`."""
    p, o = pose.position, pose.orientation
    x, y, z, i, j, k, w = compose(floats_of(target_from_source), (p.x, p.y, p.z, o.x, o.y, o.z, o.w))
    return Pose(Point(x, y, z), Quaternion(i, j, k, w))


def apply_to_point(target_from_source: Transform, point: Point) -> Point:
    """A point in `source` as one in `target`."""
    x, y, z, *_ = compose(floats_of(target_from_source), (point.x, point.y, point.z, 0.0, 0.0, 0.0, 1.0))
    return Point(x, y, z)


def apply_to_vector(target_from_source: Transform, vector: Vector3) -> Vector3:
    """A direction in `source` as one in `target`: it is rotated, not translated."""
    r = target_from_source.rotation
    x, y, z, *_ = compose((0.0, 0.0, 0.0, r.x, r.y, r.z, r.w), (vector.x, vector.y, vector.z, 0.0, 0.0, 0.0, 1.0))
    return Vector3(x, y, z)


def apply_to_points(target_from_source: Transform, points: Array) -> Array:
    """(N, 3) points in `source` as points in `target`, all at once."""
    x, y, z, *rotation = floats_of(target_from_source)
    return np.asarray(points @ _matrix(*rotation).T + (x, y, z))


def _matrix(i: float, j: float, k: float, w: float) -> Array:
    """The rotation matrix of a unit quaternion."""
    return np.array(
        [
            [1 - 2 * (j * j + k * k), 2 * (i * j - k * w), 2 * (i * k + j * w)],
            [2 * (i * j + k * w), 1 - 2 * (i * i + k * k), 2 * (j * k - i * w)],
            [2 * (i * k - j * w), 2 * (j * k + i * w), 1 - 2 * (i * i + j * j)],
        ]
    )


def apply_to_poses(target_from_source: Transform, poses: Array) -> Array:
    """(N, 3) planar poses (x, y, yaw) in `source` as planar poses in `target`, all at once.

    Yaws are in [-pi, pi]. If the transform tilts, the heading of each pose is projected onto the plane.
    """
    x, y, _, *rotation = floats_of(target_from_source)
    matrix = _matrix(*rotation)
    flat = np.asarray(poses, np.float64)
    ahead = np.stack((np.cos(flat[:, 2]), np.sin(flat[:, 2])), axis=1) @ matrix[:2, :2].T
    moved = flat[:, :2] @ matrix[:2, :2].T + (x, y)
    return np.column_stack((moved, np.arctan2(ahead[:, 1], ahead[:, 0])))


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
