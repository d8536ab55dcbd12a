"""Any scan whatever gives a finite command within the limits; any team file whatever is a team or a ConfigError."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

from support.flat_floor import TICK, make_view
from zteam.behaviors import decide, load_behavior, missing
from zteam.errors import DecodeError
from zteam.geometry import Pose2
from zteam.messages import Header, LaserScan, Odometry, decode, encode, time_from_ns
from zteam.robot.view import first_clear, look_ahead, look_along

NOW = 100 * TICK
any_float32 = st.floats(width=32)
"""NaN and infinities included."""


@st.composite
def scans(draw: st.DrawFn) -> LaserScan:
    """Any scan that can come over the wire, most of them fresh."""
    plausible = st.sampled_from([2.0**-8, -(2.0**-8), 0.0, 0.125])  # exact in float32
    ranges = draw(st.lists(any_float32 | st.floats(0.0, 5.0, width=32), max_size=40))
    repeated = np.array(ranges * draw(st.sampled_from([1, 1, 30])), np.float32)
    return LaserScan(
        header=Header(time_from_ns(draw(st.just(NOW) | st.integers(0, 2 * NOW)))),
        angle_min=draw(st.floats(-4.0, 4.0, width=32) | any_float32),
        angle_increment=draw(plausible | any_float32),
        range_min=draw(st.sampled_from([0.0, 0.125]) | any_float32),
        range_max=draw(st.just(30.0) | any_float32),
        ranges=repeated,
    )


any_pose = st.builds(Pose2, st.floats(), st.floats(), st.floats())
lookups = st.none() | st.tuples(any_pose | st.builds(Pose2, *[st.floats(-9.0, 9.0)] * 3), st.integers(0, 2 * NOW))
BEHAVIORS: list[tuple[str, dict[str, Any]]] = [
    ("forward", {"speed": 1.0}),
    ("forward", {"speed": -1.0}),
    ("avoid", {}),
    ("wander", {}),
    ("follow", {"leader": 1, "max_linear": 1.0}),
]


@pytest.mark.parametrize(("name", "params"), BEHAVIORS)
@given(st.lists(st.tuples(st.none() | scans(), lookups, st.floats(0.0, 10.0)), max_size=4))
def test_commands_are_finite_and_within_limits(
    name: str, params: dict[str, Any], steps: list[tuple[LaserScan | None, tuple[Pose2, int] | None, float]]
) -> None:
    """Whatever is sensed, in whatever order, the wheels get numbers they can follow, and x and yaw alone."""
    behavior = load_behavior(name, params, robot_id=0)
    for scan, found, dt in steps:
        view = make_view(scan, now=NOW, dt=dt, lookup=lambda target, source, found=found: found, odom=Odometry())
        command, reason = decide(behavior, view)
        assert abs(command.linear.x) <= 1.0
        assert abs(command.angular.z) <= math.pi
        assert not any((command.linear.y, command.linear.z, command.angular.x, command.angular.y))
        assert "\n" not in reason
        assert all(isinstance(text, str) for text in missing(view, behavior))


@given(scans(), st.floats(0.0, math.pi))
def test_what_a_scan_says_survives_the_wire(scan: LaserScan, half_angle: float) -> None:
    """A decoded scan, whose array is read-only, says the same as the one that was sent."""
    try:
        received = decode(LaserScan, encode(scan))
    except DecodeError:
        # The codec lets no scan through whose geometry is no number.
        reject()
    assert look_ahead(received, half_angle) == look_ahead(scan, half_angle)
    cone = look_ahead(received, half_angle)
    assert cone is None or (cone.nearest >= 0.0 and 0.0 <= cone.invalid <= 1.0 and abs(cone.bearing) <= math.pi)
    assert look_along(received, 0.2, half_angle) >= 0.0
    headings = [half_angle * share for share in (0.0, 0.5, -0.5, 1.0, -1.0)]
    for reach in (-1.0, 0.1, 0.6, 5.0):
        clear = [heading for heading in headings if look_along(received, 0.2, heading) >= reach]
        assert first_clear(received, 0.2, reach, 0.0, tuple(headings[1:])) == (clear[0] if clear else None)


@given(st.integers(1, 300), st.floats(-math.pi, math.pi), st.floats(0.1, 9.0), st.floats(0.05, 1.5))
def test_turning_a_scan_round_changes_nothing(count: int, bearing: float, reach: float, half_angle: float) -> None:
    """The same beams listed clockwise show the same cone."""
    angles = np.linspace(-2.0, 2.0, count)
    ranges = np.where(np.abs(angles - bearing) < 0.3, reach, 10.0)
    step = float(angles[1] - angles[0]) if count > 1 else 0.0
    left = LaserScan(angle_min=-2.0, angle_increment=step, range_max=30.0, ranges=ranges.astype(np.float32))
    right = LaserScan(
        angle_min=float(angles[-1]), angle_increment=-step, range_max=30.0, ranges=ranges[::-1].astype(np.float32)
    )
    a, b = look_ahead(left, half_angle), look_ahead(right, half_angle)
    assert (a is None) == (b is None)
    if a and b:
        assert a.nearest == b.nearest
