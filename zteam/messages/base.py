"""What a robot's base is: its outline and its limits, as `base_info` tells them and the team file overrides them."""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, Any

import msgspec

from zteam.config.problems import KeyValueError, problems_of
from zteam.geometry import Point2, signed_area
from zteam.messages import BaseInfo

_LEAST = 1e-6
"""Of a speed, an acceleration or a length in SI units that is not 0: a smaller one is a mistake, not a base's limit."""
MAX_EXTENT = 100.0
"""Metres: no outline reaches further from the base's origin."""
_DIGITS = 6
"""Decimals of a metre that the float32 of a footprint holds."""
_LEAST_AREA = 5e-7
"""m²: less than half a square millimetre is a mistake, not a base."""

_Acceleration = Annotated[float, msgspec.Meta(ge=_LEAST)]
_Deceleration = Annotated[float, msgspec.Meta(le=-_LEAST)]
_Speed = Annotated[float, msgspec.Meta(ge=_LEAST, le=1000.0)]


class BaseOverride(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """The table `base` of a robot in a team file, and `zteam-robot --base`: what holds instead of `base_info`.

    Names and units are those of `Base`; None leaves a value as `base_info` tells it. Raises ValueError for an outline
    that no base can have, and for a limit that is next to nothing.
    """

    footprint: Annotated[tuple[Point2, ...], msgspec.Meta(min_length=3, max_length=1000)] | None = None
    max_vel_x: _Speed | None = None
    min_vel_x: Annotated[float, msgspec.Meta(ge=-1000.0, le=0.0)] | None = None
    max_vel_theta: _Speed | None = None
    acc_lim_x: _Acceleration | None = None
    decel_lim_x: _Deceleration | None = None
    acc_lim_theta: _Acceleration | None = None
    max_vel_y: _Speed | None = None
    acc_lim_y: _Acceleration | None = None
    decel_lim_reverse: _Acceleration | None = None
    wheelbase: Annotated[float, msgspec.Meta(ge=_LEAST, le=MAX_EXTENT)] | None = None

    def __post_init__(self) -> None:
        if self.footprint is not None and not _is_outline(self.footprint):
            raise KeyValueError("footprint", f"must enclose an area, with corners [x, y] of at most {MAX_EXTENT:g} m")
        if -_LEAST < (self.min_vel_x or 0.0) < 0.0:
            raise KeyValueError("min_vel_x", f"give 0, or -{_LEAST:g} and less, not {self.min_vel_x:g}")


LIMITS = tuple(name for name in BaseOverride.__struct_fields__ if name != "footprint")
"""Names of the limits, Nav2's, in `Base`, `BaseOverride` and `BaseInfo`."""


class Base(msgspec.Struct, frozen=True, kw_only=True, eq=False, dict=True):
    """One robot's base. Everything is in `base_footprint`: x forward, y left, the origin where it turns about.

    The defaults are those of an erratic, the robot of Stage's worlds and of the lectures.
    """

    model: str = "erratic"
    drive: str = "diff"
    """`diff`, `omni` or `car`."""
    footprint: tuple[Point2, ...] = ((-0.225, -0.175), (0.125, -0.175), (0.125, 0.175), (-0.225, 0.175))
    """Corners of the outline, metres."""
    max_vel_x: float = 1.0
    """m/s."""
    min_vel_x: float = -1.0
    """m/s; 0 = it does not drive backwards."""
    max_vel_theta: float = math.pi
    """rad/s, both ways."""
    acc_lim_x: float = math.inf
    """m/s²; inf = no limit."""
    decel_lim_x: float = -math.inf
    """m/s², negative."""
    acc_lim_theta: float = math.inf
    """rad/s²."""
    max_vel_y: float = 0.0
    """m/s, both ways; only an omni base drives sideways."""
    acc_lim_y: float = math.inf
    """m/s², both ways."""
    decel_lim_reverse: float = math.inf
    """m/s²: how hard it brakes when it drives backwards; inf = as hard as forwards."""
    wheelbase: float = 0.0
    """Metres from axle to axle of a car; 0 = not told."""

    @cached_property
    def half_width(self) -> float:
        """Metres that the outline reaches to either side: half of the corridor that it needs straight ahead."""
        return max(abs(y) for _, y in self.footprint)

    @cached_property
    def radius(self) -> float:
        """Metres to the furthest corner: what the base needs to turn on the spot."""
        return max(math.hypot(x, y) for x, y in self.footprint)


DEFAULT_BASE = Base()
"""What holds until `base_info` comes, and for a base that does not publish it."""


def base_of(message: BaseInfo) -> Base:
    """The base that `base_info` tells; a value that no base can have, such as 0 for a speed, is as in DEFAULT_BASE."""
    told: dict[str, Any] = {"model": message.model, "drive": message.drive or DEFAULT_BASE.drive}
    footprint = tuple((round(point.x, _DIGITS), round(point.y, _DIGITS)) for point in message.footprint.points)
    if _is_outline(footprint):
        told["footprint"] = footprint
    for name in LIMITS:
        value = getattr(message, name)
        if not problems_of({name: value}, BaseOverride):
            told[name] = value
    return Base(**told)


def override_base(base: Base, override: BaseOverride) -> Base:
    """`base` with the values that `override` has."""
    given = msgspec.structs.asdict(override)
    return msgspec.structs.replace(base, **{name: value for name, value in given.items() if value is not None})


def _is_outline(points: Sequence[Point2]) -> bool:
    """Whether the points are finite, near, and enclose an area."""
    if len(points) < 3 or not all(abs(part) <= MAX_EXTENT for point in points for part in point):
        return False
    return abs(signed_area(points)) > _LEAST_AREA
