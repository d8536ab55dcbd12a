"""Bodies of models, from `size`, `origin`, blocks, bitmaps and `boundary`: fitted to the model's size as Stage does."""

import functools
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from zteam.config.map_files import MAX_PIXELS, FloorMap, Grid, is_floor_map, read_channels, read_floor_map
from zteam.errors import WorldError
from zteam.geometry import Point2, Pose2, convex_hull, signed_area
from zteam.simulator.world.colors import random_color
from zteam.simulator.world.devices import MODELS
from zteam.simulator.world.model import Shape
from zteam.simulator.world.properties import Pose3, Reader, Size3
from zteam.simulator.world.text import find_file

DARK = 127.5
"""A pixel is occupied if its first channel is below this: Stage's fixed threshold; map_server's 205 is free."""

BOUNDARY_THICKNESS = 0.01
"""Metres: Stage's `boundary 1` is four slabs of this thickness."""
LEAST_AREA = 1e-12
"""Square metres: a block below a square micrometre is rounding, not a body."""
DEFAULT_SIZE = Size3(0.1, 0.1, 0.1)
RANGER_SIZE = Size3(0.15, 0.15, 0.2)
FLOOR_HEIGHT = 1.0
"""Metres that the walls of a map_server YAML are high, unless the model has a size."""
MIN_EXTENT = 1e-6
MAX_POINTS = 256
MAX_ALL_POINTS = 500_000
"""Corners of all blocks of a world, once macros are expanded."""
MAX_RECTANGLES = 256
"""Rectangles of a bitmap on a robot; a finer one is taken as its box."""

Box = tuple[int, int, int, int]
Surface = tuple[float, bool, str]
"""What the shapes of a model share: `ranger_return`, whether they are obstacles, colour."""


def read_bitmap(path: Path) -> Grid:
    """Occupied cells of an image, (rows, columns) with row 0 at the bottom; raises WorldError, as `read_channels` does.

    A pixel that is more transparent than not is free, as in a viewer with a white ground. Stage does not look at alpha.
    """
    pixels = read_channels(path)[::-1]
    is_solid = pixels[:, :, -1] > DARK if pixels.shape[2] in (2, 4) else True
    return np.ascontiguousarray((pixels[:, :, 0] < DARK) & is_solid)


def occupied_box(occupied: Grid) -> Box | None:
    """Smallest box around the occupied cells, half open: (first row, end row, first column, end column)."""
    rows = np.flatnonzero(occupied.any(axis=1))
    if rows.size == 0:
        return None
    columns = np.flatnonzero(occupied.any(axis=0))
    return int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1


def rectangles(occupied: Grid, limit: int) -> list[Box] | None:
    """Disjoint boxes that cover the occupied cells: each row's runs, joined with equal runs of the rows above. None if
    there are more than `limit`."""
    steps = np.diff(occupied, axis=1, prepend=False, append=False)
    rows, columns = np.nonzero(steps)
    if rows.size > 2 * limit * len(occupied):
        return None
    runs_of: list[set[tuple[int, int]]] = [set() for _ in range(len(occupied) + 1)]
    for row, start, end in zip(rows[::2].tolist(), columns[::2].tolist(), columns[1::2].tolist(), strict=True):
        runs_of[row].add((start, end))
    done: list[Box] = []
    growing: dict[tuple[int, int], int] = {}
    for row, runs in enumerate(runs_of):
        done.extend((growing.pop(run), row, *run) for run in growing.keys() - runs)
        growing.update(dict.fromkeys(runs - growing.keys(), row))
        if len(done) > limit:
            return None
    return sorted(done)


class Block(NamedTuple):
    """A prism in units of its own: only its proportions to the model's other blocks count."""

    points: tuple[Point2, ...]
    z_min: float
    z_max: float


def fit_blocks(blocks: Sequence[Block], size: Size3) -> list[Block]:
    """All blocks of a model scaled together: their bounding box becomes `size`, centred; heights rise from 0.

    The rule is Stage's: x and y are stretched from the box of all points, z from 0 to the highest block; blocks that
    do not rise above 0 are flat. Each block has an area.
    """
    xs = [x for block in blocks for x, _ in block.points]
    ys = [y for block in blocks for _, y in block.points]
    left, bottom, top = min(xs), min(ys), max(block.z_max for block in blocks)
    width, depth = max(xs) - left, max(ys) - bottom
    fitted = []
    for points, *heights in blocks:
        corners = [(((x - left) / width - 0.5) * size.x, ((y - bottom) / depth - 0.5) * size.y) for x, y in points]
        z_min, z_max = (height / top * size.z if top > 0 else 0.0 for height in heights)
        fitted.append(Block(tuple(corners), z_min, z_max))
    return fitted


def boundary_slabs(size: Size3) -> list[Block]:
    """Four slabs just inside a box of `size`, centred, as high as the box."""
    x, y, t = size.x / 2, size.y / 2, min(BOUNDARY_THICKNESS, size.x, size.y)
    boxes = ((-x, -y, x, t - y), (-x, y - t, x, y), (-x, -y, t - x, y), (x - t, -y, x, y))
    return [_box(*box, size.z) for box in boxes]


def _box(left: float, bottom: float, right: float, top: float, height: float) -> Block:
    return Block(((left, bottom), (right, bottom), (right, top), (left, top)), 0.0, height)


def place_blocks(blocks: Iterable[Block], owner_from_body: Pose2, z: float, surface: Surface) -> tuple[Shape, ...]:
    """Blocks as shapes of their owner, counter-clockwise, raised by `z`; specks below LEAST_AREA are left out."""
    c, s = math.cos(owner_from_body.yaw), math.sin(owner_from_body.yaw)
    shapes = []
    for block in blocks:
        corners = block.points if signed_area(block.points) > 0 else block.points[::-1]
        points = tuple((owner_from_body.x + c * x - s * y, owner_from_body.y + s * x + c * y) for x, y in corners)
        if signed_area(points) > LEAST_AREA:
            shapes.append(Shape(points, z + block.z_min, z + block.z_max, *surface))
    return tuple(shapes)


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


class Body(NamedTuple):
    """A model's pose in its parent's frame, and its geometry. `origin` and `size` are the box of all its parts."""

    pose: Pose3
    size: Size3
    origin: Pose3
    surface: Surface
    blocks: tuple[Block, ...]
    """Fitted to `size`, centred, and the slabs of a boundary; not the bitmap."""
    bitmap: Grid | None
    """Cells that fill the box of `size`."""
    picture: tuple[int, ...]
    """Rows and columns of the picture that the bitmap was cropped from, or of the whole one."""


def read_body(reader: Reader) -> Body:
    entity, pose = reader.entity, reader.pose("pose")
    size = reader.size(RANGER_SIZE if entity.type in ("ranger", "laser") else DEFAULT_SIZE)
    found_blocks = [_read_block(reader.of(child)) for child in entity.children if child.type == "block"]
    blocks = [block for block in found_blocks if block is not None]
    bitmap: Grid | None = None
    picture: tuple[int, ...] = ()
    if reader.has("bitmap"):
        if blocks:
            reader.remark("bitmap", "the blocks of a model with a bitmap are ignored")
        blocks, (bitmap, floor, picture) = [], _read_bitmap(reader)
        if floor is not None:
            x, y, yaw = floor.map_from_corner.compose(Pose2(floor.size[0] / 2, floor.size[1] / 2, 0.0))
            size = size if reader.has("size") else Size3(*floor.size, FLOOR_HEIGHT)
            pose = pose if reader.has("pose") else Pose3(x, y, 0.0, yaw)
    elif not blocks:
        sensing = MODELS.get(entity.type)
        has_body = entity.type != "camera" if sensing is None else sensing.has_body
        blocks = [_box(0.0, 0.0, 1.0, 1.0, 1.0)] if has_body and not reader.flag("noblocks", False) else []
    slabs = boundary_slabs(size) if reader.flag("boundary", False) else []
    if blocks or slabs or bitmap is not None:
        if min(size.x, size.y) < MIN_EXTENT:
            reader.remark("size", f"a body of {size.x:g} x {size.y:g} m is no obstacle, and no laser sees it")
            blocks, slabs, bitmap = [], [], None
        elif size.z < MIN_EXTENT or (blocks and max(block.z_max for block in blocks) <= 0):
            reader.remark("size", "this body is flat: lasers pass over it and robots drive over it, as in Stage")
    origin, intensity = reader.pose("origin"), reader.number("ranger_return", reader.number("laser_return", 1.0))
    surface = intensity, reader.flag("obstacle_return", True), _read_color(reader)
    fitted = fit_blocks(blocks, size) if blocks else []
    return Body(pose, size, origin, surface, (*fitted, *slabs), bitmap, picture)


def solid_blocks(body: Body, reader: Reader) -> tuple[Block, ...]:
    """Everything of a body as prisms, a bitmap as rectangles: for bodies that move."""
    if body.bitmap is None:
        return body.blocks
    rows, columns = body.bitmap.shape
    known, key = reader.settings.boxes, id(body.bitmap)
    if key not in known:
        known[key] = rectangles(body.bitmap, MAX_RECTANGLES) or []
    boxes = known[key]
    if not boxes:
        reader.remark("", f"the bitmap of this robot needs more than {MAX_RECTANGLES} rectangles: its box is taken")
        boxes = [(0, rows, 0, columns)]
    reader.add_up("bitmap", "points of blocks", 4 * len(boxes), MAX_ALL_POINTS)
    # Edges of columns and of rows, from the middle.
    x = (np.arange(columns + 1) * (body.size.x / columns) - body.size.x / 2).tolist()
    y = (np.arange(rows + 1) * (body.size.y / rows) - body.size.y / 2).tolist()
    found = (_box(x[left], y[bottom], x[right], y[top], body.size.z) for bottom, top, left, right in boxes)
    return *body.blocks, *found


def _read_color(reader: Reader) -> str:
    """A name of X11's, or #rrggbb from `color_rgba` (its transparency is ignored)."""
    if reader.has("color_rgba") and not reader.has("color"):
        channels = reader.numbers("color_rgba", "nnn", ())
        return "#" + "".join(f"{round(255 * min(max(channel, 0.0), 1.0)):02x}" for channel in channels)
    name = reader.text("color", "red")
    # Stage draws another "random" colour in every run; here the colour belongs to the model.
    return random_color(f"{reader.entity.place}{reader.text('name', '')}") if name == "random" else name


def _read_bitmap(reader: Reader) -> tuple[Grid | None, FloorMap | None, tuple[int, ...]]:
    """The bitmap of a model, the map_server YAML that it is of, and the shape of its picture. It has none if none is
    named, or if it is white all over and Stage finds no polygon in it."""
    name, settings = reader.text("bitmap", ""), reader.settings
    if not name:
        reader.remark("bitmap", "no bitmap is named: no body")
        return None, None, ()
    path = find_file(name, settings.folder)
    if path is None:
        reader.fail("bitmap", f"bitmap {name!r:.200} not found in {settings.folder} or $STAGEPATH")
    usual = "whole" if settings.whole_bitmaps else "crop"
    reading = reader.choice("bitmap_reading", usual, ("crop", "whole"), strict=True)
    key = path.resolve(), reading
    if key not in settings.bitmaps:
        try:
            floor = read_floor_map(path) if is_floor_map(path) else None
            occupied = read_bitmap(path) if floor is None else floor.occupied
        except WorldError as error:
            if is_floor_map(Path(reader.entity.place.file)):  # a world by itself, which the error names
                raise
            reader.fail("bitmap", str(error))
        picture = occupied.shape
        if reading == "crop" and floor is None:
            bottom, top, left, right = occupied_box(occupied) or (0, 0, 0, 0)
            occupied = occupied[bottom:top, left:right].copy()
        reader.add_up("bitmap", "pixels of bitmaps", occupied.size, MAX_PIXELS)
        settings.bitmaps[key] = occupied, floor, picture
    found = settings.bitmaps[key]
    if found[1] is not None or found[0].size:
        return found
    reader.remark("bitmap", f"bitmap {name!r:.200} has no occupied pixel (first channel at most 127): no body")
    return None, None, ()


def _read_block(reader: Reader) -> Block | None:
    count = reader.whole("points", 0, 0, MAX_POINTS)
    corners = []
    for i in range(count):
        if not reader.has(f"point[{i}]"):
            reader.remark("points", f"a block of {count} points lacks point[{i}]: [0 0] is taken, as Stage does")
        x, y = reader.numbers(f"point[{i}]", "ll", (0.0, 0.0))
        corners.append((x, y))
    reader.add_up("points", "points of blocks", count, MAX_ALL_POINTS)
    z_min, z_max = reader.numbers("z", "ll", (0.0, 1.0))
    if z_min > z_max:
        reader.fail("z", f"z: the smallest value {z_min:g} is above the largest {z_max:g}")
    # A corner may repeat the one before, the last one the first.
    points = tuple(point for i, point in enumerate(corners) if point != corners[i - 1])
    if len(points) < 3 or signed_area(convex_hull(points)) == 0:
        reader.remark("points", "a block without an area is ignored")
        return None
    if not is_simple(points):
        reader.remark("", "this block's outline crosses itself: its convex hull is taken")
        points = convex_hull(points)
    return Block(points, z_min, z_max)
