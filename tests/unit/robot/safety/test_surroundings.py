"""What a robot knows around it: beams that say nothing, and teammates."""

import math

import numpy as np
import pytest

from support.flat_floor import TICK, make_odometry, make_scan, make_view
from zteam.behaviors import SafetyLayer, View
from zteam.geometry import Pose2
from zteam.messages import LaserScan, Twist, Vector3
from zteam.messages.base import DEFAULT_BASE, Base

START = 100 * TICK
TEAMMATE_GAP, FOLLOWING_GAP, MAX_GROWTH = 0.3, 0.1, 0.5
"""Metres: to a teammate, behind one that drives away, and by which the outline of one grows whose pose is old."""
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


def test_odometry_that_is_no_number_at_the_start_hides_no_silent_beam() -> None:
    """As long as none has come that is one, nothing is known."""
    view = make_view(scan_with(math.nan, 5.0, 0.0, TICK), odom=make_odometry(Pose2(math.nan, 0.0, 0.0)))
    command, why = SafetyLayer().limit(Twist(Vector3(0.4)), view)
    assert (command.linear.x, why) == (0.0, "blind ahead")


@pytest.mark.parametrize("value", [math.inf, 30.0, 20.0])
def test_no_hit_is_a_free_way(value: float) -> None:
    """Beams that met nothing are free space."""
    assert drive(value, 5.0) == [(0.4, "")] * 10


def test_the_last_word_of_a_beam_counts_for_half_a_second() -> None:
    """A short silence stops no robot; a longer one does."""
    found = drive(math.nan, 5.0, free_ticks=3)
    assert [speed for speed, _ in found] == [0.4] * 5 + [0.0] * 5


@pytest.mark.parametrize(("half_deg", "speed"), [(0.0, 0.4), (0.5, 0.0)])
def test_one_silent_beam_is_bridged(half_deg: float, speed: float) -> None:
    """One beam of half a degree between two that speak hides nothing that a robot could hit; three do."""
    assert drive(math.nan, half_deg)[-1][0] == speed


@pytest.mark.parametrize(("is_mate", "speed"), [(True, -0.2), (False, 0.0)])
def test_hits_on_a_teammate_do_not_stay_where_no_laser_looks(is_mate: bool, speed: float) -> None:
    """The robot saw it pass, turned, and it has driven on: the robot backs up. What else stood there may stand there
    still."""
    layer, bearing = SafetyLayer(), math.radians(130.0)
    for tick in range(8):
        now, yaw = START + tick * TICK, -0.7 if tick else 0.0
        at = Pose2(0.55 * math.cos(bearing), 0.55 * math.sin(bearing), 0.0) if tick < 3 else Pose2(5.0, 5.0, 0.0)
        frames = {"robot_0/base_footprint": (Pose2(0.0, 0.0, yaw), now)}
        frames |= {"robot_1/base_footprint": (at, now)} if is_mate else {}
        view = make_view(
            scan_with(0.35 if tick == 0 else 20.0, 4.0, 130.0, now),
            now=now,
            team=(0, 1),
            odom=make_odometry(Pose2(0.0, 0.0, yaw)),
            lookup=lambda _target, source, frames=frames: frames.get(source),
        )
        command, _ = layer.limit(Twist(Vector3(-0.4 if tick > 3 else 0.0)), view)
    assert command.linear.x == speed


def test_a_teammate_explains_dazzled_beams() -> None:
    """Beams around a teammate that stands far ahead are dazzled by its laser: the robot drives on; without the
    teammate, or where the stamp of its pose is 2 s off, they hide the way."""
    for team, off, expected in (((0, 1), 0, 0.4), ((0,), 0, 0.0), ((0, 1), 20 * TICK, 0.0), ((0, 1), -20 * TICK, 0.0)):
        layer = SafetyLayer()
        for tick in range(10):
            now = START + tick * TICK
            ahead = (Pose2(0.0, 0.0, 0.0), now), (Pose2(6.0, 0.0, 0.0), now + off)
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


LATER = 1000 * TICK
FRONT, REAR = 0.125, 0.225


def view(mate: Pose2, age: float = 0.0, tick: int = 0, mate_base: Base = DEFAULT_BASE) -> View:
    """Robot 0 at the map's origin with a free scan; robot 1 was at `mate` `age` seconds ago."""
    now = LATER + tick * TICK
    poses = {"robot_0": (Pose2(0.0, 0.0, 0.0), now), "robot_1": (mate, now - round(age * 1e9))}
    return make_view(
        make_scan([30.0] * 361, now, math.tau),
        now=now,
        team=(0, 1),
        bases={1: mate_base},
        lookup=lambda target, source: poses[source.split("/")[0]],
    )


def stops_at(speed: float, behind: bool = False, age: float = 0.0) -> float:
    """The largest distance between both outlines, to the centimetre, at which robot 0 does not begin to move."""
    for centimetre in range(200):
        away = centimetre / 100
        x = -(away + REAR + FRONT) if behind else away + FRONT + REAR
        command, _ = SafetyLayer().limit(Twist(Vector3(speed)), view(Pose2(x, 0.0, 0.0), age))
        if command.linear.x:
            return away - 0.01
    raise AssertionError("it never moves")


def test_it_stops_before_a_teammate_that_no_beam_shows() -> None:
    """At 0.3 m, forwards and backwards."""
    assert stops_at(0.2) == pytest.approx(TEAMMATE_GAP, abs=0.05)
    assert stops_at(-0.2, behind=True) == pytest.approx(TEAMMATE_GAP, abs=0.05)


def test_the_outline_grows_with_the_age_of_the_pose() -> None:
    """By 0.25 m/s from 0.3 s on, up to half a metre; after 5 s the teammate counts as gone."""
    fresh = stops_at(0.2)
    assert stops_at(0.2, age=0.3) == fresh
    assert stops_at(0.2, age=1.3) == pytest.approx(fresh + 0.25, abs=0.011)
    assert stops_at(0.2, age=4.9) == pytest.approx(fresh + MAX_GROWTH, abs=0.011)
    assert SafetyLayer().limit(Twist(Vector3(0.2)), view(Pose2(0.5, 0.0, 0.0), 5.1))[0].linear.x == 0.2


def least_distance(gap: float, *steps: float, speed: float = 0.2) -> float:
    """The largest x, to the centimetre, up to which robot 0 does not begin to move at `speed`, where a teammate has
    come by `steps` (m) of a tick each: to x from the outline, in the last tick. `gap` is where the search begins."""
    for centimetre in range(round(100 * gap), 200):
        layer, x = SafetyLayer(), centimetre / 100 + FRONT + REAR
        for tick in range(len(steps) + 1):
            at = Pose2(x - sum(steps[tick:]), 0.0, 0.0)
            command, _ = layer.limit(Twist(Vector3(speed if tick == len(steps) else 0.0)), view(at, tick=tick))
        if command.linear.x:
            return centimetre / 100 - 0.01
    raise AssertionError("it never moves")


def test_a_moving_teammate_takes_up_its_way() -> None:
    """One that comes nearer at 0.7 m/s takes up the way until it can stand, with 1 m/s² from the next step on; one that
    drives away takes up its place, and may be come nearer to."""
    stands = least_distance(0.0)
    way = 0.7 * 0.1 + 0.5 * 0.7**2
    assert least_distance(0.0, -0.07) == pytest.approx(stands + way, abs=0.011)
    assert least_distance(0.0, 0.07) == pytest.approx(stands - (TEAMMATE_GAP - FOLLOWING_GAP), abs=0.011)


def test_a_teammates_own_outline_counts() -> None:
    """A long one is stopped before earlier, whatever the robot itself is."""
    long = Base(footprint=((0.9, 0.2), (-0.9, 0.2), (-0.9, -0.2), (0.9, -0.2)))
    command, why = SafetyLayer().limit(Twist(Vector3(0.2)), view(Pose2(1.3, 0.0, 0.0), mate_base=long))
    assert (command.linear.x, why) == (0.0, "robot_1 ahead")
    assert SafetyLayer().limit(Twist(Vector3(0.2)), view(Pose2(1.3, 0.0, 0.0)))[0].linear.x == 0.2


@pytest.mark.parametrize("tick", [0.1, 1.0])
def test_two_robots_that_close_in_stop_apart(tick: float) -> None:
    """Both at 1 m/s, and each commanded once a tick: however long it is."""
    layer, own, other, mates = SafetyLayer(), 0.0, 10.0, 1.0
    for step in range(round(30.0 / tick)):
        now = LATER + round(step * tick * 1e9)

        def look(target: str, source: str, now: int = now, own: float = own, other: float = other) -> tuple[Pose2, int]:
            return Pose2(other if source.startswith("robot_1") else own, 0.0, 0.0), now

        scan = make_scan([30.0] * 361, now, math.tau)
        command, why = layer.limit(Twist(Vector3(1.0)), make_view(scan, now=now, dt=tick, team=(0, 1), lookup=look))
        own += tick * command.linear.x
        # It brakes with 1 m/s² when it is within its own way to stand.
        room = other - own - FRONT - REAR - TEAMMATE_GAP
        mates = min(mates, max(0.0, math.sqrt(tick**2 + 2.0 * max(0.0, room - 0.5)) - tick))
        other -= tick * mates
        assert other - own - FRONT - REAR >= TEAMMATE_GAP - 0.01
    assert why == "robot_1 ahead"
