"""line_room: when a robot drives back from the one ahead, and when it leaves its trail and takes it again."""

import math

import pytest

from zteam.behaviors.line_room import MakingRoom, back_up, is_too_near
from zteam.behaviors.polyline import Polyline
from zteam.behaviors.pursuit import Limits
from zteam.geometry import Pose2
from zteam.messages import Twist, Vector3
from zteam.testing import make_view

LIMITS = Limits(0.7, math.pi)
AHEAD = Pose2(5.0, 0.0, 0.0)
"""The head, which drives away."""
BACK = 0.8
"""Metres to the place behind it."""


@pytest.mark.parametrize(
    ("ahead", "found"),
    [
        (Pose2(0.5, 0.0, 0.0), True),
        (Pose2(0.7, 0.0, 0.0), False),
        (Pose2(0.9, 0.0, math.pi), True),
        (Pose2(1.1, 0.0, math.pi), False),
        (Pose2(0.8, 0.5, math.pi), False),
        (Pose2(-0.5, 0.0, 0.0), False),
    ],
)
def test_it_drives_back_from_what_is_near_or_comes_towards_it(ahead: Pose2, found: bool) -> None:
    """Within 0.58 m, or 1 m of a robot that has this one ahead and is not beside it; never from one behind it."""
    assert is_too_near(ahead) is found


@pytest.mark.parametrize(("side", "turn"), [(0.0, 0.0), (0.3, -0.8), (-0.3, 0.8)])
def test_it_drives_back_along_its_way(side: float, turn: float) -> None:
    """Where the way behind it bends, it turns so that its back follows: to the right for a bend to the left."""
    way = Polyline([(0.0, side), (0.6, side), (1.0, 0.0)])
    command = back_up(Pose2(1.0, 0.0, 0.0), way, way.project(1.0, 0.0))
    assert command.linear.x == -0.2
    assert command.angular.z == pytest.approx(turn, abs=0.1)


def test_a_robot_that_is_late_and_stuck_leaves_its_trail_until_it_is_free() -> None:
    """It follows for 3 s where it stands, then drives as a head does, and follows again 0.5 m from there."""
    room, here = MakingRoom(), Pose2(1.0, 0.0, 0.0)
    commands = []
    for tick in range(60):
        view = make_view([5.0] * 180, now=1.0 + 0.1 * tick)
        commands.append(room.step(view, here, AHEAD, BACK, LIMITS, is_late=True))
    left = next(tick for tick, command in enumerate(commands) if command is not None)
    assert left == 31
    assert commands[left] == Twist(Vector3(0.4))
    view = make_view([5.0] * 180, now=8.0)
    assert room.step(view, Pose2(1.6, 0.0, 0.0), AHEAD, BACK, LIMITS, is_late=True) is not None
    assert room.step(view, Pose2(1.6, 0.0, 0.0), AHEAD, BACK, LIMITS, is_late=True) is None


def test_a_robot_that_waits_does_not_leave_its_trail() -> None:
    """One that is in its place, or waits for another one, may stand for as long as it has to."""
    room = MakingRoom()
    for tick in range(100):
        view = make_view([5.0] * 180, now=1.0 + 0.1 * tick)
        assert room.step(view, Pose2(1.0, 0.0, 0.0), AHEAD, BACK, LIMITS, is_late=False) is None
