"""The layer under every behaviour, and what a robot needs to be ready."""

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from support.flat_floor import TICK, make_scan, make_view
from zteam.behaviors import Behavior, SafetyLayer, View, decide, missing
from zteam.errors import ZteamError
from zteam.geometry import Pose2
from zteam.messages import LaserScan, Twist, Vector3
from zteam.messages.base import Base

FREE = [30.0] * 271
NOW = 100 * TICK
ALL_ROUND = make_scan(FREE, fov=math.tau)
"""A free scan of a laser without a blind side."""


class Asks(Behavior):
    """Asks for whatever it is told to."""

    def step(self, view: object) -> Twist:
        """The parameters are the command."""
        assert isinstance(self.params, Twist)
        return self.params


def asks(x: float, turn: float = 0.0) -> Behavior:
    """A behaviour that wants this speed and turn rate."""
    return Asks(Twist(linear=Vector3(x=x), angular=Vector3(z=turn)))


def in_front(x: float, y: float) -> LaserScan:
    """A free scan but for one point at (x, y) from the laser."""
    ranges = list(FREE)
    ranges[135 + round(math.degrees(math.atan2(y, x)))] = math.hypot(x, y)
    return make_scan(ranges, NOW, math.radians(270.0))


@pytest.mark.parametrize(("age", "moves"), [(0.0, True), (0.5, True), (0.51, False), (-0.51, False)])
def test_old_scans_move_nobody(age: float, moves: bool) -> None:
    """Half a second is the limit, and a scan stamped in the future counts as old."""
    scan = make_scan(FREE, NOW - round(age * 1e9))
    command, reason = decide(asks(0.2, 1.0), make_view(scan, now=NOW))
    assert (command.linear.x > 0.0) is moves
    assert (command.angular.z > 0.0) is moves
    assert reason == ("" if moves else "stale scan")


@pytest.mark.parametrize(
    ("base", "x", "turn", "got"),
    [
        (Base(), 5.0, 9.0, (1.0, math.pi)),
        (Base(), -5.0, -9.0, (-1.0, -math.pi)),
        (Base(), 0.3, -0.3, (0.3, -0.3)),
        (Base(max_vel_x=0.3, max_vel_theta=0.5), 1.0, 2.0, (0.3, 0.5)),
        (Base(min_vel_x=-0.2, max_vel_theta=0.5), -1.0, -2.0, (-0.2, -0.5)),
        (Base(min_vel_x=0.0), -1.0, 0.0, (0.0, 0.0)),
        (Base(max_vel_x=5.0, min_vel_x=-5.0, max_vel_theta=9.0), 7.0, 9.5, (5.0, 9.0)),
        (Base(drive="car", wheelbase=0.5), 2.0, 0.5, (1.0, 0.5)),
        # Its wheels are turned so far that it turns no faster.
        (Base(drive="car", wheelbase=0.5, max_vel_theta=0.1), 1.0, 0.5, (0.8790, 0.0569)),
    ],
)
def test_a_base_is_asked_for_no_more_than_it_does(base: Base, x: float, turn: float, got: tuple[float, float]) -> None:
    """Its own limits count; a car's second number is the angle of its wheels."""
    command, _ = decide(asks(x, turn), make_view(ALL_ROUND, base=base))
    assert (command.linear.x, command.angular.z) == pytest.approx(got, abs=1e-4)


@pytest.mark.parametrize(
    ("base", "ticks"), [(Base(), 4), (Base(decel_lim_x=-1.0), 10), (Base(drive="car"), 4), (Base(acc_lim_x=1.0), 10)]
)
def test_a_robot_that_lacks_data_brakes_evenly_and_soon(base: Base, ticks: int) -> None:
    """From 1 m/s it stands after 0.4 s, or as soon as the limits that its base tells let it; no step is a jump."""
    layer, view = SafetyLayer(), make_view(ALL_ROUND, base=base)
    for _ in range(20):
        command, _ = layer.limit(Twist(Vector3(1.0)), view)
    speeds = [command.linear.x]
    while speeds[-1]:
        speeds.append(layer.limit(Twist(), view, "leader robot_0 is gone")[0].linear.x)
    assert speeds == pytest.approx([1.0 - i / ticks for i in range(ticks + 1)])


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_zero(value: float) -> None:
    """NaN or inf in either part of a command stops the robot and is told."""
    for behavior in (asks(value), asks(0.1, value)):
        command, reason = decide(behavior, make_view(make_scan(FREE)))
        assert command == Twist()
        assert "no number" in reason


def test_a_command_has_plain_numbers_whatever_the_behaviour_returns() -> None:
    """Integers and numpy's numbers become floats, so that an answer can be handed over as it is."""
    for value in (1, np.float32(0.5), np.int64(1), Fraction(1, 2)):
        command, _ = decide(asks(value, value), make_view(make_scan(FREE)))  # type: ignore[arg-type]
        assert type(command.linear.x) is type(command.angular.z) is float
        assert (command.linear.x, command.angular.z) == (value, value)


def test_only_what_the_base_can_do_is_passed_on() -> None:
    """Sideways and upward parts are dropped."""
    wild = Asks(Twist(Vector3(0.1, 3.0, math.nan), Vector3(math.nan, 3.0, 0.2)))
    assert decide(wild, make_view(make_scan(FREE)))[0] == Twist(Vector3(x=0.1), Vector3(z=0.2))


@pytest.mark.parametrize(
    ("x", "y", "stops"),
    [
        (0.29, 0.0, True),
        (0.29, 0.19, True),
        (0.29, -0.19, True),
        (0.45, 0.0, False),
        (0.29, 0.3, False),
        (0.75, 0.0, False),
    ],
)
def test_forward_stops_for_what_is_swept(x: float, y: float, stops: bool) -> None:
    """What stands in its own width less than 0.15 m ahead stops it; what stands beside or far ahead does not."""
    command, reason = decide(asks(0.3), make_view(in_front(x, y), now=NOW))
    assert (command.linear.x, reason) == ((0.0, "obstacle ahead") if stops else (0.3, ""))


def test_a_robot_before_an_obstacle_may_turn_away() -> None:
    """Only the drive is cut: the turn that was wanted is left."""
    scan = make_scan([0.28] * 30 + FREE[60:] + [0.28] * 30, NOW, math.radians(270.0))
    scan.ranges[120:150] = 0.29
    command, reason = decide(asks(0.4, 0.1), make_view(scan, now=NOW))
    assert (command.linear.x, command.angular.z, reason) == (0.0, 0.1, "obstacle ahead")


def test_an_obstacle_ahead_does_not_hold_a_robot_that_backs_off() -> None:
    """What it touches does not hold it either."""
    for distance in (0.2, 0.126, 0.12):
        scan = make_scan(FREE, NOW, math.tau)
        scan.ranges[135] = distance
        assert decide(asks(-0.4), make_view(scan, now=NOW))[0].linear.x == -0.4


@pytest.mark.parametrize("ranges", [[], [math.nan] * 271, [0.0] * 271])
def test_a_blind_robot_does_not_drive_forward(ranges: list[float]) -> None:
    """Beams that say nothing are not free space, under every behaviour."""
    command, reason = decide(asks(0.4, 0.5), make_view(make_scan(ranges)))
    assert (command.linear.x, command.angular.z, reason) == (0.0, 0.5, "blind ahead")


def test_ready_means_scan_odometry_and_pose() -> None:
    """Each thing that is missing is named, with the key it comes on."""
    bare = make_view(None, robot_id=3, odom=None)
    lacking = missing(bare, asks(0.0))
    assert lacking == [
        "a first scan (robot_3/base_scan)",
        "odometry (robot_3/odom)",
        "its own pose in map (tf, from zteam-tf)",
    ]
    whole = make_view(make_scan(FREE), lookup=lambda _a, _b: (Pose2(0.0, 0.0, 0.0), 1))
    assert missing(whole, asks(0.0)) == []


@pytest.mark.parametrize(
    ("returned", "text"),
    [
        (None, "Circle.step returned None; return a Twist"),
        (0.4, "Circle.step returned a float; return a Twist"),
        (Twist(Vector3("0.2")), "Circle.step returned the speed '0.2'; give numbers, m/s and rad/s"),  # type: ignore[arg-type]
        (
            Twist(0.3, 0.1),  # type: ignore[arg-type]
            "Circle.step returned Twist(linear=0.3, angular=0.1); return a Twist(Vector3(forward), Vector3(z=turn))",
        ),
    ],
)
def test_a_step_that_returns_no_twist_is_told_on_one_line(returned: object, text: str) -> None:
    """The error names the behaviour, what it returned and what it has to return."""

    class Circle(Behavior):
        def step(self, view: View) -> Any:
            return returned

    with pytest.raises(ZteamError) as caught:
        decide(Circle(None), make_view(make_scan([9.0] * 31)))
    assert str(caught.value) == text
    assert caught.value.exit_code == 1
