"""Sensors of robots: their places in world files (`MODELS`); their keys, messages and frames (`KINDS`).

The types of their messages are in `zteam.messages.topics`. `PREPARE` in `zteam.simulator.core.devices` says how they
sense, `BUILDERS` in `zteam.simulator.core.to_messages` what builds their messages. The defaults are Stage's.
"""

import math
from collections.abc import Callable, Sequence, Set
from functools import lru_cache
from typing import Any, Literal, NamedTuple

from zteam import names
from zteam.geometry import Point2
from zteam.messages import Message
from zteam.messages.topics import SENSORS
from zteam.simulator.world.model import Device, Ranger, Robot
from zteam.simulator.world.properties import Pose3, Reader, Size3

MAX_PIXELS = 10_000
SENSOR_SIZE = Size3(0.02, 0.02, 0.02)
"""Stage's default; half its height lies between the sensor's foot and its rays."""


def read_rangers(reader: Reader, name: str, seat: Pose3) -> list[Ranger]:
    """The sensors of a `ranger`, or the one of an old `laser`; raises WorldError."""
    sensors = [reader.of(child) for child in reader.entity.children if child.type == "sensor"]
    if not sensors and reader.entity.type == "laser":
        # As worlds for Stage 3 have it the properties stand in the model itself. The defaults are those of a SICK LMS.
        limits = reader.number("range_min", 0.0, "l"), reader.number("range_max", 8.0, "l")
        return _read_sensor(reader, name, seat, limits, math.pi, 180)
    if not sensors:
        reader.remark("", "this ranger has no sensor( )")
    found: list[Ranger] = []
    for i, own in enumerate(sensors):
        own.remark_unused("sensor")
        pose = own.pose("pose")
        x, y, yaw = seat.planar.compose(pose.planar)
        found += _read_sensor(own, name if len(sensors) == 1 else f"{name}.{i}", Pose3(x, y, seat.z + pose.z, yaw))
    return found


def _read_sensor(
    reader: Reader, name: str, foot: Pose3, limits: Point2 = (0.0, 5.0), fov: float = 0.1, samples: int = 1
) -> list[Ranger]:
    """The sensor that stands at `foot` in the base frame, its z above the ground; none if it has no rays. `limits` (of
    the range), `fov` and `samples` are defaults. The rays start half-way up."""
    range_name = "range" if reader.has("range") else "range_max"
    low, high = reader.numbers("range", "ll", limits)
    if not high > 0:
        reader.fail(range_name, f"the largest range must be above 0, not {high:g}")
    if not 0 <= low <= high:
        text = f"the smallest range {low:g} is not of 0 to {high:g}: 0 is taken, Stage never applies it"
        reader.remark(range_name, text)
        low = 0.0
    pose = foot._replace(z=foot.z + reader.size(SENSOR_SIZE).z / 2)
    fov = reader.number("fov", fov, "a")
    samples = reader.whole("samples", samples, 0, 100_000)
    if samples == 0:
        reader.remark("samples", "a sensor without rays is left out")
        return []
    if not 0 <= fov <= math.tau + 1e-9:
        reader.fail("fov", f"fov must be an angle of 0 to 360 degrees, not {math.degrees(fov):g}")
    if samples > 1 and fov == 0:
        reader.remark("fov", f"all {samples} rays of a fov of 0 are one: one is taken")
        samples = 1
    variance, proportional, angular = reader.shares("noise", 3)
    return [Ranger(name, *pose, fov, samples, low, high, (variance, proportional, angular))]


class Finder(Device, frozen=True):
    """A fiducial finder: bearing and range of markers in sight."""

    fov: float
    range_min: float
    range_max: float
    range_max_id: float
    """Beyond this the marker is found, but its id is read as 0."""
    key: int = 0
    ignore_zloc: bool = False
    """Find markers that the ray at `z` would look over."""


class BumperPiece(Device, frozen=True):
    """A straight piece of bumper about its centre; `yaw` faces outward."""

    length: float


class Blobfinder(Device, frozen=True):
    """A colour camera of one row of pixels."""

    fov: float
    samples: int
    """Pixels: the image's width."""
    range_max: float
    colors: tuple[str, ...] = ()
    """What it looks for; empty means every colour."""


def read_finder(reader: Reader, name: str, seat: Pose3) -> list[Finder]:
    low, high = reader.number("range_min", 0.0, "l"), reader.number("range_max", 8.0, "l")
    if not 0 <= low < high:
        reader.fail("range_max", f"range_min {low:g} and range_max {high:g} must be two distances, the second larger")
    fov, range_max_id = _read_fov(reader, math.pi), reader.number("range_max_id", 5.0, "l")
    key, ignore_zloc = reader.whole("fiducial_key", 0), reader.flag("ignore_zloc", False)
    return [Finder(name, *seat, fov, low, high, range_max_id, key, ignore_zloc)]


def read_bumpers(reader: Reader, name: str, seat: Pose3) -> list[BumperPiece]:
    """The pieces of a `bumper` model: `bcount`, `bpose[i] [x y z yaw]`, `blength` of all or `blength[i]`."""
    common = reader.number("blength", 0.1, "l")
    found = []
    for i in range(reader.whole("bcount", 0, 0, 256)):
        if not reader.has(f"bpose[{i}]"):
            reader.remark("bcount", f"this bumper lacks bpose[{i}]: [0 0 0 0] is taken, as Stage does")
        pose = reader.pose(f"bpose[{i}]")
        length = reader.number(f"blength[{i}]", common, "l")
        if not length > 0:
            name_of_length = f"blength[{i}]" if reader.has(f"blength[{i}]") else "blength"
            reader.remark(name_of_length, f"piece {i} of this bumper has no length: it is left out")
            continue
        x, y, yaw = seat.planar.compose(pose.planar)
        found.append(BumperPiece(f"{name}.{i}", x, y, seat.z + pose.z, yaw, length))
    return found


def read_blobfinder(reader: Reader, name: str, seat: Pose3) -> list[Blobfinder]:
    """A `blobfinder` model; of its image only the width counts. Raises WorldError."""
    count = reader.whole("colors_count", 0, 0, 256)
    numbered = [name for name in (f"colors[{i}]" for i in range(count)) if reader.has(name)]
    listed = reader.texts("colors") or tuple(reader.text(name, "") for name in numbered)
    width = reader.numbers("image", "nn", (80.0, 60.0))[0]
    if not (width == round(width) and 1 <= width <= MAX_PIXELS):
        reader.fail("image", f"the width of an image must be a whole number of 1 to {MAX_PIXELS}, not {width:g}")
    high = reader.number("range", 12.0, "l")
    if not high > 0:
        reader.fail("range", f"range must be above 0, not {high:g}")
    turned = seat._replace(yaw=seat.yaw + reader.number("pan", 0.0, "a"))
    return [Blobfinder(name, *turned, _read_fov(reader, math.radians(60.0)), int(width), high, listed)]


def _read_fov(reader: Reader, default: float) -> float:
    fov = reader.number("fov", default, "a")
    if not 0 < fov <= math.tau + 1e-9:
        reader.fail("fov", f"fov must be an angle above 0 and up to 360 degrees, not {math.degrees(fov):g}")
    return fov


class DeviceModel(NamedTuple):
    """A type of model in world files that senses."""

    read: Callable[[Reader, str, Pose3], Sequence[Device]]
    """The devices of one model of a name; raises WorldError."""
    properties: Set[str] = frozenset()
    """What it reads besides the properties of every model."""
    has_body: bool = False
    """Whether a model without blocks has a body all the same."""


MODELS = {
    "ranger": DeviceModel(read_rangers),
    # The "ranger" of older worlds.
    "laser": DeviceModel(read_rangers, {"range", "range_min", "range_max", "fov", "samples", "noise"}),
    "fiducial": DeviceModel(read_finder, {"range_min", "range_max", "range_max_id", "fov", "ignore_zloc"}),
    "bumper": DeviceModel(read_bumpers, {"bcount", "bpose[]", "blength", "blength[]"}, has_body=True),
    "blobfinder": DeviceModel(read_blobfinder, {"colors_count", "colors", "colors[]", "image", "range", "fov", "pan"}),
}
"""By the type in world files."""


class DeviceKind(NamedTuple):
    """One row: what is measured of a robot, and how it is published."""

    topic: str
    of: Callable[[Robot], Sequence[Any]]
    """The robot's devices of this kind, in file order; a message each, unless they are `joined`."""
    link: str = ""
    """Stem of the devices' own frames, children of `base_link`; empty where they have none."""
    title: str = ""
    """What reports call one of them; empty for what every robot measures."""
    numbers: Literal["from_1", "from_0", "joined"] = "from_1"
    """Topics are `base_scan`, `base_scan_1`, …, or `sonar_0`, `sonar_1`, …, or one for all devices of the kind."""

    @property
    def message(self) -> type[Message]:
        return SENSORS[self.topic]

    def count(self, robot: Robot) -> int:
        """Messages a tick of a robot."""
        devices = len(self.of(robot))
        return min(devices, 1) if self.numbers == "joined" else devices

    def key(self, robot_id: int, index: int) -> str:
        """Key of the robot's `index`-th message of this kind."""
        return names.robot_key(robot_id, self._numbered(self.topic, index))

    @lru_cache(maxsize=1024)  # noqa: B019
    def frame(self, robot_id: int, index: int) -> str:
        """Frame of the robot's `index`-th device of this kind."""
        return names.robot_frame(robot_id, self._numbered(self.link, index) if self.link else names.BASE_LINK)

    def _numbered(self, stem: str, index: int) -> str:
        return names.numbered(stem, index, always=self.numbers == "from_0")


def _base(robot: Robot) -> Sequence[Robot]:
    """What every robot measures, it measures once."""
    return (robot,)


def _rangers(robot: Robot, are_lasers: bool) -> Sequence[Ranger]:
    return [ranger for ranger in robot.rangers if ranger.is_laser == are_lasers]


KINDS: dict[str, DeviceKind] = {
    kind.topic: kind
    for kind in (
        DeviceKind(names.ODOM, _base),
        DeviceKind(names.BASE_SCAN, lambda robot: _rangers(robot, True), names.BASE_LASER_LINK, "laser"),
        DeviceKind(names.GROUND_TRUTH, _base),
        DeviceKind(names.STALL, _base),
        DeviceKind(names.JOINT_STATES, _base),
        DeviceKind(names.SONAR, lambda robot: _rangers(robot, False), "sonar", "sonar", "from_0"),
        DeviceKind(names.FIDUCIALS, lambda robot: robot.devices_of(Finder), "fiducial_link", "fiducial finder"),
        DeviceKind(names.BUMPER, lambda robot: robot.devices_of(BumperPiece), "", "bumper", "joined"),
        DeviceKind(names.BLOBS, lambda robot: robot.devices_of(Blobfinder), "blobfinder_link", "blob finder"),
    )
}
"""All rows by topic, in the order in which they are published."""
