"""ROS map_server's YAML files as floor plans: image, resolution, origin and thresholds."""

import reprlib
from pathlib import Path
from typing import Any, NamedTuple

from zteam.errors import WorldError
from zteam.geometry import Pose2
from zteam.world.bitmap import Grid, read_levels
from zteam.world.properties import MAX_LENGTH

SUFFIXES = (".yaml", ".yml")
MAX_BYTES = 65_536
MAX_RESOLUTION = 100.0
_MODES = ("trinary", "scale", "raw")


class FloorMap(NamedTuple):
    """A map that map_server would publish. Its unknown cells are free here."""

    occupied: Grid
    """(rows, columns), row 0 at the bottom."""
    resolution: float
    """Metres a cell."""
    map_from_corner: Pose2
    """Of the lower left corner of cell [0, 0]."""

    @property
    def width(self) -> float:
        """Metres along the columns."""
        return float(self.occupied.shape[1] * self.resolution)

    @property
    def height(self) -> float:
        """Metres along the rows."""
        return float(self.occupied.shape[0] * self.resolution)

    @property
    def map_from_middle(self) -> Pose2:
        """Pose of the middle of the map, which is a model's origin."""
        return self.map_from_corner.compose(Pose2(self.width / 2, self.height / 2, 0.0))


def is_floor_map(path: Path) -> bool:
    """Whether a file's name says that it is such a YAML."""
    return path.suffix.lower() in SUFFIXES


def read_floor_map(path: Path) -> FloorMap:
    """The map that a YAML file describes; its image is beside it. Raises WorldError that names file and key.

    A pixel of level v (mean of its colours, 0 to 255) is occupied above `occupied_thresh` by (255 - v) / 255, or
    v / 255 with `negate`; in mode `raw` v itself is the occupancy in percent. So do map_server and nav2.
    """
    fields = _read_fields(path)
    image = fields.get("image")
    if not isinstance(image, str) or not image:
        raise WorldError(f"{path}: image: the name of the map's image is missing")
    resolution = _number(path, fields, "resolution", None)
    if not 0 < resolution <= MAX_RESOLUTION:
        raise WorldError(f"{path}: resolution: must be above 0 and at most {MAX_RESOLUTION:g} m, not {resolution:g}")
    threshold = _number(path, fields, "occupied_thresh", 0.65)
    mode = fields.get("mode", "trinary")
    if mode not in _MODES:
        raise WorldError(f"{path}: mode: must be one of {', '.join(_MODES)}, not {_shown(mode)}")
    levels = read_levels(path.parent / image)
    if mode == "raw":
        occupied = levels > 100.0 * threshold
    else:
        dark = levels if _number(path, fields, "negate", 0) else 255.0 - levels
        occupied = dark > 255.0 * threshold
    found = FloorMap(occupied, resolution, _origin(path, fields))
    if max(found.width, found.height) > MAX_LENGTH:
        raise WorldError(f"{path}: resolution: {resolution:g} m makes a map larger than {MAX_LENGTH:g} m")
    return found


def _read_fields(path: Path) -> dict[str, Any]:
    import yaml  # imported only for such a map

    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise WorldError(f"{path}: cannot read this map: {error.strerror or error}") from None
    if len(data) > MAX_BYTES:
        raise WorldError(f"{path}: a map file of more than {MAX_BYTES} bytes is refused")
    try:
        fields = yaml.safe_load(data)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise WorldError(f"{path}: not a map_server YAML file: {reason:.200}") from None
    if not isinstance(fields, dict):
        raise WorldError(f"{path}: not a map_server YAML file: it needs image, resolution and origin")
    return fields


def _number(path: Path, fields: dict[str, Any], key: str, default: float | None) -> float:
    value = fields.get(key, default)
    # At most the largest length; this also excludes whole numbers of a thousand digits.
    if isinstance(value, (int, float)) and abs(value) <= MAX_LENGTH:
        return float(value)
    raise WorldError(f"{path}: {key}: {'is missing' if value is None else f'{_shown(value)} is not a number here'}")


def _shown(value: object) -> str:
    """A value in an error text. Aliases make short files with a full text that would fill the memory."""
    return reprlib.repr(value)[:60]


def _origin(path: Path, fields: dict[str, Any]) -> Pose2:
    values = fields.get("origin", [0.0, 0.0, 0.0])
    if not isinstance(values, list) or len(values) != 3:
        raise WorldError(f"{path}: origin: must be [x, y, yaw], not {_shown(values)}")
    x, y, yaw = (_number(path, {"origin": value}, "origin", None) for value in values)
    return Pose2(x, y, yaw)
