"""How a world is simulated: what contacts do, and how bad the sensors are. A team file's `[simulation]` table."""

import math
from typing import Literal

import msgspec

PHYSICS = ("dynamic", "stage", "kinematic")
"""Bodies slide and push (pymunk); Stage's own steps, refused where they collide; exact arcs, refused likewise."""


class Options(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Defaults are Stage's: exact lasers, exact odometry unless the world file says otherwise.

    Raises ValueError for a value that makes no sense.
    """

    physics: Literal["dynamic", "stage", "kinematic"] | None = None
    """`dynamic`: bodies slide and push (pymunk). `stage`: Stage's own steps, and a step that would collide is refused.
    `kinematic`: exact arcs, refused likewise; the cheapest, for crowds. None: what the world file says."""
    no_hit: Literal["range_max", "inf"] = "range_max"
    """What a beam reads that hits nothing: Stage's range_max, or inf as REP 117 has it."""
    below_min: Literal["measured", "-inf", "zero"] = "measured"
    """What a beam reads that hits something nearer than range_min: the truth as in Stage, or REP 117's -inf, or 0."""
    gaussian_noise: float = 0.0
    """Standard deviation in metres, of every laser, besides what the world file gives it."""
    proportional_noise: float = 0.0
    """Standard deviation as a share of the range."""
    odom_alphas: tuple[float, float, float, float] | None = None
    """Thrun's four, for every robot (`Robot.odom_alphas`); None: what the world file says."""
    dazzle: Literal["off", "drop", "max", "short", "scan"] = "off"
    """What lasers at one height do to each other that are in mutual sight: beams towards the other read NaN, range_max,
    or something short; or the whole scan reads NaN."""
    dazzle_angle: float = math.radians(2.0)
    """Radians to either side of the other laser."""
    dazzle_probability: float = 1.0
    """Share of the scans in which two lasers meet."""

    def __post_init__(self) -> None:
        _check("gaussian_noise", self.gaussian_noise, 1000.0)
        _check("proportional_noise", self.proportional_noise, 1000.0)
        _check("dazzle_angle", self.dazzle_angle, 2.0 * math.pi)
        for alpha in self.odom_alphas or ():
            _check("odom_alphas", alpha, 1000.0)
        _check("dazzle_probability", self.dazzle_probability, 1.0)


def _check(name: str, value: float, high: float) -> None:
    if not 0.0 <= value <= high:
        raise ValueError(f"{name} must be from 0 to {high:g}, not {value:g}")


def simulation_arguments(options: Options) -> list[str]:
    """The arguments of `zteam-sim` that ask for these options; none for what is the default anyway."""
    arguments: list[str] = []
    for field in msgspec.structs.fields(options):
        value = getattr(options, field.name)
        if value != field.default:
            values = value if isinstance(value, tuple) else (value,)
            # One word each, so that "-inf" is not taken for an option of its own.
            arguments.append(f"--{field.name.replace('_', '-')}={','.join(map(str, values))}")
    return arguments
