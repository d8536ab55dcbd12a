"""Polygons of movers and of what stands still, as kernels take them."""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from zteam.geometry import Pose2
from zteam.kernels.binding import Polygons
from zteam.world.model import Obstacle, Robot, Shape
from zteam.world.shapes import is_convex

NO_MOVER = -1
"""Owner of a group that stands still."""

Ints = NDArray[np.int32]


class Group(NamedTuple):
    """Shapes that move together."""

    owner: int
    """The mover that they belong to, or NO_MOVER."""
    source: int
    """The model: robots come first, then all obstacles."""
    shapes: Sequence[Shape]


def group_shapes(robots: Sequence[Robot], obstacles: Sequence[Obstacle]) -> list[Group]:
    """All shapes by owner: robots are movers 0, 1, …; obstacles that can be pushed come after them."""
    groups = [Group(i, i, robot.shapes) for i, robot in enumerate(robots)]
    movers = len(robots)
    for source, obstacle in enumerate(obstacles, len(robots)):
        if obstacle.mass is not None:
            groups.append(Group(movers, source, obstacle.shapes))
            movers += 1
        else:
            groups += [Group(NO_MOVER, source, [place_shape(obstacle.pose, shape)]) for shape in obstacle.shapes]
    return groups


def place_shape(pose: Pose2, shape: Shape) -> Shape:
    """A shape in `map` whose owner stands at `pose`."""
    points = tuple(pose.compose(Pose2(x, y, 0.0))[:2] for x, y in shape.points)
    return Shape(points, shape.z_min, shape.z_max, shape.ranger_return, shape.obstacle, shape.color)


def find_slabs(shapes: Sequence[Shape], most: int) -> list[tuple[float, float]]:
    """Layers between the heights at which what collides begins or ends; the topmost are one if there are too many."""
    heights = sorted({z for shape in shapes if shape.obstacle for z in (shape.z_min, shape.z_max)})
    return list(itertools.pairwise([-math.inf, *heights[: most - 1], math.inf]))


def make_polygons(groups: Sequence[Group]) -> Polygons:
    """Arrays of the groups' shapes; groups without shapes are left out."""
    groups = [group for group in groups if group.shapes]
    shapes = [shape for group in groups for shape in group.shapes]
    points = np.array([point for shape in shapes for point in shape.points], float).reshape(-1, 2)
    centres, radii = [], []
    for group in groups:
        corners = np.array([point for shape in group.shapes for point in shape.points], float)
        centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        centres.append(centre)
        radii.append(float(np.hypot(*(corners - centre).T).max()))
    return Polygons(
        x=points[:, 0].copy(),
        y=points[:, 1].copy(),
        first_vertex=_starts([len(shape.points) for shape in shapes]),
        z_min=np.array([shape.z_min for shape in shapes], float),
        z_max=np.array([shape.z_max for shape in shapes], float),
        first_shape=_starts([len(group.shapes) for group in groups]),
        owner=np.array([group.owner for group in groups], np.int64),
        centre=np.array(centres, float).reshape(-1, 2),
        radius=np.array(radii, float),
    )


def _starts(counts: Sequence[int]) -> Ints:
    return np.concatenate(([0], np.cumsum(counts, dtype=np.int32))).astype(np.int32)


def convex_solids(shapes: Sequence[Shape]) -> list[Shape]:
    """What collides of these shapes, in convex parts."""
    parts = []
    for shape in shapes:
        if shape.obstacle and is_convex(shape.points):
            parts.append(shape)
        elif shape.obstacle:
            from zteam.sim.dynamic import convex_parts  # pymunk: imported only for such a shape

            parts += [replace(shape, points=tuple(points)) for points in convex_parts(shape.points)]
    return parts
