"""Polygons of bodies: Stage's blocks, fitted to the model's size as Stage does."""

import functools
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from zteam.geometry import Point2, Pose2, signed_area
from zteam.world.model import Shape
from zteam.world.properties import Size3

BOUNDARY_THICKNESS = 0.01
"""Metres: Stage's `boundary 1` is four slabs of this thickness."""


LEAST_AREA = 1e-12
"""Square metres: a block below a square micrometre is rounding, not a body."""


class Block(NamedTuple):
    """A prism in units of its own: only its proportions to the model's other blocks count."""

    points: tuple[Point2, ...]
    z_min: float
    z_max: float


UNIT_BOX = Block(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)), 0.0, 1.0)


class Surface(NamedTuple):
    """Properties that the shapes of one model share."""

    ranger_return: float
    obstacle: bool
    color: str


def fit_blocks(blocks: Sequence[Block], size: Size3) -> list[Block]:
    """All blocks of a model scaled together: their bounding box becomes `size`, centred; heights rise from 0.

    The rule is Stage's: x and y are stretched from the box of all points, z from 0 to the highest block; blocks that
    do not rise above 0 are flat. Raises ValueError if the blocks have no extent along x or y.
    """
    xs = [x for block in blocks for x, _ in block.points]
    ys = [y for block in blocks for _, y in block.points]
    left, bottom, top = min(xs), min(ys), max(block.z_max for block in blocks)
    width, depth = max(xs) - left, max(ys) - bottom
    if not (width > 0 and depth > 0):
        raise ValueError("the blocks of a model must have an extent along x and y")
    return [
        Block(
            tuple(
                (((x - left) / width - 0.5) * size.x, ((y - bottom) / depth - 0.5) * size.y) for x, y in block.points
            ),
            block.z_min / top * size.z if top > 0 else 0.0,
            block.z_max / top * size.z if top > 0 else 0.0,
        )
        for block in blocks
    ]


def boundary_slabs(size: Size3) -> list[Block]:
    """Four slabs just inside a box of `size`, centred, as high as the box."""
    x, y, t = size.x / 2, size.y / 2, min(BOUNDARY_THICKNESS, size.x, size.y)
    boxes = ((-x, -y, x, t - y), (-x, y - t, x, y), (-x, -y, t - x, y), (x - t, -y, x, y))
    return [box_block(*box, size.z) for box in boxes]


def box_block(left: float, bottom: float, right: float, top: float, height: float) -> Block:
    """A block over a rectangle."""
    return Block(((left, bottom), (right, bottom), (right, top), (left, top)), 0.0, height)


def place_blocks(blocks: Iterable[Block], owner_from_body: Pose2, z: float, surface: Surface) -> tuple[Shape, ...]:
    """Blocks as shapes of their owner, counter-clockwise, raised by `z`; specks below LEAST_AREA are left out."""
    c, s = math.cos(owner_from_body.yaw), math.sin(owner_from_body.yaw)
    shapes = []
    for block in blocks:
        points = tuple(
            (owner_from_body.x + c * x - s * y, owner_from_body.y + s * x + c * y)
            for x, y in counter_clockwise(block.points)
        )
        if signed_area(points) > LEAST_AREA:
            heights = z + block.z_min, z + block.z_max
            shapes.append(Shape(points, *heights, surface.ranger_return, surface.obstacle, surface.color))
    return tuple(shapes)


def counter_clockwise(points: Sequence[Point2]) -> tuple[Point2, ...]:
    """The polygon with its interior on the left."""
    return tuple(points) if signed_area(points) > 0 else tuple(reversed(points))


def without_repeats(points: Sequence[Point2]) -> tuple[Point2, ...]:
    """The polygon without corners that repeat the one before; a last corner may repeat the first."""
    return tuple(point for i, point in enumerate(points) if point != points[i - 1])


@functools.lru_cache(256)
def is_simple(points: tuple[Point2, ...]) -> bool:
    """Whether edges of the polygon meet only in the corners that they share."""
    corners = np.array(points)
    ends = np.roll(corners, -1, axis=0)
    dx, dy = (ends - corners).T[:, :, None]
    # turn[i, k]: on which side of edge i corner k lies.
    turn = dx * (corners[:, 1] - corners[:, 1, None]) - dy * (corners[:, 0] - corners[:, 0, None])
    parted = turn * np.roll(turn, -1, axis=1) < 0
    low, high = np.minimum(corners, ends)[:, None], np.maximum(corners, ends)[:, None]
    touches = (turn == 0) & ((low <= corners) & (corners <= high)).all(axis=2)
    own = np.eye(len(corners), dtype=bool)
    touches &= ~(own | np.roll(own, 1, axis=1))
    return not (parted & parted.T).any() and not touches.any()
