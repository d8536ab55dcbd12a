"""Poses of messages in the plane."""

import math

import pytest

from support.log_capture import captured_log
from zteam.clock import Every
from zteam.geometry import Pose2
from zteam.messages import Point, Pose, Quaternion, Twist, Vector3
from zteam.messages import planar as planar_module
from zteam.messages.planar import checked_command, pose2_of, pose_message


def test_a_pose_is_the_same_after_its_message() -> None:
    """Place and heading of a quarter turn are those of REP 103: x forward, y to the left, about z by the right hand."""
    quarter = pose_message(Pose2(1.0, -2.0, math.pi / 2))
    half = math.sqrt(0.5)
    assert quarter.position == Point(1.0, -2.0, 0.0)
    assert (quarter.orientation.z, quarter.orientation.w) == pytest.approx((half, half))
    assert pose2_of(quarter) == pytest.approx((1.0, -2.0, math.pi / 2))


def test_a_pose_that_leans_keeps_its_heading() -> None:
    """Of a roll by half a turn about the axis ahead the heading is left, and of the height nothing."""
    assert pose2_of(Pose(Point(3.0, 4.0, 5.0), Quaternion(1.0, 0.0, 0.0, 0.0))) == pytest.approx((3.0, 4.0, 0.0))


@pytest.mark.parametrize(("rate", "told"), [(45.0, 1), (-90.0, 1), (6.2, 0), (float("nan"), 0)])
def test_a_turn_rate_in_degrees_is_told_once(rate: float, told: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A rate above a full turn a second is most likely meant in degrees. It is handed on as it is."""
    monkeypatch.setattr(planar_module, "_MAY_WARN", Every(60.0))
    with captured_log() as log:
        for _ in range(3):
            assert checked_command(Twist(angular=Vector3(z=rate)), "Mine.step").angular.z is rate
    assert log.count("Mine.step") == log.count("radians") == told
