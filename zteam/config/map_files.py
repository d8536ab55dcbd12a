"""Pictures, and maps as ROS map_server has them: a YAML file beside a picture.

The rules are those of nav2_map_server (map_io.cpp): modes, thresholds, `negate`, and an origin with a yaw. Pictures
have their uppermost row first, maps have it last.
"""

import warnings
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam.config.foreign_files import MAP_FILE, YAML_FILE, name_foreign
from zteam.config.problems import KeyValueError, problems_of
from zteam.config.resources import existing_file, load_yaml, note_read, read_yaml
from zteam.errors import WorldError
from zteam.geometry import FAR, Point2, Pose2

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

MAX_PIXELS = 64_000_000
MAX_BYTES = 65_536
MIN_RESOLUTION, MAX_RESOLUTION = 1e-4, 100.0
_FORMATS = ("PPM", "PNG", "BMP", "JPEG", "GIF")
_BYTE_MODES = ("L", "LA", "RGB", "RGBA")

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
"""Values of a map's cells (nav_msgs/OccupancyGrid)."""
Grid = NDArray[np.bool_]
Mode = Literal["trinary", "scale", "raw"]


def read_channels(path: Path) -> NDArray[Any]:
    """(rows, columns, channels), 0 to 255, the uppermost row first: grey or colours, then alpha if the picture has it.

    The values of 16-bit pictures are fractions. Raises WorldError, without a place, for what is no picture of
    `_FORMATS`, or has too many pixels.
    """
    from PIL import Image, UnidentifiedImageError  # only a world with a bitmap pays for it

    note_read(path)

    try:
        with warnings.catch_warnings():
            # Pillow warns at a bound of its own, above ours.
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            # Else a format that the file's name does not tell makes Pillow import all it has, 50 of them.
            Image.preinit()
            with Image.open(path, formats=_FORMATS) as image:
                if image.width * image.height > MAX_PIXELS:
                    raise Image.DecompressionBombError
                return _channels(image)
    except (Image.DecompressionBombError, Image.DecompressionBombWarning):
        raise WorldError(f"bitmap {path} has more than {MAX_PIXELS} pixels: it is refused") from None
    except UnidentifiedImageError:
        raise WorldError(f"cannot read bitmap {path}: it is no PNG, PGM, BMP, JPEG or GIF; save it as a PNG") from None
    except Exception as error:  # decoders raise all kinds of exceptions on a broken file
        told = getattr(error, "strerror", None) or error
        raise WorldError(f"cannot read bitmap {path}: {told!s:.200}") from None


def _channels(image: "Picture") -> NDArray[Any]:
    if image.mode.startswith("I"):  # 16 bits a sample
        return (np.asarray(image) / 257.0)[:, :, None]
    if image.mode not in ("LA", "RGBA") and image.has_transparency_data:
        image = image.convert("RGBA")
    values = np.asarray(image if image.mode in _BYTE_MODES else image.convert("RGB"))
    return values[:, :, None] if values.ndim == 2 else values


class MapFile(msgspec.Struct, frozen=True):
    """What a YAML file says. Raises KeyValueError for an origin too far away, and thresholds that do not fit."""

    image: Annotated[str, msgspec.Meta(min_length=1)]
    """The name of the picture beside it."""
    resolution: Annotated[float, msgspec.Meta(ge=MIN_RESOLUTION, le=MAX_RESOLUTION)]
    """Metres a cell."""
    origin: Pose2 = Pose2(0.0, 0.0, 0.0)
    """In `map`, of the lower left corner of the first cell."""
    mode: Mode = "trinary"
    occupied_thresh: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.65
    free_thresh: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.25
    negate: bool = False

    def __post_init__(self) -> None:
        if not all(abs(part) <= FAR for part in self.origin):
            raise KeyValueError("origin", f"x, y and yaw are numbers up to {FAR:g}")
        if self.free_thresh >= self.occupied_thresh:
            raise KeyValueError("free_thresh", f"it is below occupied_thresh ({self.occupied_thresh:g})")


class FloorMap(NamedTuple):
    """A map that map_server would publish."""

    cells: NDArray[np.int8]
    """(rows, columns): 0 free to 100 occupied, -1 unknown; row 0 at the bottom."""
    occupied: Grid
    """(rows, columns): walls; unknown cells are none."""
    resolution: float
    """Metres a cell."""
    map_from_corner: Pose2
    """Of the lower left corner of cell [0, 0]."""

    @property
    def size(self) -> Point2:
        """Metres along the columns, and along the rows."""
        rows, columns = self.cells.shape
        return columns * self.resolution, rows * self.resolution


def is_floor_map(path: Path) -> bool:
    """Whether a file has the suffix of YAML, as map_server's have."""
    return path.suffix.lower() in (".yaml", ".yml")


def read_floor_map(path: Path) -> FloorMap:
    """The map that a YAML file describes. Raises WorldError that names file and key."""
    file = read_map_file(path)
    cells = interpret(read_channels(path.parent / file.image), file)
    # A raw picture has the occupancy in percent.
    occupied = cells > 100.0 * file.occupied_thresh if file.mode == "raw" else cells == OCCUPIED
    found = FloorMap(cells, occupied, file.resolution, file.origin)
    if max(found.size) > FAR:
        raise WorldError(f"{path}: resolution: {file.resolution:g} m makes a map larger than {FAR:g} m")
    return found


def read_map_file(path: Path) -> MapFile:
    """What a YAML file says. Raises WorldError that names file and key, also for a picture that is not there."""
    what, read = "map of map_server", partial(load_yaml, aliases=10)
    with name_foreign(path, what, MAP_FILE, YAML_FILE):
        fields = read_yaml(path, what, MAX_BYTES, WorldError, read)
        if isinstance(fields, dict):
            # YAML 1.1 reads `on` and 1 as other keys than texts.
            fields = {key: value for key, value in fields.items() if isinstance(key, str)}
            if isinstance(mode := fields.get("mode"), str):
                fields["mode"] = mode.lower()
        # map_server's `negate` is 0 or 1.
        for problem in problems_of(fields, MapFile, strict=False):
            raise WorldError(f"{path}: {problem}")
    file = msgspec.convert(fields, MapFile, strict=False)
    if existing_file(image := path.parent / file.image) is None:
        raise WorldError(f"{path}: image: there is no {image}")
    return file


def interpret(pixels: NDArray[Any], file: MapFile) -> NDArray[np.int8]:
    """Cells (rows, columns) of a picture (rows, columns, channels), 0 to 255, as `file` says; its last row first."""
    has_alpha, alpha = pixels.shape[2] in (2, 4), pixels[::-1, :, -1]
    shade = (pixels[::-1, :, :-1] if has_alpha else pixels[::-1]).mean(axis=2)
    if file.mode == "raw":
        percent = np.rint(shade)
        return np.where(percent <= OCCUPIED, percent, UNKNOWN).astype(np.int8)
    if file.mode == "trinary" and has_alpha:
        # map_server takes the mean of red, green, blue and alpha, for the sake of old maps.
        shade = (3.0 * shade + alpha) / 4.0
    occupancy = (shade if file.negate else 255.0 - shade) / 255.0
    between: Any = UNKNOWN
    if file.mode == "scale":
        between = np.rint((occupancy - file.free_thresh) / (file.occupied_thresh - file.free_thresh) * 100.0)
    is_hidden = (alpha < 255) & (file.mode == "scale" and has_alpha)
    rules = [is_hidden, occupancy > file.occupied_thresh, occupancy < file.free_thresh]
    return np.select(rules, [UNKNOWN, OCCUPIED, FREE], between).astype(np.int8)
