"""What a position model says about how it moves."""

from typing import NamedTuple

from zteam.world.model import Limits, Point2
from zteam.world.properties import Reader

MAX_MASS = 1e6


class Drive(NamedTuple):
    """The properties of a position model that are not its body; the fields are those of `Robot`."""

    drive: str
    wheelbase: float
    velocity: Limits
    acceleration: Limits | None
    localization: str
    odom_error: tuple[float, float, float]
    mass: float
    color: str


def read_drive(reader: Reader) -> Drive:
    """Drive, limits, odometry, mass and colour of a position model; raises WorldError."""
    wheelbase = reader.length("wheelbase", 1.0)
    if not wheelbase > 0:
        reader.fail("wheelbase", f"wheelbase must be above 0, not {wheelbase:g}")
    mass = reader.number("mass", 10.0)
    if not 0 < mass <= MAX_MASS:
        reader.fail("mass", f"mass must be above 0 and at most {MAX_MASS:g} kg, not {mass:g}")
    return Drive(
        drive=reader.choice("drive", "diff", ("diff", "omni", "car")),
        wheelbase=wheelbase,
        velocity=_read_limits(reader, "velocity_bounds") or Limits(),
        acceleration=_read_limits(reader, "acceleration_bounds"),
        localization=reader.choice("localization", "gps", ("gps", "odom")),
        odom_error=_read_odom_error(reader),
        mass=mass,
        color=_read_color(reader),
    )


def _read_limits(reader: Reader, name: str) -> Limits | None:
    """`[xmin xmax ymin ymax zmin zmax yawmin yawmax]`; None if not set. z is not used: robots stay on the ground."""
    if not reader.has(name):
        return None
    values = reader.numbers(name, "llllllaa", ())
    pairs: list[Point2] = [(values[0], values[1]), (values[2], values[3]), (values[6], values[7])]
    for (low, high), axis in zip(pairs, ("x", "y", "yaw"), strict=True):
        if low > high:
            reader.fail(name, f"{name}: the smallest {axis} {low:g} is above the largest {high:g}")
    return Limits(*pairs)


def _read_odom_error(reader: Reader) -> tuple[float, float, float]:
    """Stage's `[x y z yaw]`, or `[x y yaw]` as comments in its own worlds have it: fractions, and radians for yaw."""
    found = reader.entity.properties.get("odom_error")
    if found is None:
        return (0.0, 0.0, 0.0)
    if len(found.values) == 3:
        x, y, yaw = reader.numbers("odom_error", "nna", ())
    else:
        x, y, _, yaw = reader.numbers("odom_error", "nnna", ())
    if min(x, y, yaw) < 0:
        reader.fail("odom_error", "odom_error must not be negative")
    return (x, y, yaw)


def _read_color(reader: Reader) -> str:
    """A name of X11's, `random`, or #rrggbb from `color_rgba` (whose transparency does not count)."""
    if reader.has("color_rgba") and not reader.has("color"):
        channels = reader.numbers("color_rgba", "nnn", ())
        return "#" + "".join(f"{round(255 * min(max(channel, 0.0), 1.0)):02x}" for channel in channels)
    return reader.text("color", "red")
