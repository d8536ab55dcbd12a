"""Pictures, and ROS map_server's YAML files (image, resolution, origin and thresholds)."""

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from zteam.config.problems import KeyValueError, problems_of
from zteam.config.resources import read_file
from zteam.errors import WorldError
from zteam.geometry import FAR, Point2, Pose2

if TYPE_CHECKING:
    from PIL.Image import Image as Picture

MAX_PIXELS = 64_000_000
MAX_BYTES = 65_536
MAX_RESOLUTION = 100.0
_FORMATS = ("PPM", "PNG", "BMP", "JPEG", "GIF")
_BYTE_MODES = ("L", "LA", "RGB", "RGBA")

Grid = NDArray[np.bool_]
Mode = Literal["trinary", "scale", "raw"]


def read_channels(path: Path, *, alpha: bool = False) -> NDArray[Any]:
    """(rows, columns, channels), 0 to 255, the uppermost row first: grey or colours; with `alpha` also that, if any.

    Raises WorldError, without a place, on what is not a PGM, PNG, BMP, JPEG or GIF, or has too many pixels.
    """
    from PIL import Image, UnidentifiedImageError  # only a world with a bitmap pays for it

    try:
        with warnings.catch_warnings():
            # Pillow warns at a bound of its own, above ours.
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            # Else a format that the file's name does not tell makes Pillow import all it has, 50 of them.
            Image.preinit()
            with Image.open(path, formats=_FORMATS) as image:
                if image.width * image.height > MAX_PIXELS:
                    raise Image.DecompressionBombError
                return _channels(image, alpha)
    except (Image.DecompressionBombError, Image.DecompressionBombWarning):
        raise WorldError(f"bitmap {path} has more than {MAX_PIXELS} pixels: it is refused") from None
    except UnidentifiedImageError:
        raise WorldError(f"bitmap {path} is not a PGM, PNG, BMP, JPEG or GIF image") from None
    except Exception as error:  # decoders raise all kinds of exceptions on a broken file
        raise WorldError(f"cannot read bitmap {path}: {error!s:.200}") from None


def _channels(image: "Picture", alpha: bool) -> NDArray[Any]:
    if image.mode.startswith("I"):  # 16 bits a sample
        return (np.asarray(image) >> 8)[:, :, None]
    if alpha and image.mode not in _BYTE_MODES and "transparency" in image.info:
        image = image.convert("RGBA")
    values = np.asarray(image if image.mode in _BYTE_MODES else image.convert("RGB"))
    if values.ndim == 2:
        return values[:, :, None]
    return values if alpha else values[:, :, : 1 if image.mode == "LA" else 3]


class MapFile(msgspec.Struct, frozen=True):
    """What a YAML file says. Raises ValueError for an origin that is too far away."""

    image: Annotated[str, msgspec.Meta(min_length=1)]
    """The name of the picture beside it."""
    resolution: Annotated[float, msgspec.Meta(gt=0.0, le=MAX_RESOLUTION)]
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


class FloorMap(NamedTuple):
    """A map that map_server would publish. Its unknown cells are free here."""

    occupied: Grid
    """(rows, columns), row 0 at the bottom."""
    resolution: float
    """Metres a cell."""
    map_from_corner: Pose2
    """Of the lower left corner of cell [0, 0]."""

    @property
    def size(self) -> Point2:
        """Metres along the columns, and along the rows."""
        rows, columns = self.occupied.shape
        return columns * self.resolution, rows * self.resolution

    @property
    def map_from_middle(self) -> Pose2:
        """Pose of the middle of the map, which is a model's origin."""
        return self.map_from_corner.compose(Pose2(self.size[0] / 2, self.size[1] / 2, 0.0))


def is_floor_map(path: Path) -> bool:
    """Whether a file has the suffix of YAML, as map_server's have."""
    return path.suffix.lower() in (".yaml", ".yml")


def read_floor_map(path: Path) -> FloorMap:
    """The map that a YAML file describes; its image is beside it. Raises WorldError that names file and key.

    A pixel of level v (mean of its colours, 0 to 255) is occupied above `occupied_thresh` by (255 - v) / 255, or
    v / 255 with `negate`; in mode `raw` v itself is the occupancy in percent. So do map_server and nav2.
    """
    file = read_map_file(path)
    levels = read_channels(path.parent / file.image)[::-1].mean(axis=2, dtype=np.float32)
    if file.mode == "raw":
        occupied = levels > 100.0 * file.occupied_thresh
    else:
        dark = levels if file.negate else 255.0 - levels
        occupied = dark > 255.0 * file.occupied_thresh
    found = FloorMap(occupied, file.resolution, file.origin)
    if max(found.size) > FAR:
        raise WorldError(f"{path}: resolution: {file.resolution:g} m makes a map larger than {FAR:g} m")
    return found


def read_map_file(path: Path) -> MapFile:
    """What a YAML file says. Raises WorldError that names file and key."""
    import yaml  # few maps need it, and it is slow to import

    try:
        fields = yaml.safe_load(read_file(path, "map", MAX_BYTES, WorldError))
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise WorldError(f"{path}: not a map_server YAML file: {reason:.200}") from None
    if not isinstance(fields, dict):
        raise WorldError(f"{path}: not a map_server YAML file: it needs image, resolution and origin")
    # YAML 1.1 reads 1e-2 as a text, and map_server's `negate` is 0 or 1.
    for problem in problems_of(fields, MapFile, strict=False):
        raise WorldError(f"{path}: {problem}")
    return msgspec.convert(fields, MapFile, strict=False)
