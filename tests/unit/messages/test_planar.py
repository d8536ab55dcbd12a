"""Poses of messages in the plane."""

import math

import pytest

from zteam.geometry import Pose2
from zteam.messages import Point, Pose, Quaternion
from zteam.messages.planar import pose2_of, pose_message


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
