"""Points, poses, vectors, scans and arrays in other frames, and the velocity of one frame as another one sees it."""

import math

import numpy as np
import pytest

from support.transforms import S, stamped
from zteam import messages, tf
from zteam.geometry import quaternion_from_rpy, quaternion_from_yaw
from zteam.kernels.transforms import Floats, compose
from zteam.messages import Header, LaserScan, Point, Pose, PoseStamped, Quaternion, Vector3, time_from_ns
from zteam.tf import Buffer

TILTED: Floats = (1.0, 2.0, 3.0, *quaternion_from_rpy(0.3, -0.8, 2.0))


@pytest.fixture
def buffer() -> Buffer:
    """`robot` drives in `map` from (0, 0) to (0, 4) and turns about half a circle, in 2 s; `tool` is tilted."""
    tree = Buffer()
    tree.set_transform(stamped("map", "robot", S, 0.0, 0.0, 0.0), "test")
    tree.set_transform(stamped("map", "robot", 3 * S, 0.0, 4.0, math.pi), "test")
    pose = messages.Transform(Vector3(*TILTED[:3]), Quaternion(*TILTED[3:]))
    tree.set_transform(messages.TransformStamped(Header(time_from_ns(S), "map"), "tool", pose), "test")
    tree.set_transform_static(stamped("robot", "laser", 0, 0.5), "test")
    return tree


def header(frame: str, stamp: int = 0) -> Header:
    """A header."""
    return Header(time_from_ns(stamp), frame)


def test_points_are_moved_and_vectors_only_turned(buffer: Buffer) -> None:
    """At 2 s one metre ahead of the robot lies to the left of (0, 2); the result has the look-up's time."""
    point = buffer.transform_point(messages.PointStamped(header("robot", 2 * S), Point(1.0, 0.0, 0.0)), "map")
    assert (point.point.x, point.point.y, point.point.z) == pytest.approx((0.0, 3.0, 0.0))
    assert point.header == header("map", 2 * S)
    vector = buffer.transform_vector(messages.Vector3Stamped(header("robot", 2 * S), Vector3(1.0, 0.0, 2.0)), "map")
    assert (vector.vector.x, vector.vector.y, vector.vector.z) == pytest.approx((0.0, 1.0, 2.0))
    assert vector.header == header("map", 2 * S)


def test_a_pose_in_another_frame(buffer: Buffer) -> None:
    """The pose is multiplied by the transform; with stamp 0 the newest one holds; tf2's exceptions are raised."""
    thing: Floats = (0.5, -0.25, 0.125, *quaternion_from_rpy(1.0, 0.2, -0.4))
    pose = PoseStamped(header("tool"), Pose(Point(*thing[:3]), Quaternion(*thing[3:])))
    moved = buffer.transform_pose(pose, "map")
    p, q = moved.pose.position, moved.pose.orientation
    assert (p.x, p.y, p.z, q.x, q.y, q.z, q.w) == pytest.approx(compose(TILTED, thing))
    assert moved.header == header("map", S)
    with pytest.raises(tf.ExtrapolationException):
        buffer.transform_pose(PoseStamped(header("robot", 4 * S)), "map")
    with pytest.raises(tf.LookupException):
        buffer.transform_pose(PoseStamped(header("nobody")), "map")


def test_a_scan_becomes_points_where_its_beams_ended(buffer: Buffer) -> None:
    """Each beam's end, at the scan's own stamp; a beam without a hit, or with one too close, is NaN."""
    ranges = np.array([1.0, 2.0, 0.05, 8.0, math.inf, math.nan, 3.0], np.float32)
    scan = LaserScan(header("laser", 2 * S), -math.pi / 2, math.pi, math.pi / 4, range_min=0.1, range_max=8.0)
    scan.ranges = ranges
    ends = buffer.transform_scan(scan, "map")
    assert ends.shape == (7, 3)
    # At 2 s the robot is at (0, 2) and looks along y, so the laser is at (0, 2.5).
    assert ends[0] == pytest.approx((1.0, 2.5, 0.0), abs=1e-6)
    assert ends[1] == pytest.approx((math.sqrt(2.0), 2.5 + math.sqrt(2.0), 0.0), abs=1e-6)
    assert np.isnan(ends[2:6]).all()
    assert ends[6] == pytest.approx((0.0, -0.5, 0.0), abs=1e-6)


def test_arrays_of_poses_agree_with_single_ones(buffer: Buffer) -> None:
    """Planar poses transformed at once equal those transformed one by one."""
    poses = np.random.default_rng(1).uniform(-3, 3, (10, 3))
    moved = buffer.transform_poses(poses, "map", "robot", 2 * S)
    for (x, y, yaw), ours in zip(poses, moved, strict=True):
        single = PoseStamped(header("robot", 2 * S), Pose(Point(x, y), Quaternion(*quaternion_from_yaw(yaw))))
        there = buffer.transform_pose(single, "map").pose
        assert ours[:2] == pytest.approx((there.position.x, there.position.y))
        heading = 2.0 * math.atan2(there.orientation.z, there.orientation.w)
        assert math.remainder(ours[2] - heading, math.tau) == pytest.approx(0.0, abs=1e-9)


def moving(speed: float, turn: float, roll: float = 0.0) -> Buffer:
    """map -> base drives along y and turns, or rolls, at 10 Hz for 4 s; a camera and an arm 1 m ahead are static."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "camera", 0, 1.0, 1.0, math.pi / 2), "test")
    buffer.set_transform_static(stamped("base", "arm", 0, 1.0), "test")
    for tick in range(41):
        t = tick / 10
        sample = stamped("map", "base", S + tick * S // 10, 0.0, speed * t, turn * t)
        if roll:
            sample.transform.rotation = Quaternion(*quaternion_from_rpy(roll * t, 0.0, math.pi / 2))
        buffer.set_transform(sample, "test")
    return buffer


@pytest.mark.parametrize(
    ("buffer", "pair", "time", "linear", "angular"),
    [
        (moving(3.0, 0.0), ("base", "map"), 2 * S, (0.0, 3.0, 0.0), (0.0, 0.0, 0.0)),
        (moving(3.0, 0.0), ("base", "map"), 0, (0.0, 3.0, 0.0), (0.0, 0.0, 0.0)),
        (moving(3.0, 0.0), ("base", "map"), 99 * S, (0.0, 3.0, 0.0), (0.0, 0.0, 0.0)),
        (moving(3.0, 0.0), ("base", "camera"), 2 * S, (3.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        (moving(3.0, 0.0), ("camera", "map"), 0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        (moving(0.0, 0.5), ("arm", "map"), 3 * S, (-0.5 * math.sin(1.0), 0.5 * math.cos(1.0), 0.0), (0.0, 0.0, 0.5)),
        (moving(0.0, 0.5), ("arm", "base"), 3 * S, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        # The yaw passes pi.
        (moving(0.0, 2.0), ("base", "map"), 51 * S // 20, (0.0, 0.0, 0.0), (0.0, 0.0, 2.0)),
        (moving(0.0, -2.0), ("base", "map"), 51 * S // 20, (0.0, 0.0, 0.0), (0.0, 0.0, -2.0)),
        # The base's own x axis is the map's y axis.
        (moving(0.0, 0.0, 0.3), ("base", "map"), 2 * S, (0.0, 0.0, 0.0), (0.0, 0.3, 0.0)),
    ],
)
def test_the_velocity_of_a_frame(
    buffer: Buffer, pair: tuple[str, str], time: int, linear: tuple[float, ...], angular: tuple[float, ...]
) -> None:
    """tf's velocity_test: the mean about a time, at most until the newest data, in the axes of the observer."""
    twist = buffer.lookup_twist(*pair, time, 0.02)
    assert (twist.linear.x, twist.linear.y, twist.linear.z) == pytest.approx(linear, abs=1e-4)
    assert (twist.angular.x, twist.angular.y, twist.angular.z) == pytest.approx(angular, abs=1e-9)


def test_a_velocity_needs_data_and_an_interval() -> None:
    """An interval that begins before the data, one without a length, and an unknown frame raise."""
    buffer = moving(3.0, 0.0)
    for frame, time, interval, error in (
        ("base", S, 0.5, tf.BackwardExtrapolationException),
        ("base", 0, 0.0, tf.InvalidArgumentException),
        ("nowhere", 0, 0.5, tf.LookupException),
    ):
        with pytest.raises(error):
            buffer.lookup_twist(frame, "map", time, interval)
