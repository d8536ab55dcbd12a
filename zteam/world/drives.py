"""How a position model moves."""

from typing import NamedTuple

from zteam.geometry import Point2
from zteam.world.model import Limits
from zteam.world.properties import Reader

WHEEL_SEPARATION = 0.3
"""Metres between the wheels of a robot without a width."""
DEFAULT_MASS = 10.0
MAX_MASS = 1e6


class Drive(NamedTuple):
    """The properties of a position model that are not its body; the fields are those of `Robot`."""

    drive: str
    wheelbase: float
    velocity: Limits
    acceleration: Limits | None
    localization: str
    odom_error: tuple[float, float, float]
    odom_alphas: tuple[float, float, float, float]
    wheel_radius: float
    wheel_separation: float
    mass: float
    color: str


def read_drive(reader: Reader, width: float, color: str) -> Drive:
    """Drive, limits, odometry and mass of a position model of a width and a colour; raises WorldError."""
    wheelbase = reader.length("wheelbase", 1.0)
    drive = reader.stages_choice("drive", "diff", ("diff", "omni", "car"))
    if not wheelbase > 0 and drive == "car":
        reader.fail("wheelbase", f"wheelbase must be above 0, not {wheelbase:g}")
    radius = reader.length("wheel_radius", 0.05)
    separation = reader.length("wheel_separation", width if width > 0 else WHEEL_SEPARATION)
    if not (radius > 0 and separation > 0):
        reader.fail("wheel_radius", "wheel_radius and wheel_separation must be above 0")
    return Drive(
        drive=drive,
        wheelbase=wheelbase,
        velocity=_read_limits(reader, "velocity_bounds") or Limits(),
        acceleration=_read_limits(reader, "acceleration_bounds"),
        localization=reader.stages_choice("localization", "gps", ("gps", "odom")),
        odom_error=_read_odom_error(reader),
        odom_alphas=_read_odom_alphas(reader),
        wheel_radius=radius,
        wheel_separation=separation,
        mass=read_mass(reader),
        color=color,
    )


def read_mass(reader: Reader) -> float:
    """Kilograms of a robot, or of something pushed."""
    mass = reader.number("mass", DEFAULT_MASS)
    if mass > MAX_MASS:
        reader.fail("mass", f"mass must be at most {MAX_MASS:g} kg, not {mass:g}")
    if mass <= 0:
        reader.remark(
            "mass", f"mass must be above 0, not {mass:g}: {DEFAULT_MASS:g} kg is taken; Stage does not use it"
        )
        return DEFAULT_MASS
    return mass


def _read_odom_alphas(reader: Reader) -> tuple[float, float, float, float]:
    a, b, c, d = reader.numbers("odom_alphas", "nnnn", (0.0, 0.0, 0.0, 0.0))
    if min(a, b, c, d) < 0:
        reader.fail("odom_alphas", "odom_alphas must not be negative")
    return a, b, c, d


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
    """Stage's `[x y z yaw]`, or `[x y yaw]` as in comments of its own worlds: fractions, and radians for yaw."""
    found = reader.entity.properties.get("odom_error")
    if found is None:
        return (0.0, 0.0, 0.0)
    if len(found.values) == 3:
        x, y, yaw = reader.numbers("odom_error", "nna", ())
    else:
        x, y, _, yaw = reader.numbers("odom_error", "nnna", ())
    return (x, y, yaw)
