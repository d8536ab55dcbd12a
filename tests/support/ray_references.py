"""Rays and bodies in plain Python, slow and without any choice of what to look at: references for kernels."""

import math

import numpy as np

Point = tuple[float, float]


def cosine_sine(angle: float) -> tuple[float, float]:
    """As kernels compute them (sines.h), to the bit: Taylor's series about the nearest multiple of pi."""
    half_turns = float(np.rint(angle * (1.0 / math.pi)))
    rest = angle - half_turns * math.pi
    sign = 1.0 - 2.0 * abs(half_turns - 2.0 * float(np.rint(0.5 * half_turns)))
    x, odd, even = rest * rest, 0.0, 0.0
    for n in range(10, 0, -1):
        odd = (odd + (-1.0) ** n / math.factorial(2 * n + 1)) * x
        even = (even + (-1.0) ** n / math.factorial(2 * n)) * x
    return sign * (1.0 + even), sign * (rest * (1.0 + odd))


def cast_at_cells(
    occupied: np.ndarray, cell: tuple[float, float], x: float, y: float, angle: float, limit: float
) -> float:
    """Metres to the nearest occupied cell along a ray, `limit` at most: a slab test against each cell."""
    rows, columns = np.nonzero(occupied)
    dx, dy = math.cos(angle), math.sin(angle)
    dx, dy = (d if abs(d) > 1e-9 else math.copysign(1e-9, d) for d in (dx, dy))
    low_x, low_y = columns * cell[0] - x, rows * cell[1] - y
    tx, ty = np.stack((low_x / dx, (low_x + cell[0]) / dx)), np.stack((low_y / dy, (low_y + cell[1]) / dy))
    enter, leave = np.maximum(tx.min(axis=0), ty.min(axis=0)), np.minimum(tx.max(axis=0), ty.max(axis=0))
    hits = enter[(enter < leave - 1e-9) & (leave > 0)]
    return min(limit, max(0.0, float(hits.min()))) if hits.size else limit


def cast_at_polygons(
    polygons: list[list[Point]], pose: tuple[float, float, float], cos: np.ndarray, sin: np.ndarray, limit: float,
    *, fronts: bool = False,
) -> np.ndarray:  # fmt: skip
    """Metres along each beam to the nearest polygon, 0 in its interior: every beam against every edge.

    `fronts`: only against edges that face the sensor. Through a corner that is a matter of rounding.
    """
    (x, y, yaw), ranges = pose, np.full(len(cos), limit)
    c, s = cosine_sine(yaw)
    for points in polygons:
        if contains(points, x, y):
            ranges[:] = 0.0
        ends = [(c * (px - x) + s * (py - y), c * (py - y) - s * (px - x)) for px, py in points]
        for (ux, uy), (wx, wy) in zip((ends[-1], *ends[:-1]), ends, strict=True):
            ex, ey = wx - ux, wy - uy
            if fronts and ux * ey - uy * ex >= 0.0:
                continue
            across = cos * ey - sin * ex
            across[np.abs(across) < 1e-15] = np.nan
            along, where = (ux * ey - uy * ex) / across, (sin * ux - cos * uy) / across
            meets = (along >= 0.0) & (along < ranges) & (where >= -1e-12) & (where <= 1.0 + 1e-12)
            ranges[meets] = along[meets]
    return ranges


def is_on_border(points: list[Point], x: float, y: float) -> bool:
    """Whether a point lies on the border of a polygon, to a nanometre: inside or outside is a matter of rounding."""
    for (ax, ay), (bx, by) in zip((points[-1], *points[:-1]), points, strict=True):
        way = math.dist((ax, ay), (bx, by))
        if way > 0.0:
            along = min(max(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / way**2, 0.0), 1.0)
            if math.dist((x, y), (ax + along * (bx - ax), ay + along * (by - ay))) < 1e-9:
                return True
    return False


def contains(points: list[Point], x: float, y: float) -> bool:
    """Whether a point lies in a polygon, by the even-odd rule."""
    inside = False
    for (ax, ay), (bx, by) in zip((points[-1], *points[:-1]), points, strict=True):
        if (by > y) != (ay > y) and x < bx + (y - by) * (ax - bx) / (ay - by):
            inside = not inside
    return inside


def common_area(one: list[Point], other: list[Point]) -> float:
    """The area that two convex polygons, counter-clockwise, share (Sutherland and Hodgman 1974), in square metres."""
    left = one
    for (ax, ay), (bx, by) in zip((other[-1], *other[:-1]), other, strict=True):
        depths = [(bx - ax) * (y - ay) - (by - ay) * (x - ax) for x, y in left]
        kept: list[Point] = []
        for i, (point, depth) in enumerate(zip(left, depths, strict=True)):
            before, depth_before = left[i - 1], depths[i - 1]
            if (depth >= 0.0) != (depth_before >= 0.0):
                t = depth_before / (depth_before - depth)
                kept.append((before[0] + t * (point[0] - before[0]), before[1] + t * (point[1] - before[1])))
            if depth >= 0.0:
                kept.append(point)
        left = kept
        if not left:
            return 0.0
    turned = (*left[1:], left[0])
    return 0.5 * abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(left, turned, strict=True)))
