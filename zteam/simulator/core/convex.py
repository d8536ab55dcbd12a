"""Polygons in convex parts, by Chipmunk."""

from collections.abc import Sequence

import pymunk
import pymunk.autogeometry

from zteam.geometry import is_convex


def convex_parts(points: Sequence[tuple[float, float]]) -> list[list[tuple[float, float]]]:
    """A simple polygon, counter-clockwise, as convex ones: Chipmunk takes the hull of any other."""
    if is_convex(points):
        return [list(points)]
    closed = [*points, points[0]]
    parts = pymunk.autogeometry.convex_decomposition(closed, 0.0)
    # Chipmunk closes its polygons with their first corner.
    return [[(float(x), float(y)) for x, y in part[:-1]] for part in parts]
