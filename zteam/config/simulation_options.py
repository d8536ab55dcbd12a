"""Options of contacts and sensors: the `[simulation]` table of a team file, and options of `zteam-sim`."""

import math
from typing import Literal

import msgspec

from zteam.config.problems import KeyValueError

PHYSICS = ("dynamic", "stage", "kinematic")
"""Values of `Options.physics`."""


class Options(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The defaults are Stage's: exact lasers, and exact odometry unless the world file sets noise.

    Raises ValueError for a value out of range.
    """

    physics: Literal["dynamic", "stage", "kinematic"] | None = None
    """`dynamic`: bodies slide and push (pymunk). `stage`: Stage's own steps; a robot does not make a step that would
    collide. `kinematic`: the same with exact arcs; the fastest, for crowds. None: as the world file says."""
    no_hit: Literal["range_max", "inf"] = "range_max"
    """Range of a beam that hits nothing: Stage's range_max, or REP 117's inf."""
    below_min: Literal["measured", "-inf", "zero"] = "measured"
    """Range of a beam that hits something nearer than range_min: the true range as in Stage, REP 117's -inf, or 0."""
    gaussian_noise: float = 0.0
    """Standard deviation in metres of every laser, added to the world file's noise."""
    proportional_noise: float = 0.0
    """Standard deviation of every laser as a share of the range."""
    odom_alphas: tuple[float, float, float, float] | None = None
    """Thrun's four parameters for every robot (`Robot.odom_alphas`); None: as the world file says."""
    dazzle: Literal["off", "drop", "max", "short", "scan"] = "off"
    """Interference of two lasers at the same height that see each other. Beams towards the other laser read NaN
    (`drop`), range_max (`max`) or a short range (`short`); or the whole scan reads NaN (`scan`)."""
    dazzle_angle: float = math.radians(2.0)
    """Angle in radians on either side of the other laser within which beams are affected."""
    dazzle_probability: float = 1.0
    """Share of the scans that are affected, of those in which two lasers see each other."""

    def __post_init__(self) -> None:
        for name, values, high in (
            ("gaussian_noise", (self.gaussian_noise,), 1000.0),
            ("proportional_noise", (self.proportional_noise,), 1000.0),
            ("dazzle_angle", (self.dazzle_angle,), 2.0 * math.pi),
            ("odom_alphas", self.odom_alphas or (), 1000.0),
            ("dazzle_probability", (self.dazzle_probability,), 1.0),
        ):
            for value in values:
                if not 0.0 <= value <= high:
                    raise KeyValueError(name, f"must be from 0 to {high:g}, not {value:g}")
