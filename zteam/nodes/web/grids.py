"""Occupancy grids as tiles for the page, and whether a place in one is free."""

import hashlib
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from zteam.geometry import Pose2
from zteam.messages import Message, OccupancyGrid
from zteam.nodes.web import frames
from zteam.nodes.web.places import decoded, pose2_of


class Tile(NamedTuple):
    """A piece of a grid, ready to be sent."""

    place: tuple[int, int, int, int]
    """Column, row, width, height in cells."""
    version: bytes
    """Another one for other cells."""
    block: bytes


def make_tiles(key: str, grid: OccupancyGrid, number: int, map_from_frame: Pose2, before: Sequence[Tile]) -> list[Tile]:
    """The tiles of a grid; those of `before` whose cells are the same are kept. `number` is that of its message."""
    info = grid.info
    if info.width * info.height != grid.data.size:
        return []
    cells = grid.data.reshape(info.height, info.width)
    origin = map_from_frame.compose(pose2_of(info.origin))
    meta = {
        "key": key, "width": info.width, "height": info.height, "resolution": info.resolution,
        "x": origin.x, "y": origin.y, "yaw": origin.yaw,
    }  # fmt: skip
    place_of_all = repr(meta).encode()
    kept = {tile.place: tile for tile in before}
    made = []
    for place in frames.tiles_of(info.width, info.height):
        column, row, width, height = place
        part = np.ascontiguousarray(cells[row : row + height, column : column + width])
        version = hashlib.blake2b(part.tobytes() + place_of_all, digest_size=8).digest()
        old = kept.get(place)
        if old is None or old.version != version:
            old = Tile(place, version, frames.encode_tile({**meta, "tile": place, "version": number}, part))
        made.append(old)
    return made


def room_in(content: bytes | Message, radius: float) -> Callable[[float, float], bool]:
    """Whether all cells within `radius` (m) of a place in the grid are known to be free."""
    grid = decoded(OccupancyGrid, content)
    if grid is None or grid.info.resolution <= 0.0 or grid.info.width * grid.info.height != grid.data.size:
        return lambda _x, _y: True
    info = grid.info
    cells = grid.data.reshape(info.height, info.width)
    grid_from_map = pose2_of(info.origin).inverse()
    reach = math.ceil(radius / info.resolution)

    def is_free(x: float, y: float) -> bool:
        place = grid_from_map.compose(Pose2(x, y, 0.0))
        column, row = math.floor(place.x / info.resolution), math.floor(place.y / info.resolution)
        if not (0 <= column < info.width and 0 <= row < info.height):
            return False
        near = cells[max(0, row - reach) : row + reach + 1, max(0, column - reach) : column + reach + 1]
        return bool((near == 0).all())

    return is_free
