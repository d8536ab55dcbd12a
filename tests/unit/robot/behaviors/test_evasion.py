"""Getting past what stands between, and free where there is no room to turn."""

import math
from itertools import groupby

import pytest

from support.flat_floor import BEAMS, TICK, make_odometry, make_scan, make_view
from zteam.behaviors import View
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.robot.behaviors.evasion import Around, Escape
from zteam.robot.behaviors.path import SpeedLimits

LIMITS = SpeedLimits(0.7, math.pi)


def look(*mates: tuple[float, float]) -> View:
    """An open floor with the robots 1, 2, ... at these places of the own base frame."""
    frames = {f"robot_{i}/base_footprint": (Pose2(x, y, 0.0), 0) for i, (x, y) in enumerate(mates, 1)}
    team = tuple(range(len(mates) + 1))
    return make_view(make_scan([30.0] * BEAMS), lookup=lambda _target, source: frames.get(source), team=team)


def go(view: View, x: float, y: float, but: int | None = None, room: float = 0.0) -> Twist:
    """One step towards (x, y)."""
    return Around().drive_to(view, x, y, LIMITS, but, room)


def test_a_free_way_is_driven_straight() -> None:
    """By the lectures' law, as fast as its limits allow."""
    command = go(look(), 1.0, 0.1)
    assert command.linear.x == pytest.approx(0.5 * math.hypot(1.0, 0.1))
    assert command.angular.z == pytest.approx(4.0 * math.atan2(0.1, 1.0))
    assert go(look(), 9.0, 0.0).linear.x == LIMITS.linear
    assert go(look(), 0.1, 1.0).angular.z == LIMITS.angular


@pytest.mark.parametrize("y", [0.2, -0.2])
def test_a_robot_in_the_way_is_passed_on_the_side_with_more_room(y: float) -> None:
    """Slower than on a free way."""
    command = go(look((0.9, y)), 3.0, 0.0)
    assert command.angular.z * y < 0.0
    assert command.linear.x < LIMITS.linear


def test_the_robot_that_is_driven_to_is_not_in_the_way() -> None:
    """Nor is one that stands beyond the place."""
    assert go(look((0.9, 0.0)), 0.9, 0.0, but=1).angular.z == 0.0
    assert go(look((0.9, 0.0)), 0.9, 0.0).angular.z != 0.0
    assert go(look((0.9, 0.0)), 0.4, 0.0).angular.z == 0.0


def test_it_keeps_the_side_until_the_way_is_clear() -> None:
    """Where the robot in the way is a little on the other side now, it goes on to the same side."""
    around = Around()
    first = around.drive_to(look((0.9, -0.05)), 3.0, 0.0, LIMITS)
    assert first.angular.z > 0.0
    assert around.drive_to(look((0.9, 0.05)), 3.0, 0.0, LIMITS).angular.z > 0.0
    around.drive_to(look(), 3.0, 0.0, LIMITS)
    assert around.drive_to(look((0.9, 0.1)), 3.0, 0.0, LIMITS).angular.z < 0.0


TURN = Twist(angular=Vector3(z=1.0))


def ask(escape: Escape, tick: int, yaw: float, command: Twist, x: float = 0.0) -> Twist:
    """What it is told in one tick."""
    return escape.free(make_view(now=tick * TICK, odom=make_odometry(Pose2(x, 2.0, yaw))), command)


def free(turned: float, command: Twist, ticks: int) -> list[Twist]:
    """What it is told in so many ticks while it turns `turned` rad in each."""
    escape = Escape()
    return [ask(escape, i, turned * i, command) for i in range(1, ticks + 1)]


def told_ways(room: float) -> list[tuple[float, int]]:
    """Which way a robot moves that cannot turn, and for how many ticks; a wall is `room` metres behind it."""
    escape, x, moves = Escape(), 0.0, []
    for tick in range(1, 80):
        command = ask(escape, tick, 0.0, TURN, x)
        assert command.linear.x == 0.0 or command.angular.z == 0.0
        moves.append(command.linear.x)
        x = max(-room, x + 0.1 * command.linear.x)
    return [(way, len(list(same))) for way, same in groupby(moves)]


def test_a_robot_that_cannot_turn_moves_back_and_then_forward() -> None:
    """It tries for a second, moves for a second at 0.2 m/s, and tries again; the other way next."""
    assert told_ways(room=10.0)[:6] == [(0.0, 11), (-0.2, 9), (0.0, 12), (0.2, 9), (0.0, 12), (-0.2, 9)]


def test_a_robot_that_has_no_room_behind_it_moves_forward_at_once() -> None:
    """It notices within 0.4 s that it does not move."""
    assert told_ways(room=0.0)[:3] == [(0.0, 11), (-0.2, 3), (0.2, 6)]


@pytest.mark.parametrize("turned", [0.1, -0.1, 0.01])
def test_a_robot_that_turns_is_left_alone(turned: float) -> None:
    """Also one that turns slowly."""
    assert free(turned, TURN, 80) == [TURN] * 80


@pytest.mark.parametrize("command", [Twist(), Twist(Vector3(0.3)), Twist(Vector3(0.01), Vector3(z=1.0))])
def test_a_robot_that_need_not_turn_on_the_spot_is_left_alone(command: Twist) -> None:
    """It stands, or drives: what keeps it there is not the room to turn."""
    assert free(0.0, command, 80) == [command] * 80
