"""Rangers: what a `ranger` model and its `sensor` entities say about rays."""

import math

from zteam.geometry import Pose2
from zteam.world.model import Ranger
from zteam.world.properties import Pose3, Reader, Seat, Size3

MAX_SAMPLES = 100_000
SENSOR_SIZE = Size3(0.02, 0.02, 0.02)
"""Stage's default; half its height lies between the sensor's foot and its rays."""


def read_rangers(reader: Reader, name: str, seat: Seat) -> list[Ranger]:
    """The sensors of a `ranger`, or the one of an old `laser`; raises WorldError."""
    entity = reader.entity
    sensors = [child for child in entity.children if child.type == "sensor"]
    found: list[Ranger | None] = []
    for i, sensor in enumerate(sensors):
        own = reader.of(sensor)
        own.remark_unused("sensor")
        found.append(_read_sensor(own, name if len(sensors) == 1 else f"{name}.{i}", *seat))
    if not sensors and entity.type == "laser":
        found.append(_read_old_laser(reader, name, *seat))
    elif not sensors:
        reader.remark_entity("this ranger has no sensor( )")
    return [ranger for ranger in found if ranger is not None]


def _read_sensor(reader: Reader, name: str, base_from_ranger: Pose2, z: float) -> Ranger | None:
    """A `sensor` of a ranger with its foot `z` above the ground; None if it has no rays."""
    pose = reader.pose("pose")
    limits = _read_range(reader, "range", *reader.numbers("range", "ll", (0.0, 5.0)))
    size = reader.size(SENSOR_SIZE)
    return _ranger(reader, name, base_from_ranger, limits, Pose3(pose.x, pose.y, z + pose.z + size.z / 2, pose.yaw))


def _read_old_laser(reader: Reader, name: str, base_from_ranger: Pose2, z: float) -> Ranger | None:
    """A `laser` without sensors, as worlds for Stage 3 have it: the properties stand in the model itself.

    Its defaults were those of a SICK LMS: 180 rays over 180°, 8 m; the rays start half-way up the model.
    """
    old = reader.length("range_min", 0.0), reader.length("range_max", 8.0)
    limits = _read_range(reader, "range" if reader.has("range") else "range_max", *reader.numbers("range", "ll", old))
    height = reader.size(SENSOR_SIZE).z / 2
    return _ranger(reader, name, base_from_ranger, limits, Pose3(0.0, 0.0, z + height, 0.0), math.pi, 180)


def _read_range(reader: Reader, name: str, low: float, high: float) -> tuple[float, float]:
    if not high > 0:
        reader.fail(name, f"the largest range must be above 0, not {high:g}")
    if not 0 <= low <= high:
        reader.remark(name, f"the smallest range {low:g} is not of 0 to {high:g}: 0 is taken, Stage never applies it")
        low = 0.0
    return low, high


def _ranger(
    reader: Reader,
    name: str,
    base_from_ranger: Pose2,
    limits: tuple[float, float],
    pose: Pose3,
    fov: float = 0.1,
    samples: int = 1,
) -> Ranger | None:
    """`pose` is in the ranger's frame, its z above the ground; `fov` and `samples` are defaults."""
    base_from_sensor = base_from_ranger.compose(pose.planar)
    fov = reader.angle("fov", fov)
    samples = reader.whole("samples", samples, 0, MAX_SAMPLES)
    if samples == 0:
        reader.remark("samples", "a sensor without rays is left out")
        return None
    if not 0 <= fov <= math.tau + 1e-9:
        reader.fail("fov", f"fov must be an angle of 0 to 360 degrees, not {math.degrees(fov):g}")
    if samples > 1 and fov == 0:
        reader.remark("fov", f"all {samples} rays of a fov of 0 are one: one is taken")
        samples = 1
    variance, proportional, angular = reader.numbers("noise", "nnn", (0.0, 0.0, 0.0))
    if min(variance, proportional, angular) < 0:
        reader.fail("noise", "noise must not be negative")
    return Ranger(
        name=name,
        x=base_from_sensor.x,
        y=base_from_sensor.y,
        z=pose.z,
        yaw=base_from_sensor.yaw,
        fov=fov,
        samples=samples,
        range_min=limits[0],
        range_max=limits[1],
        noise=(variance, proportional, angular),
    )
