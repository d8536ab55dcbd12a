"""When a robot drives back from those ahead, and when it leaves its trail and takes it again."""

import math

import pytest

from zteam.geometry import Pose2
from zteam.messages import RobotStatus, Twist, Vector3
from zteam.robot.behaviors.evasion import (
    FRUITLESS,
    MakingRoom,
    back_up,
    find_stopped,
    is_too_near,
)
from zteam.robot.behaviors.line import LineRole
from zteam.robot.behaviors.path import Polyline, SpeedLimits
from zteam.testing import make_view

LIMITS = SpeedLimits(0.7, math.pi)
AHEAD = Pose2(5.0, 0.0, 0.0)
"""The head, which drives away."""
GAP = 0.8
"""Metres to the place behind it."""
WAY = Polyline([(-5.0, 0.0), (5.0, 0.0)])


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


def step(
    room: MakingRoom,
    seconds: float,
    x: float = 1.0,
    *,
    head: Pose2 = AHEAD,
    blocked_by: int = -1,
    wants: bool = True,
    turns: int = 0,
    driven_on: float = 0.0,
) -> tuple[Twist, str] | None:
    """What robot 1 does at x on the x axis, in a large hall. Its head (in the own base frame) may be blocked by it."""
    view = make_view(
        [5.0] * 180, now=seconds, poses={0: head, 1: (0.0, 0.0, 0.0)}, robot_id=1,
        inputs={"statuses": {0: RobotStatus(blocked_by=blocked_by)}},
    )  # fmt: skip
    own, place = Pose2(x, 0.0, 0.0), LineRole((0,), turns=turns)
    command, does = room.step(
        view, own, place, GAP, LIMITS, find_stopped(view), keeps=True, wants=wants, driven_on=driven_on
    )
    return (command or back_up(own, WAY, 5.0 + x), does) if does else None


def test_a_robot_between_two_ends_that_get_on_no_more_leaves_its_trail() -> None:
    """It waits in its place while the line turns once; after the second turn it goes, until it has moved 0.5 m."""
    room = MakingRoom()
    assert step(room, 1.0, wants=False) is None
    assert step(room, 1.1, wants=False, turns=FRUITLESS - 1) is None
    assert step(room, 1.2, wants=False, turns=FRUITLESS) == (Twist(Vector3(0.4)), "is stuck: leaves its way")
    assert step(room, 1.3, 1.6, wants=False, turns=FRUITLESS) is None
    assert step(room, 1.4, 1.6, wants=False, turns=FRUITLESS + 1) is None


def test_a_robot_in_the_way_of_its_head_drives_back_until_that_has_room() -> None:
    """It begins when its head says that this robot stops it, and goes on while the head is within 1 m."""
    room, near, far = MakingRoom(), Pose2(0.7, 0.0, 0.0), Pose2(1.1, 0.0, 0.0)
    assert step(room, 1.0, head=near, wants=False) is None
    told = step(room, 1.1, head=near, blocked_by=1, wants=False)
    assert told == (Twist(Vector3(-0.2)), "makes room for robot_0")
    assert step(room, 1.2, head=near, wants=False) == told
    assert step(room, 1.3, head=far, wants=False) is None
    assert step(room, 1.4, head=near, wants=False) is None
