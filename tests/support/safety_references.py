"""What the kernels of the safety layer are to give, computed slowly: the formulas, point by point."""

import math
from collections.abc import Sequence

Triple = Sequence[float]
TOUCH, CLOSEST, ROUNDING, TINY, SEEN_WITHIN = 1e-3, 2e-3, 1e-6, 1e-9, 0.05


def depth_of(x: float, y: float, planes: Sequence[Triple]) -> float:
    """Metres from a point to the furthest of the half-planes (normal, offset)."""
    return max(a * x + b * y - offset for a, b, offset in planes)


def limit_of(x: float, y: float, planes: Sequence[Triple], margin: float) -> float:
    """Metres that the base may come near to a point: `margin`, or less where it is nearer now."""
    depth = depth_of(x, y, planes)
    return min(margin, max(depth - TOUCH, min(depth - ROUNDING, CLOSEST)))


def meet_straight(x: float, y: float, planes: Sequence[Triple], speed: tuple[float, float], margin: float) -> float:
    """Seconds until a base that drives straight on meets a point: it is in all half-planes at once."""
    limit, enters, leaves = limit_of(x, y, planes, margin), 0.0, math.inf
    for a, b, offset in planes:
        closing, depth = speed[0] * a + speed[1] * b, a * x + b * y - offset - limit
        if closing < 0.0:
            leaves = min(leaves, depth / closing)
        elif closing > 0.0:
            enters = max(enters, depth / closing)
        elif depth > 0.0:
            return math.inf
    return enters if enters <= leaves else math.inf


def meet_turning(
    x: float, y: float, planes: Sequence[Triple], centre: tuple[float, float], side: float, margin: float
) -> float:
    """Radians until a base that turns about a centre, to the left where `side` is 1, meets a point."""
    limit, met = limit_of(x, y, planes, margin), math.inf
    away, bearing = math.hypot(x - centre[0], y - centre[1]), math.atan2(y - centre[1], x - centre[0])
    if away <= TINY:
        return met
    for a, b, offset in planes:
        share = (offset - a * centre[0] - b * centre[1] + limit) / away
        turned = (math.acos(min(max(share, -1.0), 1.0)) + side * (bearing - math.atan2(b, a))) % math.tau
        there = bearing - side * turned
        at = centre[0] + away * math.cos(there), centre[1] + away * math.sin(there)
        if depth_of(*at, planes) <= limit + TINY:
            met = min(met, turned)
    return met


def see(
    known: Sequence[Triple], beams: Sequence[Triple], laser: tuple[float, float], few: int, pose: Triple,
    far: float, way: float, oldest: float,
) -> list[Triple]:  # fmt: skip
    """The points (x, y, when) after a scan with beams (cosine, sine, distance)."""
    (start, step), (x, y, yaw), found = laser, pose, []
    step = math.copysign(max(abs(step), 1e-6), step)
    for point in known:
        away = math.hypot(point[0] - x, point[1] - y)
        place = round((math.atan2(point[1] - y, point[0] - x) - yaw - start) / step) % max(
            1, round(math.tau / abs(step))
        )
        is_told = place < len(beams) and beams[place][2] >= away - SEEN_WITHIN
        if away <= far and point[2] >= oldest and not is_told:
            found.append(point)
    for first in range(0, len(beams), few):
        hits = [beam for beam in beams[first : first + few] if beam[2] < far]
        if hits:
            cosine, sine, distance = min(hits, key=lambda beam: beam[2])
            along, aside = distance * cosine, distance * sine
            cosine, sine = math.cos(yaw), math.sin(yaw)
            found.append((x + cosine * along - sine * aside, y + sine * along + cosine * aside, way))
    return found


def look_along(beams: Sequence[Triple], half_width: float, heading: float) -> float:
    """Metres to the nearest hit of beams (cosine, sine, distance) in a corridor from the laser."""
    cosine, sine, nearest = math.cos(heading), math.sin(heading), math.inf
    for a, b, distance in beams:
        if distance < math.inf:
            x, y = distance * (cosine * a + sine * b), distance * (cosine * b - sine * a)
            nearest = min(nearest, x if x > 0.0 and abs(y) <= half_width else math.inf)
    return nearest
