"""Velocities from two look-ups, and poses through transforms that tilt."""

import math

import numpy as np
import pytest

from support.transforms import S, stamped
from zteam.geometry import quaternion_from_rpy
from zteam.messages import (
    Header,
    LaserScan,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
    ns_from_time,
    time_from_ns,
)
from zteam.tf import BackwardExtrapolationException, Buffer, InvalidArgumentException, LookupException
from zteam.transforms.rigid import Floats, compose


def _tilted() -> tuple[Buffer, Floats]:
    """A buffer with a tilted map → tool at 1 s, and that transform as floats."""
    numbers: Floats = (1.0, 2.0, 3.0, *quaternion_from_rpy(0.3, -0.8, 2.0))
    buffer = Buffer()
    pose = Transform(Vector3(*numbers[:3]), Quaternion(*numbers[3:]))
    buffer.set_transform(TransformStamped(Header(time_from_ns(S), "map"), "tool", pose), "test")
    return buffer, numbers


def test_a_pose_in_another_frame() -> None:
    """The pose is multiplied by the transform and has the look-up's stamp; the way back restores it."""
    buffer, map_from_tool = _tilted()
    tool_from_thing: Floats = (0.5, -0.25, 0.125, *quaternion_from_rpy(1.0, 0.2, -0.4))
    pose = Pose(Point(*tool_from_thing[:3]), Quaternion(*tool_from_thing[3:]))
    moved = buffer.transform_pose(PoseStamped(Header(frame_id="tool"), pose), "map")
    p, q = moved.pose.position, moved.pose.orientation
    assert (p.x, p.y, p.z, q.x, q.y, q.z, q.w) == pytest.approx(compose(map_from_tool, tool_from_thing))
    assert (moved.header.frame_id, ns_from_time(moved.header.stamp)) == ("map", S)
    back = buffer.transform_pose(moved, "tool").pose
    assert (back.position.x, back.position.y, back.position.z) == pytest.approx(tool_from_thing[:3])
    assert (back.orientation.z, back.orientation.w) == pytest.approx(tool_from_thing[5:])


def test_a_scan_in_the_map() -> None:
    """Each beam's end is transformed at the scan's own stamp; a beam without a hit is NaN."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("base", "laser", 0, 0.5), "test")
    buffer.set_transform(stamped("map", "base", S, 0.0, 0.0, 0.0), "test")
    buffer.set_transform(stamped("map", "base", 3 * S, 0.0, 4.0, math.pi), "test")
    ranges = np.array([1.0, 2.0, 0.05, 8.0, math.inf, math.nan, 3.0], np.float32)
    scan = LaserScan(
        Header(time_from_ns(2 * S), "laser"), -math.pi / 2, math.pi, math.pi / 4, range_min=0.1, range_max=8.0
    )
    scan.ranges = ranges
    ends = buffer.transform_scan(scan, "map")
    assert ends.shape == (7, 3)
    # At 2 s the base is at (0, 2) and looks along y, so the laser is at (0, 2.5).
    assert ends[0] == pytest.approx((1.0, 2.5, 0.0), abs=1e-6)
    assert ends[1] == pytest.approx((math.sqrt(2.0), 2.5 + math.sqrt(2.0), 0.0), abs=1e-6)
    assert np.isnan(ends[2:6]).all()
    assert ends[6] == pytest.approx((0.0, -0.5, 0.0), abs=1e-6)


def _moving(speed: float, turn_rate: float) -> Buffer:
    """map → base moves along y and rotates, at 10 Hz for 4 s; a rotated camera and an arm 1 m ahead are static."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "camera", 0, 1.0, 1.0, math.pi / 2), "test")
    buffer.set_transform_static(stamped("base", "arm", 0, 1.0), "test")
    for tick in range(41):
        t = tick / 10
        buffer.set_transform(stamped("map", "base", S + tick * S // 10, 0.0, speed * t, turn_rate * t), "test")
    return buffer


def test_the_velocity_of_a_frame() -> None:
    """tf's velocity_test: a linear velocity in the map's axes and in those of a rotated observer."""
    buffer = _moving(3.0, 0.0)
    for time in (2 * S, 0):
        twist = buffer.lookup_twist("base", "map", time, 0.2)
        assert (twist.linear.x, twist.linear.y, twist.linear.z) == pytest.approx((0.0, 3.0, 0.0), abs=1e-9)
        assert twist.angular == Vector3()
    seen = buffer.lookup_twist("base", "camera", 2 * S, 0.2)
    assert (seen.linear.x, seen.linear.y) == pytest.approx((3.0, 0.0), abs=1e-9)


def test_the_velocity_of_a_turning_frame() -> None:
    """tf's transform_twist_test: rotation moves an offset frame at right angles to its offset."""
    buffer = _moving(0.0, 0.5)
    twist = buffer.lookup_twist("base", "map", 3 * S, 0.2)
    assert twist.angular.z == pytest.approx(0.5)
    assert twist.linear.x == pytest.approx(0.0, abs=1e-12)
    arm = buffer.lookup_twist("arm", "map", 3 * S, 0.02)
    yaw = 0.5 * 2.0
    assert (arm.linear.x, arm.linear.y) == pytest.approx((-0.5 * math.sin(yaw), 0.5 * math.cos(yaw)), abs=1e-3)
    assert buffer.lookup_twist("arm", "base", 3 * S, 0.2).linear == Vector3()


@pytest.mark.parametrize("rate", [-2.0, 2.0])
def test_the_velocity_through_half_a_circle(rate: float) -> None:
    """The velocity stays the same where the yaw jumps from pi to -pi."""
    buffer = _moving(0.0, rate)
    for tick in range(5, 36):
        assert buffer.lookup_twist("base", "map", S + tick * S // 10, 0.4).angular.z == pytest.approx(rate)


def test_a_velocity_about_any_axis() -> None:
    """The angular velocity is expressed in the observer's axes, not in the tracked frame's."""
    buffer = Buffer()
    for tick in range(11):
        pose = Transform(Vector3(), Quaternion(*quaternion_from_rpy(0.3 * tick / 10, 0.0, math.pi / 2)))
        buffer.set_transform(TransformStamped(Header(time_from_ns(S + tick * S // 10), "map"), "base", pose), "test")
    # R = Rz(yaw) Rx(roll): the base's own x axis is the map's y axis.
    twist = buffer.lookup_twist("base", "map", 3 * S // 2, 0.2)
    assert (twist.angular.x, twist.angular.y, twist.angular.z) == pytest.approx((0.0, 0.3, 0.0), abs=1e-9)


def test_a_velocity_ends_with_the_data() -> None:
    """The interval is moved back to end at the latest data; an interval before the data raises an exception."""
    buffer = _moving(3.0, 0.0)
    assert buffer.lookup_twist("base", "map", 99 * S, 0.5).linear.y == pytest.approx(3.0)
    with pytest.raises(BackwardExtrapolationException):
        buffer.lookup_twist("base", "map", S, 0.5)
    with pytest.raises(InvalidArgumentException, match="averaging interval"):
        buffer.lookup_twist("base", "map", 0, 0.0)
    with pytest.raises(LookupException):
        buffer.lookup_twist("nowhere", "map", 0, 0.5)
    assert buffer.lookup_twist("camera", "map", 0, 0.5).linear == Vector3()
