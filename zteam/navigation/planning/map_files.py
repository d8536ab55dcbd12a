"""Map files as map_server reads and writes them: YAML beside a picture (pgm or png).

The rules are those of nav2_map_server (map_io.cpp): modes trinary, scale and raw, thresholds, `negate`, and an origin
with a yaw. Pictures have their uppermost row first, maps have it last.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from zteam.config.map_files import MapFile, Mode, read_channels, read_map_file
from zteam.errors import UsageError
from zteam.navigation.planning.grid import FREE, OCCUPIED, UNKNOWN, GridMap, make_map

_FORMATS = {".pgm": "PPM", ".png": "PNG"}
_UNKNOWN_SHADE = 205
"""Written for unknown cells: 1 − 205 / 255 lies between the thresholds 0.196 and 0.65, the first ones of map_server."""


def read_map(path: Path | str) -> GridMap:
    """The map of a YAML file. Raises UsageError, which names file and key, for whatever is wrong."""
    file, path = check_map_file(Path(path)), Path(path)
    pixels = read_channels(path.parent / file.image, alpha=True)
    return make_map(interpret(pixels, file), file.resolution, file.origin)


def check_map_file(path: Path) -> MapFile:
    """What the YAML file of a map says. Raises UsageError, also for thresholds that do not fit or a missing picture."""
    file = read_map_file(path)
    image = path.parent / file.image
    if not image.is_file():
        raise UsageError(f"there is no {image}, the map's image")
    if not 0.0 <= file.free_thresh < file.occupied_thresh <= 1.0:
        keys = f"{path}: free_thresh, occupied_thresh"
        raise UsageError(f"{keys}: give two shares from 0 to 1, the first one below the other")
    return file


def interpret(pixels: NDArray[Any], file: MapFile) -> NDArray[np.int8]:
    """Cells (rows, columns) of a picture (rows, columns, channels), 0 to 255, as `file` says; its last row first."""
    channels = pixels[::-1].astype(np.float64) / 255.0
    has_alpha, alpha = channels.shape[2] in (2, 4), channels[:, :, -1]
    shade = (channels[:, :, :-1] if has_alpha else channels).mean(axis=2)
    if file.mode == "trinary" and has_alpha:
        # map_server takes the mean of red, green, blue and alpha, for the sake of old maps.
        shade = (3.0 * shade + alpha) / 4.0
    if file.mode == "raw":
        value = np.rint(shade * 255.0)
        return np.where(value <= OCCUPIED, value, UNKNOWN).astype(np.int8)
    occupancy = shade if file.negate else 1.0 - shade
    between: Any = UNKNOWN
    if file.mode == "scale":
        between = np.rint((occupancy - file.free_thresh) / (file.occupied_thresh - file.free_thresh) * 100.0)
    cells = np.where(occupancy < file.free_thresh, FREE, between)
    cells = np.where(occupancy > file.occupied_thresh, OCCUPIED, cells)
    if file.mode == "scale" and has_alpha:
        cells = np.where(alpha < 1.0, UNKNOWN, cells)
    return cells.astype(np.int8)


def write_map(grid: GridMap, path: Path | str, *, mode: Mode = "trinary", suffix: str | None = None) -> list[Path]:
    """Write a map as `path` (its YAML file) and a picture beside it; return both.

    The picture is a pgm, or a png in mode `scale`, whose unknown cells are transparent; `suffix` chooses another one.
    `read_map` gives the same map again, but trinary keeps only free, occupied and unknown. Raises UsageError.
    """
    path = Path(path)
    suffix = suffix or (".png" if mode == "scale" else ".pgm")
    if suffix not in _FORMATS or path.suffix not in (".yaml", ".yml"):
        raise UsageError(f"a map is a file .yaml with a picture .pgm or .png, not {path.name} with {suffix}")
    if mode == "scale" and suffix != ".png":
        raise UsageError("mode scale marks unknown cells by transparency: it needs a .png")
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
