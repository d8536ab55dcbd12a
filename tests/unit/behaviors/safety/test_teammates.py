"""Teammates that no laser sees: their outlines where transforms say that they are, growing with the age of the pose."""

import math

import pytest

from support.flat_floor import TICK, make_scan, make_view
from zteam.base import DEFAULT_BASE, Base
from zteam.behaviors import SafetyLayer, View
from zteam.behaviors.safety.swept import outline_of
from zteam.behaviors.safety.teammates import FOLLOWING_GAP, GAP, MAX_GROWTH, Near, Teammates
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3

START = 1000 * TICK
FRONT, REAR, WIDE = 0.125, 0.225, 0.175


def view(mate: Pose2, age: float = 0.0, tick: int = 0, mate_base: Base = DEFAULT_BASE) -> View:
    """Robot 0 at the map's origin with a free scan; robot 1 was at `mate` `age` seconds ago."""
    now = START + tick * TICK
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
    assert stops_at(0.2) == pytest.approx(GAP, abs=0.05)
    assert stops_at(-0.2, behind=True) == pytest.approx(GAP, abs=0.05)


def test_the_outline_grows_with_the_age_of_the_pose() -> None:
    """By 0.25 m/s from 0.3 s on, up to half a metre; after 5 s the teammate counts as gone."""
    fresh = stops_at(0.2)
    assert stops_at(0.2, age=0.3) == fresh
    assert stops_at(0.2, age=1.3) == pytest.approx(fresh + 0.25, abs=0.011)
    assert stops_at(0.2, age=4.9) == pytest.approx(fresh + MAX_GROWTH, abs=0.011)
    assert SafetyLayer().limit(Twist(Vector3(0.2)), view(Pose2(0.5, 0.0, 0.0), 5.1))[0].linear.x == 0.2


def near(*places: Pose2, reach: float = 1.0, age: float = 0.0) -> Near | None:
    """What robot 0 makes of a teammate that was seen at these places, a tick apart."""
    mates, found = Teammates(), []
    for tick, place in enumerate(places):
        mates.look(view(place, age, tick))
        found = mates.near(0.0, 0.0, reach + outline_of(DEFAULT_BASE).radius, 0.1)
    return found[0] if found else None


def test_a_moving_teammate_takes_up_its_way() -> None:
    """One that comes nearer takes up the way until it can stand; one that drives away takes up its place, and may be
    come nearer to."""
    comes = near(Pose2(1.57, 0.0, math.pi), Pose2(1.5, 0.0, math.pi))
    assert comes is not None
    assert comes.gap == GAP
    way = 0.7 * 0.1 + 0.5 * 0.7**2
    assert comes.points[0].min() == pytest.approx(1.5 - FRONT - way)
    leaves = near(Pose2(0.83, 0.0, 0.0), Pose2(0.9, 0.0, 0.0))
    assert leaves is not None
    assert leaves.gap == FOLLOWING_GAP
    assert leaves.points[0].min() == pytest.approx(0.9 - REAR)
    assert leaves.points[1].max() == pytest.approx(WIDE)


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
        now = START + round(step * tick * 1e9)

        def look(target: str, source: str, now: int = now, own: float = own, other: float = other) -> tuple[Pose2, int]:
            return Pose2(other if source.startswith("robot_1") else own, 0.0, 0.0), now

        scan = make_scan([30.0] * 361, now, math.tau)
        command, why = layer.limit(Twist(Vector3(1.0)), make_view(scan, now=now, dt=tick, team=(0, 1), lookup=look))
        own += tick * command.linear.x
        # It brakes with 1 m/s² when it is within its own way to stand.
        room = other - own - FRONT - REAR - GAP
        mates = min(mates, max(0.0, math.sqrt(tick**2 + 2.0 * max(0.0, room - 0.5)) - tick))
        other -= tick * mates
        assert other - own - FRONT - REAR >= GAP - 0.01
    assert why == "robot_1 ahead"
