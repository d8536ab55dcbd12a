"""escape: a robot that has to turn on the spot and cannot moves back, then forward."""

import pytest

from support.flat_floor import TICK, make_odometry, make_view
from zteam.behaviors.escape import Escape
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3

TURN = Twist(angular=Vector3(z=1.0))


def free(turned: float, command: Twist, ticks: int) -> list[Twist]:
    """What it is told in so many ticks while it turns `turned` rad in each."""
    escape = Escape()
    return [ask(escape, i, turned * i, command) for i in range(1, ticks + 1)]


def ask(escape: Escape, tick: int, yaw: float, command: Twist) -> Twist:
    """What it is told in one tick."""
    odom = make_odometry(Pose2(1.0, 2.0, yaw))
    return escape.free(make_view(now=tick * TICK, odom=odom), command)


def test_a_robot_that_cannot_turn_moves_back_and_then_forward() -> None:
    """It tries for a second and a half, moves for a second at 0.2 m/s, and tries again; the other way next."""
    told = free(0.0, TURN, 80)
    moves = [command.linear.x for command in told if command != TURN]
    ways = [way for i, way in enumerate(moves) if i == 0 or way != moves[i - 1]]
    assert ways == [-0.2, 0.2, -0.2]
    assert moves.count(0.2) in (9, 10)
    first = next(i for i, command in enumerate(told) if command != TURN)
    assert 1.4 <= 0.1 * first <= 1.8
    assert all(command.angular.z == 0.0 for command in told if command != TURN)


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
