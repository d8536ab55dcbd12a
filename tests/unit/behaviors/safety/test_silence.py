"""Beams that say nothing are not free space: for a moment their last word counts."""

import math

import numpy as np
import pytest

from support.flat_floor import TICK, make_odometry, make_scan, make_view
from zteam.behaviors import SafetyLayer
from zteam.geometry import Pose2
from zteam.messages import LaserScan, Twist, Vector3

START = 100 * TICK
BEAMS = 541
"""Of half a degree each."""


def scan_with(value: float, half_deg: float, bearing_deg: float, now: int) -> LaserScan:
    """A free scan whose beams within `half_deg` of a bearing say `value`."""
    ranges = np.full(BEAMS, 20.0)
    middle = BEAMS // 2 + round(2 * bearing_deg)
    ranges[max(0, middle - round(2 * half_deg)) : middle + round(2 * half_deg) + 1] = value
    scan = make_scan(ranges, now, math.radians(270.0))
    scan.range_min = 0.2
    return scan


def drive(value: float, half_deg: float, bearing_deg: float = 0.0, free_ticks: int = 0) -> list[tuple[float, str]]:
    """What is left of 0.4 m/s straight on, and why, after so many steps with a free scan."""
    layer, found = SafetyLayer(), []
    for tick in range(free_ticks + 10):
        now = START + tick * TICK
        scan = scan_with(20.0 if tick < free_ticks else value, half_deg, bearing_deg, now)
        command, why = layer.limit(Twist(Vector3(0.4)), make_view(scan, now=now))
        found.append((command.linear.x, why))
    return found[free_ticks:]


@pytest.mark.parametrize("value", [math.nan, 0.0, 0.1, -1.0, 31.0])
def test_a_silent_way_is_no_free_way(value: float) -> None:
    """NaN, 0, below range_min, below 0, beyond range_max: the robot stands as long as such beams point into its way."""
    assert drive(value, 5.0) == [(0.0, "blind ahead")] * 10


@pytest.mark.parametrize("value", [math.inf, 30.0, 20.0])
def test_no_hit_is_a_free_way(value: float) -> None:
    """Beams that met nothing are free space."""
    assert drive(value, 5.0) == [(0.4, "")] * 10


def test_the_last_word_of_a_beam_counts_for_half_a_second() -> None:
    """A short silence stops no robot; a longer one does."""
    found = drive(math.nan, 5.0, free_ticks=3)
    assert [speed for speed, _ in found] == [0.4] * 5 + [0.0] * 5


@pytest.mark.parametrize("bearing_deg", [100.0, -120.0])
def test_silent_beams_to_the_side_stop_nobody(bearing_deg: float) -> None:
    """Only what points into the way counts."""
    assert drive(math.nan, 10.0, bearing_deg) == [(0.4, "")] * 10


@pytest.mark.parametrize(("half_deg", "speed"), [(0.0, 0.4), (0.5, 0.0)])
def test_one_silent_beam_is_bridged(half_deg: float, speed: float) -> None:
    """One beam of half a degree between two that speak hides nothing that a robot could hit; three do."""
    assert drive(math.nan, half_deg)[-1][0] == speed


def test_a_teammate_explains_dazzled_beams() -> None:
    """Beams around a teammate that stands far ahead are dazzled by its laser: the robot drives on; without the
    teammate they hide the way."""
    for team, expected in (((0, 1), 0.4), ((0,), 0.0)):
        layer = SafetyLayer()
        for tick in range(10):
            now = START + tick * TICK
            ahead = (Pose2(0.0, 0.0, 0.0), now), (Pose2(6.0, 0.0, 0.0), now)
            view = make_view(
                scan_with(math.nan, 2.0, 0.0, now),
                now=now,
                team=team,
                lookup=lambda target, source, ahead=ahead: ahead[source.startswith("robot_1")],
            )
            command, _ = layer.limit(Twist(Vector3(0.4)), view)
        assert command.linear.x == expected


def test_beams_that_are_silent_from_the_start_stay_silent_when_it_turns() -> None:
    """What a beam said, it said of its bearing then: a robot that turns into bearings that no beam has seen stands."""
    layer, left = SafetyLayer(), []
    for tick in range(12):
        now, yaw = START + tick * TICK, 0.1 * tick
        ranges = np.full(BEAMS, 20.0)
        # Silent is what lies to the left of 70 degrees in `odom`.
        ranges[np.linspace(-0.75 * math.pi, 0.75 * math.pi, BEAMS) + yaw > math.radians(70.0)] = math.nan
        view = make_view(make_scan(ranges, now, math.radians(270.0)), now=now, odom=make_odometry(Pose2(0.0, 0.0, yaw)))
        command, why = layer.limit(Twist(Vector3(0.4)), view)
        left.append((command.linear.x, why))
    assert left[0] == (0.4, "")
    assert left[-3:] == [(0.0, "blind ahead")] * 3
    assert {speed for speed, _ in left} == {0.4, 0.0}
