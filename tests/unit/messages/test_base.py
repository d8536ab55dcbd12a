"""What a base is: its sizes, what a message tells of it, and what a team file sets instead."""

import math

import pytest

from zteam.config.problems import problems_of
from zteam.messages import BaseInfo, Point32, Polygon, decode, encode
from zteam.messages.base import DEFAULT_BASE, Base, BaseOverride, base_of, override_base

CART = BaseInfo(
    model="cart",
    drive="omni",
    footprint=Polygon([Point32(-0.3, -0.2), Point32(0.45, -0.1), Point32(0.45, 0.1), Point32(-0.3, 0.2)]),
    max_vel_x=0.8,
    min_vel_x=0.0,
    max_vel_theta=1.2,
    acc_lim_x=0.5,
    decel_lim_x=-2.0,
    acc_lim_theta=3.0,
)


def test_a_message_tells_all() -> None:
    """After the wire's float32 a footprint has the metres that its publisher wrote; every limit is taken. The half
    width is the largest distance to a side, the radius that to a corner."""
    base = base_of(decode(BaseInfo, encode(CART)))
    assert base.footprint == ((-0.3, -0.2), (0.45, -0.1), (0.45, 0.1), (-0.3, 0.2))
    assert (base.model, base.drive, base.max_vel_x, base.min_vel_x) == ("cart", "omni", 0.8, 0.0)
    assert (base.max_vel_theta, base.acc_lim_x, base.decel_lim_x, base.acc_lim_theta) == (1.2, 0.5, -2.0, 3.0)
    assert (base.half_width, base.radius) == (0.2, math.hypot(0.45, 0.1))


@pytest.mark.parametrize(
    "footprint",
    [
        [],
        [Point32(0.0, 0.0), Point32(1.0, 0.0)],
        [Point32(0.0, 0.0), Point32(1.0, 0.0), Point32(2.0, 0.0)],
        [Point32(0.0, 0.0), Point32(1.0, 0.0), Point32(0.0, math.nan)],
        [Point32(0.0, 0.0), Point32(1.0, 0.0), Point32(0.0, math.inf)],
        [Point32(0.0, 0.0), Point32(101.0, 0.0), Point32(0.0, 1.0)],
    ],
)
def test_what_is_no_outline_leaves_the_default(footprint: list[Point32]) -> None:
    """No corners, no area, no numbers: the robot does not drive with a base of no width."""
    assert base_of(BaseInfo(footprint=Polygon(footprint))).footprint == DEFAULT_BASE.footprint


@pytest.mark.parametrize("value", [5e-324, -5e-324, 0.0, math.nan])
def test_a_limit_that_no_base_has_is_as_by_default(value: float) -> None:
    """A base that fills in its footprint alone can drive, as fast as an erratic but not backwards; with a speed or an
    acceleration of next to nothing a robot could not compute."""
    limits = dict.fromkeys(("max_vel_x", "max_vel_theta", "acc_lim_x", "acc_lim_theta", "decel_lim_x"), value)
    told = base_of(BaseInfo(**limits))
    assert {name: getattr(told, name) for name in limits} == {name: getattr(DEFAULT_BASE, name) for name in limits}
    assert (told.drive, told.min_vel_x) == ("diff", 0.0)


def test_an_override_holds_for_what_it_sets() -> None:
    """The sizes follow the new outline; all else is as told."""
    square = ((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5))
    told = base_of(CART)
    # The sizes are kept once computed.
    assert told.half_width == 0.2
    base = override_base(told, BaseOverride(footprint=square, max_vel_x=0.4))
    assert (base.footprint, base.half_width, base.max_vel_x, base.max_vel_theta) == (square, 0.5, 0.4, 1.2)
    unchanged: Base = override_base(told, BaseOverride())
    assert (unchanged.footprint, unchanged.max_vel_x) == (told.footprint, 0.8)


@pytest.mark.parametrize(
    ("table", "told"),
    [
        ({"max_velx": 1.0}, "max_velx: unknown key (did you mean max_vel_x?); known: footprint, max_vel_x"),
        ({"max_vel_x": 0.0}, "max_vel_x: a number of at least 1e-06 is expected, not 0.0"),
        ({"max_vel_theta": math.nan}, "max_vel_theta: a number of at least 1e-06 is expected, not NaN"),
        ({"max_vel_x": 1e300}, "max_vel_x: a number of at most 1000 is expected, not 1e+300"),
        ({"max_vel_theta": math.inf}, "max_vel_theta: a number of at most 1000 is expected, not Infinity"),
        ({"acc_lim_x": 1e-300}, "acc_lim_x: a number of at least 1e-06 is expected, not 1e-300"),
        ({"min_vel_x": -1e-9}, "min_vel_x: give 0, or -1e-06 and less, not -1e-09"),
        ({"wheelbase": 1e9}, "wheelbase: a number of at most 100 is expected"),
        ({"min_vel_x": 0.1}, "min_vel_x: a number of at most 0 is expected, not 0.1"),
        ({"min_vel_x": math.nan}, "min_vel_x: a number of at least -1000 is expected, not NaN"),
        ({"decel_lim_x": 2.0}, "decel_lim_x: a number of at most -1e-06 is expected, not 2.0"),
        ({"footprint": [[0, 0], [1, 0]]}, "footprint: a list of at least 3 values is expected, not [[0, 0], [1, 0]]"),
        ({"footprint": [[0, 0], [1, 0], [0, "a"]]}, 'footprint[2][1]: a number is expected, not "a"'),
        ({"footprint": [[0, 0], [1, 0], [2, 0]]}, "footprint: must enclose an area, with corners [x, y] of at most"),
        ({"footprint": [[0, 0], [1, 0], [0, math.nan]]}, "footprint: must enclose an area"),
        ({"footprint": 0.3}, "footprint: a list is expected, not 0.3"),
    ],
)
def test_a_wrong_override_is_named(table: dict[str, object], told: str) -> None:
    """Each mistake has its key and what is allowed."""
    (problem,) = problems_of(table, BaseOverride)
    assert str(problem).startswith(told)
