"""The outline of a robot: the radii that planning needs, and which cells it covers."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Footprint(NamedTuple):
    """A robot's outline in its base frame, as a polygon in metres."""

    corners: Floats
    """(n, 2), in order; a circle has 16 that lie outside of it."""
    inscribed_radius: float
    """Distance of the origin to the nearest point of the outline; 0 if the origin is outside."""
    circumscribed_radius: float
    """Distance to the farthest one."""
    half_width: float
    """How far it reaches to its wider side."""


_CORNERS_OF_CIRCLE = 16


def make_footprint(corners: Sequence[Sequence[float]] | Floats, padding: float = 0.0) -> Footprint:
    """A footprint of three corners or more (metres), each `padding` farther out along both axes, as Nav2 pads it.

    Raises ValueError.
    """
    points = np.array(corners, np.float64)
    if points.ndim != 2 or points.shape[0] < 3 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise ValueError("a footprint is a list of three corners [x, y] or more, in metres")
    points = points + np.where(points > 0.0, padding, np.where(points < 0.0, -padding, 0.0))
    inside, nearest = _distance_of_origin(points)
    return Footprint(
        points,
        nearest if inside else 0.0,
        float(np.hypot(points[:, 0], points[:, 1]).max()),
        float(np.abs(points[:, 1]).max()),
    )


def make_circle(radius: float, padding: float = 0.0) -> Footprint:
    """The footprint of a round robot. Raises ValueError for a radius that is not above 0."""
    if not 0.0 < radius < math.inf:
        raise ValueError(f"a robot's radius is above 0 m, not {radius}")
    turns = (np.arange(_CORNERS_OF_CIRCLE) + 0.5) * (2.0 * math.pi / _CORNERS_OF_CIRCLE)
    outer = (radius + padding) / math.cos(math.pi / _CORNERS_OF_CIRCLE)
    points = outer * np.stack((np.cos(turns), np.sin(turns)), axis=1)
    return Footprint(points, radius + padding, outer, radius + padding)


def _distance_of_origin(points: Floats) -> tuple[bool, float]:
    """Whether the origin lies inside a polygon, and its distance to the outline."""
    ends = np.roll(points, -1, axis=0)
    along = ends - points
    square = np.maximum((along * along).sum(axis=1), 1e-300)
    share = np.clip(-(points * along).sum(axis=1) / square, 0.0, 1.0)
    nearest = np.hypot(*(points + share[:, None] * along).T).min()
    crosses = (points[:, 1] > 0.0) != (ends[:, 1] > 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        where = points[:, 0] - points[:, 1] * along[:, 0] / along[:, 1]
    return bool((crosses & (where > 0.0)).sum() % 2), float(nearest)


def place(footprint: Footprint, x: float, y: float, yaw: float) -> Floats:
    """The corners (n, 2) of a robot at this pose."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    px, py = footprint.corners[:, 0], footprint.corners[:, 1]
    return np.stack((x + cos * px - sin * py, y + sin * px + cos * py), axis=1)
