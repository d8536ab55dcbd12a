"""Map files as map_server reads and writes them: YAML beside a picture (pgm or png).

The rules are those of nav2_map_server (map_io.cpp): modes trinary, scale and raw, thresholds, `negate`, and an origin
with a yaw. Pictures have their uppermost row first, maps have it last.
"""

import math
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.planning.grid import FREE, OCCUPIED, UNKNOWN, GridMap, make_map

Mode = Literal["trinary", "scale", "raw"]

MAX_PIXELS = 64_000_000
_FORMATS = {".pgm": "PPM", ".png": "PNG"}
_UNKNOWN_SHADE = 205
"""Written for unknown cells: 1 − 205 / 255 lies between the thresholds 0.196 and 0.65, the first ones of map_server."""


class MapFile(NamedTuple):
    """What the YAML file says."""

    image: Path
    resolution: float
    origin: Pose2
    mode: Mode = "trinary"
    occupied_thresh: float = 0.65
    free_thresh: float = 0.25
    negate: bool = False


def read_map(path: Path | str) -> GridMap:
    """The map of a YAML file. Raises UsageError, which names file and key, for whatever is wrong."""
    path = Path(path)
    described = read_map_file(path)
    pixels = _read_pixels(described.image)
    return make_map(interpret(pixels, described), described.resolution, described.origin)


def read_map_file(path: Path) -> MapFile:
    """What a YAML file says. Raises UsageError."""
    import yaml

    try:
        table = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"cannot read the map {path}: {error.strerror}") from None
    except (yaml.YAMLError, ValueError) as error:
        raise UsageError(f"{path} is no YAML file: {' '.join(str(error).split())}") from None
    if not isinstance(table, Mapping):
        raise UsageError(f"{path} is no map: it needs the keys image, resolution and origin")
    try:
        return _check(table, path.parent)
    except ValueError as error:
        raise UsageError(f"{path}: {error}") from None


def _check(table: Mapping[str, Any], folder: Path) -> MapFile:
    image, origin = table.get("image"), table.get("origin")
    if not isinstance(image, str) or not image:
        raise ValueError("image: give the name of a pgm or png file")
    if not isinstance(origin, list) or len(origin) != 3:
        raise ValueError("origin: give [x, y, yaw], in metres and radians")
    mode = table.get("mode", "trinary")
    if mode not in get_args(Mode):
        raise ValueError(f"mode: {mode!r} is none of {', '.join(get_args(Mode))}")
    found = MapFile(
        image=folder / image,
        resolution=_number(table, "resolution", None),
        origin=Pose2(*(_finite(part, "origin") for part in origin)),
        mode=mode,
        occupied_thresh=_number(table, "occupied_thresh", 0.65),
        free_thresh=_number(table, "free_thresh", 0.25),
        negate=_truth(table.get("negate", 0)),
    )
    if found.resolution <= 0.0:
        raise ValueError("resolution: give the metres of a cell, above 0")
    if not 0.0 <= found.free_thresh < found.occupied_thresh <= 1.0:
        raise ValueError("free_thresh, occupied_thresh: give two shares from 0 to 1, the first one below the other")
    return found


def _number(table: Mapping[str, Any], key: str, default: float | None) -> float:
    if key not in table and default is None:
        raise ValueError(f"{key} is missing")
    return _finite(table.get(key, default), key)


def _finite(value: Any, key: str) -> float:
    # YAML 1.1 reads 1e-2 as a text.
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{key}: {value!r} is no number") from None
    if isinstance(value, bool) or not math.isfinite(number):
        raise ValueError(f"{key}: {value!r} is no finite number")
    return number


def _truth(value: Any) -> bool:
    if value not in (0, 1):
        raise ValueError(f"negate: {value!r} is neither 0 nor 1")
    return bool(value)


def _read_pixels(path: Path) -> NDArray[Any]:
    """(rows, columns, channels) from 0 to 255, the uppermost row first: grey or colours, with or without alpha."""
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path, formats=tuple(_FORMATS.values())) as picture:
                if picture.width * picture.height > MAX_PIXELS:
                    raise UsageError(f"the map's image {path} has more than {MAX_PIXELS} pixels")
                if picture.mode.startswith("I"):  # 16 bits a pixel
                    return np.asarray(picture, np.float64)[:, :, None] / 257.0
                alpha = "A" in picture.mode or "transparency" in picture.info
                grey = picture.mode in ("1", "L", "LA")
                picture = picture.convert(("LA" if grey else "RGBA") if alpha else "L" if grey else "RGB")  # type: ignore[assignment]
                pixels = np.asarray(picture)
    except UsageError:
        raise
    except FileNotFoundError:
        raise UsageError(f"there is no {path}, the map's image") from None
    except Exception as error:  # decoders raise all kinds of exceptions on a broken file
        raise UsageError(f"cannot read the map's image {path}: {error!s:.200}") from None
    return pixels if pixels.ndim == 3 else pixels[:, :, None]


def interpret(pixels: NDArray[Any], file: MapFile) -> NDArray[np.int8]:
    """Cells (rows, columns) of a picture (rows, columns, channels), 0 to 255, as `file` says; its last row first."""
    channels = pixels[::-1].astype(np.float64) / 255.0
    count = channels.shape[2]
    has_alpha = count in (2, 4)
    alpha = channels[:, :, -1]
    colours = channels[:, :, :-1] if has_alpha else channels
    shade = colours.mean(axis=2)
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
    file = _file_of(grid, image, mode)
    try:
        _picture(grid, file).save(image, format=_FORMATS[suffix])
        path.write_text(_text_of(file), encoding="utf-8")
    except OSError as error:
        raise UsageError(f"cannot write the map {path}: {error.strerror}") from None
    return [path, image]


def _file_of(grid: GridMap, image: Path, mode: Mode) -> MapFile:
    # Thresholds that let every value come back.
    free, occupied = (0.0, 1.0) if mode == "scale" else (0.196, 0.65)
    return MapFile(image, grid.frame.resolution, grid.frame.origin, mode, occupied, free)


def _text_of(file: MapFile) -> str:
    origin = ", ".join(repr(float(part)) for part in file.origin)
    return (
        f"image: {file.image.name}\nmode: {file.mode}\nresolution: {file.resolution!r}\norigin: [{origin}]\n"
        f"negate: 0\noccupied_thresh: {file.occupied_thresh!r}\nfree_thresh: {file.free_thresh!r}\n"
    )


def _picture(grid: GridMap, file: MapFile) -> Any:
    from PIL import Image

    cells = grid.cells[::-1].astype(np.int16)
    unknown = cells < 0
    if file.mode == "raw":
        return Image.fromarray(np.where(unknown, 255, cells).astype(np.uint8))
    if file.mode == "scale":
        grey = np.where(unknown, 0, np.rint((100 - cells) * 2.55))
        return Image.fromarray(np.stack((grey, np.where(unknown, 0, 255)), axis=2).astype(np.uint8), mode=None)
    grey = np.where(cells <= 100.0 * file.free_thresh, 254, _UNKNOWN_SHADE)
    grey = np.where(cells >= 100.0 * file.occupied_thresh, 0, grey)
    return Image.fromarray(np.where(unknown, _UNKNOWN_SHADE, grey).astype(np.uint8))
