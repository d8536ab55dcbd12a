"""Planar poses as transforms, for poses of every kind."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from zteam.geometry import Pose2

metres = st.floats(-1e3, 1e3, allow_subnormal=False)
poses = st.builds(Pose2, metres, metres, st.floats(-20.0, 20.0))
IDENTITY = Pose2(0.0, 0.0, 0.0)


def matrix(pose: Pose2) -> tuple[float, ...]:
    """The pose as its numbers without the jump of the yaw at pi."""
    return pose.x, pose.y, math.cos(pose.yaw), math.sin(pose.yaw)


def near(pose: Pose2) -> object:
    """Equal up to rounding, yaws that differ by full turns included."""
    return pytest.approx(matrix(pose), abs=1e-9)


@given(poses)
def test_the_inverse_undoes_a_pose_from_both_sides(a: Pose2) -> None:
    """There and back again is no motion, and the inverse of the inverse is the pose itself."""
    assert matrix(a.compose(a.inverse())) == near(IDENTITY)
    assert matrix(a.inverse().compose(a)) == near(IDENTITY)
    assert matrix(a.inverse().inverse()) == near(a)


@given(poses, metres, metres)
def test_composition_rotates_and_then_translates_a_point(pose: Pose2, x: float, y: float) -> None:
    """The position is that of a rotation by complex multiplication; a pose of no motion changes nothing."""
    place = complex(pose.x, pose.y) + complex(x, y) * complex(math.cos(pose.yaw), math.sin(pose.yaw))
    found = pose.compose(Pose2(x, y, 0.0))
    assert (found.x, found.y) == pytest.approx((place.real, place.imag), abs=1e-9)
    assert matrix(pose.compose(IDENTITY)) == matrix(IDENTITY.compose(pose)) == near(pose)


@given(poses, poses)
def test_the_yaw_stays_within_one_turn(a: Pose2, b: Pose2) -> None:
    """Yaws do not grow with the length of a chain: they are in (-pi, pi]."""
    for yaw in (a.compose(b).yaw, a.inverse().yaw):
        assert -math.pi < yaw <= math.pi
