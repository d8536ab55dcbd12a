"""Devices other than rangers: fiducial finders, bumpers and blob finders, with Stage's defaults."""

import math
from typing import NamedTuple

from zteam.geometry import Pose2, compose2
from zteam.world.model import Blobfinder, Bumper, Finder
from zteam.world.properties import Reader

MAX_BUMPERS = 256
MAX_PIXELS = 10_000


class Seat(NamedTuple):
    """Where a device stands."""

    base_from_device: Pose2
    z: float
    """Of the device's foot, above the ground."""


def read_finder(reader: Reader, name: str, seat: Seat) -> Finder:
    """A `fiducial` model; raises WorldError."""
    low, high = reader.length("range_min", 0.0), reader.length("range_max", 8.0)
    if not 0 <= low < high:
        reader.fail("range_max", f"range_min {low:g} and range_max {high:g} must be two distances, the second larger")
    x, y, yaw = seat.base_from_device
    return Finder(
        name=name,
        x=x,
        y=y,
        z=seat.z,
        yaw=yaw,
        fov=_read_fov(reader, math.pi),
        range_min=low,
        range_max=high,
        range_max_id=reader.length("range_max_id", 5.0),
        key=reader.whole("fiducial_key", 0, -(2**31), 2**31 - 1),
        ignore_zloc=reader.flag("ignore_zloc", False),
    )


def read_bumpers(reader: Reader, name: str, seat: Seat) -> list[Bumper]:
    """The pieces of a `bumper` model: `bcount`, `bpose[i] [x y z yaw]`, `blength` of all or `blength[i]`."""
    common = reader.length("blength", 0.1)
    found = []
    for i in range(reader.whole("bcount", 0, 0, MAX_BUMPERS)):
        if not reader.has(f"bpose[{i}]"):
            reader.remark("bcount", f"this bumper lacks bpose[{i}]: [0 0 0 0] is taken, as Stage does")
        pose = reader.pose(f"bpose[{i}]")
        length = reader.length(f"blength[{i}]", common)
        if not length > 0:
            name_of_length = f"blength[{i}]" if reader.has(f"blength[{i}]") else "blength"
            reader.remark(name_of_length, f"piece {i} of this bumper has no length: it is left out")
            continue
        x, y, yaw = compose2(seat.base_from_device, pose.planar)
        found.append(Bumper(f"{name}.{i}", x, y, seat.z + pose.z, yaw, length))
    return found


def read_blobfinder(reader: Reader, name: str, seat: Seat) -> Blobfinder:
    """A `blobfinder` model; of its image only the width counts. Raises WorldError."""
    count = reader.whole("colors_count", 0, 0, 256)
    listed = reader.texts("colors") or tuple(
        reader.text(f"colors[{i}]", "") for i in range(count) if reader.has(f"colors[{i}]")
    )
    width = reader.numbers("image", "nn", (80.0, 60.0))[0]
    if not (width == round(width) and 1 <= width <= MAX_PIXELS):
        reader.fail("image", f"the width of an image must be a whole number of 1 to {MAX_PIXELS}, not {width:g}")
    high = reader.length("range", 12.0)
    if not high > 0:
        reader.fail("range", f"range must be above 0, not {high:g}")
    x, y, yaw = seat.base_from_device
    return Blobfinder(
        name=name,
        x=x,
        y=y,
        z=seat.z,
        yaw=yaw + reader.angle("pan", 0.0),
        fov=_read_fov(reader, math.radians(60.0)),
        samples=int(width),
        range_max=high,
        colors=listed,
    )


def _read_fov(reader: Reader, default: float) -> float:
    fov = reader.angle("fov", default)
    if not 0 < fov <= math.tau + 1e-9:
        reader.fail("fov", f"fov must be an angle above 0 and up to 360 degrees, not {math.degrees(fov):g}")
    return fov
