"""Maps as files of map_server, YAML beside a picture (pgm or png), and as messages."""

from pathlib import Path
from typing import Any

import numpy as np

from zteam import names
from zteam.config.map_files import FREE, OCCUPIED, UNKNOWN, Mode, read_floor_map
from zteam.errors import UsageError
from zteam.messages import Header, MapMetaData, OccupancyGrid, Time
from zteam.messages.planar import planar, pose_message
from zteam.navigation.planning.grid import GridMap, make_map

_FORMATS = {".pgm": "PPM", ".png": "PNG"}
_UNKNOWN_SHADE = 205
"""Written for unknown cells: 1 − 205 / 255 lies between the thresholds 0.196 and 0.65, the first ones of map_server."""
_RESOLUTIONS = 1e-4, 1e3
"""Metres a cell, the least and the most."""


def read_map(path: Path | str) -> GridMap:
    """The map of a YAML file. Raises UsageError, which names file and key, for whatever is wrong."""
    found = read_floor_map(Path(path))
    return make_map(found.cells, found.resolution, found.map_from_corner)


def write_map(grid: GridMap, path: Path | str, *, mode: Mode = "trinary", suffix: str | None = None) -> list[Path]:
    """Write a map as `path` (its YAML file) and a picture beside it; return both.

    The picture is a pgm, or a png in mode `scale`, whose unknown cells are transparent; `suffix` chooses another one.
    `read_map` gives the same map again, but trinary keeps only free, occupied and unknown. Raises UsageError.
    """
    path = Path(path)
    suffix = suffix or (".png" if mode == "scale" else ".pgm")
    if suffix not in _FORMATS or path.suffix not in (".yaml", ".yml") or (mode == "scale" and suffix != ".png"):
        kinds = "a picture .pgm or .png (in mode scale .png, for unknown cells are transparent)"
        raise UsageError(f"a map is a file .yaml with {kinds}, not {path.name} with {suffix}")
    image = path.with_suffix(suffix)
    # Thresholds that let every value come back.
    free, occupied = (0.0, 1.0) if mode == "scale" else (0.196, 0.65)
    origin = ", ".join(repr(float(part)) for part in grid.frame.origin)
    try:
        _picture(grid, mode, free, occupied).save(image, format=_FORMATS[suffix])
        path.write_text(
            f"image: {image.name}\nmode: {mode}\nresolution: {grid.frame.resolution!r}\norigin: [{origin}]\n"
            f"negate: 0\noccupied_thresh: {occupied!r}\nfree_thresh: {free!r}\n",
            encoding="utf-8",
        )
    except OSError as error:
        raise UsageError(f"cannot write the map {path}: {error.strerror}") from None
    return [path, image]


def _picture(grid: GridMap, mode: Mode, free: float, occupied: float) -> Any:
    from PIL import Image

    cells = grid.cells[::-1].astype(np.int16)
    unknown = cells < 0
    if mode == "raw":
        return Image.fromarray(np.where(unknown, 255, cells).astype(np.uint8))
    if mode == "scale":
        grey = np.where(unknown, 0, np.rint((100 - cells) * 2.55))
        return Image.fromarray(np.stack((grey, np.where(unknown, 0, 255)), axis=2).astype(np.uint8), mode=None)
    grey = np.where(cells <= 100.0 * free, 254, _UNKNOWN_SHADE)
    grey = np.where(cells >= 100.0 * occupied, 0, grey)
    return Image.fromarray(np.where(unknown, _UNKNOWN_SHADE, grey).astype(np.uint8))


def to_three_values(grid: GridMap, free: float, occupied: float) -> GridMap:
    """The map with cells that are free up to one share, occupied from another on, or unknown, as map_saver has it."""
    cells = np.where(grid.cells >= 100.0 * occupied, OCCUPIED, UNKNOWN)
    cells = np.where((grid.cells >= 0) & (grid.cells <= 100.0 * free), FREE, cells)
    return make_map(cells.astype(np.int8), grid.frame.resolution, grid.frame.origin)


def map_message(grid: GridMap, stamp: Time | None = None) -> OccupancyGrid:
    """A grid in the frame `map`; a map has the stamp 0, for it holds at all times."""
    frame, stamp = grid.frame, stamp or Time()
    info = MapMetaData(stamp, frame.resolution, frame.columns, frame.rows, pose_message(frame.origin))
    return OccupancyGrid(Header(stamp, names.MAP_FRAME), info, grid.cells.ravel())


def map_grid(message: OccupancyGrid, *, any_frame: bool = False) -> GridMap:
    """The grid of a map that came on the bus. Raises UsageError if its numbers do not fit each other, and unless
    `any_frame` for a frame other than `map`."""
    info, origin = message.info, planar(message.info.origin)
    frame = names.strip_slash(message.header.frame_id) or names.MAP_FRAME
    if frame != names.MAP_FRAME and not any_frame:
        raise UsageError(f"it is in the frame {frame!r:.60}: publish it in {names.MAP_FRAME!r}")
    # A resolution travels as a 32-bit number: 0.05 would come back as 0.05000000074505806.
    resolution = float(str(np.float32(info.resolution)))
    if not message.data.size == info.width * info.height > 0:
        raise UsageError(f"the map has {message.data.size} values for {info.width} x {info.height} cells")
    if origin is None:
        raise UsageError("the origin of the map is not finite, too far away, or no pose in the plane")
    if not _RESOLUTIONS[0] <= resolution <= _RESOLUTIONS[1]:
        raise UsageError("the map has a resolution of {:g} m, not {:g} to {:g} m".format(resolution, *_RESOLUTIONS))
    return make_map(np.array(message.data, np.int8).reshape(info.height, info.width), resolution, origin)
