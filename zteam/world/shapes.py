"""Outlines of bodies: Stage's blocks, fitted to the model's size as Stage fits them."""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from zteam.geometry import Pose2
from zteam.world.model import Point2, Shape
from zteam.world.properties import Size3

BOUNDARY_THICKNESS = 0.01
"""Metres: Stage's `boundary 1` is four slabs of this thickness."""


class Block(NamedTuple):
    """A prism in units of its own: only its proportions to the model's other blocks count."""

    points: tuple[Point2, ...]
    z_min: float
    z_max: float


UNIT_BOX = Block(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)), 0.0, 1.0)


class Surface(NamedTuple):
    """What the shapes of one model have in common."""

    ranger_return: float
    obstacle: bool


def fit_blocks(blocks: Sequence[Block], size: Size3) -> list[Block]:
    """All blocks of a model scaled together: their bounding box becomes `size`, centred; heights rise from 0.

    The rule is Stage's: x and y are stretched from the box of all points, z from 0 to the highest block. Raises
    ValueError if the blocks have no extent along an axis.
    """
    xs = [x for block in blocks for x, _ in block.points]
    ys = [y for block in blocks for _, y in block.points]
    left, bottom, top = min(xs), min(ys), max(block.z_max for block in blocks)
    width, depth = max(xs) - left, max(ys) - bottom
    if not (width > 0 and depth > 0 and top > 0):
        raise ValueError("the blocks of a model must have an extent along x, y and z")
    return [
        Block(
            tuple(
                (((x - left) / width - 0.5) * size.x, ((y - bottom) / depth - 0.5) * size.y) for x, y in block.points
            ),
            block.z_min / top * size.z,
            block.z_max / top * size.z,
        )
        for block in blocks
    ]


def boundary_slabs(size: Size3) -> list[Block]:
    """Four slabs just inside a box of `size`, centred, as high as the box."""
    x, y, t = size.x / 2, size.y / 2, min(BOUNDARY_THICKNESS, size.x, size.y)
    boxes = ((-x, -y, x, t - y), (-x, y - t, x, y), (-x, -y, t - x, y), (x - t, -y, x, y))
    return [box_block(*box, size.z) for box in boxes]


def box_block(left: float, bottom: float, right: float, top: float, height: float) -> Block:
    """A rectangle of a height."""
    return Block(((left, bottom), (right, bottom), (right, top), (left, top)), 0.0, height)


def place_blocks(blocks: Iterable[Block], owner_from_body: Pose2, z: float, surface: Surface) -> tuple[Shape, ...]:
    """Blocks as shapes of their owner, counter-clockwise, raised by `z`."""
    c, s = math.cos(owner_from_body.yaw), math.sin(owner_from_body.yaw)
    return tuple(
        Shape(
            tuple(
                (owner_from_body.x + c * x - s * y, owner_from_body.y + s * x + c * y)
                for x, y in counter_clockwise(block.points)
            ),
            z + block.z_min,
            z + block.z_max,
            surface.ranger_return,
            surface.obstacle,
        )
        for block in blocks
    )


def signed_area(points: Sequence[Point2]) -> float:
    """Area of a polygon, positive if counter-clockwise."""
    pairs = zip(points, (*points[1:], points[0]), strict=True)
    return 0.5 * sum(ax * by - bx * ay for (ax, ay), (bx, by) in pairs)


def counter_clockwise(points: Sequence[Point2]) -> tuple[Point2, ...]:
    """The polygon with its interior on the left."""
    return tuple(points) if signed_area(points) > 0 else tuple(reversed(points))


def without_repeats(points: Sequence[Point2]) -> tuple[Point2, ...]:
    """The polygon without corners that repeat the one before; a last corner may repeat the first."""
    return tuple(point for i, point in enumerate(points) if point != points[i - 1])


def is_simple(points: Sequence[Point2]) -> bool:
    """Whether no two edges of the polygon meet, but neighbours in their common corner. Quadratic."""
    n = len(points)
    edges = [(points[i], points[(i + 1) % n]) for i in range(n)]
    return not any(_folds_back(*edges[i - 1], edges[i][1]) for i in range(n)) and not any(
        _edges_meet(*edges[i], *edges[j]) for i in range(n) for j in range(i + 2, n) if not (i == 0 and j == n - 1)
    )


def _folds_back(a: Point2, b: Point2, c: Point2) -> bool:
    """Whether the way a, b, c turns round at b."""
    return _turn(a, b, c) == 0 and (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]) < 0


def _edges_meet(a: Point2, b: Point2, c: Point2, d: Point2) -> bool:
    if _turn(a, b, c) * _turn(a, b, d) < 0 and _turn(c, d, a) * _turn(c, d, b) < 0:
        return True
    return any(_is_on(*edge, point) for edge, point in (((a, b), c), ((a, b), d), ((c, d), a), ((c, d), b)))


def _turn(a: Point2, b: Point2, c: Point2) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _is_on(a: Point2, b: Point2, p: Point2) -> bool:
    """Whether p lies on the edge from a to b."""
    return (
        _turn(a, b, p) == 0
        and min(a[0], b[0]) <= p[0] <= max(a[0], b[0])
        and min(a[1], b[1]) <= p[1] <= max(a[1], b[1])
    )


def convex_hull(points: Sequence[Point2]) -> tuple[Point2, ...]:
    """Smallest convex polygon around the points, counter-clockwise (Andrew's monotone chain)."""
    ordered = sorted(set(points))
    return (*_chain(ordered), *_chain(ordered[::-1]))


def _chain(points: Sequence[Point2]) -> list[Point2]:
    chain: list[Point2] = []
    for point in points:
        while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
            chain.pop()
        chain.append(point)
    return chain[:-1]
