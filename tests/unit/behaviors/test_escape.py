"""escape: a robot that has to turn on the spot and cannot moves back, then forward."""

from itertools import groupby

import pytest

from support.flat_floor import TICK, make_odometry, make_view
from zteam.behaviors.escape import Escape
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3

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


def test_the_time_before_it_wanted_to_turn_does_not_count() -> None:
    """A robot that begins to turn late, and turns, is left alone."""
    escape = Escape()
    told = [ask(escape, 100 + i, 0.1 * i, TURN) for i in range(20)]
    assert told == [TURN] * 20
