"""Rigid transforms as tuples of seven floats, which is faster than numpy arrays or objects."""

import math

Floats = tuple[float, float, float, float, float, float, float]
"""x, y, z, qx, qy, qz, qw of parent_from_child."""

IDENTITY: Floats = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def compose(a_from_b: Floats, b_from_c: Floats) -> Floats:
    """The product a_from_c of two transforms."""
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
    """The inverse b_from_a of a transform."""
    x, y, z, i, j, k, w = a_from_b
    i, j, k = -i, -j, -k
    cx = j * z - k * y + w * x
    cy = k * x - i * z + w * y
    cz = i * y - j * x + w * z
    return (
        -x - 2.0 * (j * cz - k * cy),
        -y - 2.0 * (k * cx - i * cz),
        -z - 2.0 * (i * cy - j * cx),
        i,
        j,
        k,
        w,
    )


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
