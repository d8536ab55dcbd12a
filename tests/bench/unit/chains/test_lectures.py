"""The lectures' follower keeps the faults that the comparison is about."""

import math

import pytest

from studies.chains.lectures import LecturesFollow, LecturesParams
from zteam.testing import make_view


def step(x: float, y: float):
    """The command with the leader at this place ahead."""
    view = make_view(robot_id=1, poses={0: (x, y, 0.0), 1: (0.0, 0.0, 0.0)})
    return LecturesFollow(LecturesParams(leader=0)).step(view)


def test_speed_grows_with_the_distance_up_to_a_limit() -> None:
    """v = 0.5 d, at most 0.7 m/s, and nothing within 0.8 m."""
    assert [step(x, 0.0).linear.x for x in (0.8, 1.0, 1.2, 5.0)] == [0.0, 0.5, 0.6, 0.7]


def test_turns_to_the_right_have_no_limit() -> None:
    """w = 4 atan2(y, x) is limited to the left alone, and a leader behind is driven away from."""
    assert step(0.0, 2.0).angular.z == 3.14
    assert step(0.0, -2.0).angular.z == pytest.approx(-2.0 * math.pi)
    assert step(-2.0, 0.0).linear.x == 0.7


def test_a_leader_that_is_gone_is_followed_on() -> None:
    """Without a transform it drives on by the last one."""
    behavior = LecturesFollow(LecturesParams(leader=0))
    there = make_view(robot_id=1, poses={0: (1.0, 0.0, 0.0), 1: (0.0, 0.0, 0.0)})
    assert behavior.step(there) == behavior.step(make_view(robot_id=1))
