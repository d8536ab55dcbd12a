"""Rigid transforms as tuples of seven floats, which is faster than numpy arrays or objects."""

import math

import numpy as np
from numpy.typing import NDArray

from zteam.messages import Header, LaserScan, Quaternion, Time, Transform, TransformStamped, Twist, Vector3
from zteam.messages.laser import read_ranges

Array = NDArray[np.float64]
Floats = tuple[float, float, float, float, float, float, float]
"""x, y, z, qx, qy, qz, qw of parent_from_child."""

IDENTITY: Floats = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def floats_of(transform: Transform) -> Floats:
    """The seven numbers x, y, z, qx, qy, qz, qw of a transform."""
    t, r = transform.translation, transform.rotation
    return (t.x, t.y, t.z, r.x, r.y, r.z, r.w)


def stamped_transform(stamp: Time, parent: str, child: str, floats: Floats) -> TransformStamped:
    x, y, z, i, j, k, w = floats
    return TransformStamped(Header(stamp, parent), child, Transform(Vector3(x, y, z), Quaternion(i, j, k, w)))


def compose(a_from_b: Floats, b_from_c: Floats) -> Floats:
    x, y, z, i, j, k, w = a_from_b
    px, py, pz, qi, qj, qk, qw = b_from_c
    if i == j == qi == qj == 0.0:
        c, s = w * w - k * k, 2.0 * w * k
        return x + c * px - s * py, y + s * px + c * py, z + pz, 0.0, 0.0, w * qk + k * qw, w * qw - k * qk
    # v + 2 q × (q × v + w v): the rotation of a vector by a unit quaternion in 18 products.
    cx = j * pz - k * py + w * px
    cy = k * px - i * pz + w * py
    cz = i * py - j * px + w * pz
    return (
        x + px + 2.0 * (j * cz - k * cy),
        y + py + 2.0 * (k * cx - i * cz),
        z + pz + 2.0 * (i * cy - j * cx),
        w * qi + i * qw + j * qk - k * qj,
        w * qj + j * qw + k * qi - i * qk,
        w * qk + k * qw + i * qj - j * qi,
        w * qw - i * qi - j * qj - k * qk,
    )


def invert(a_from_b: Floats) -> Floats:
    x, y, z, i, j, k, w = a_from_b
    i, j, k = -i, -j, -k
    cx = j * z - k * y + w * x
    cy = k * x - i * z + w * y
    cz = i * y - j * x + w * z
    return (-x - 2.0 * (j * cz - k * cy), -y - 2.0 * (k * cx - i * cz), -z - 2.0 * (i * cy - j * cx), i, j, k, w)


def interpolate(a: Floats, b: Floats, fraction: float) -> Floats:
    """The transform at a fraction (0 to 1) between two: linear in place, shortest slerp in rotation, as in tf2."""
    ax, ay, az, ai, aj, ak, aw = a
    bx, by, bz, bi, bj, bk, bw = b
    dot = ai * bi + aj * bj + ak * bk + aw * bw
    sign = -1.0 if dot < 0.0 else 1.0
    dot *= sign
    if dot > 1.0 - 1e-12:
        # For so small an angle sin(angle) loses all its digits, and linear interpolation is exact enough.
        fa, fb = 1.0 - fraction, fraction
    else:
        angle = math.acos(dot)
        scale = 1.0 / math.sin(angle)
        fa, fb = math.sin((1.0 - fraction) * angle) * scale, math.sin(fraction * angle) * scale
    fb *= sign
    rest = 1.0 - fraction
    return (
        rest * ax + fraction * bx,
        rest * ay + fraction * by,
        rest * az + fraction * bz,
        fa * ai + fb * bi,
        fa * aj + fb * bj,
        fa * ak + fb * bk,
        fa * aw + fb * bw,
    )


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
