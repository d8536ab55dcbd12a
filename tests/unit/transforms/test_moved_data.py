"""Points, poses, vectors, scans, arrays and velocities in other frames; and a clock that jumps back."""

import logging
import math
import threading

import numpy as np
import pytest

from support.transforms import S, stamped
from zteam.messages import (
    Header,
    LaserScan,
    Point,
    PointStamped,
    Pose,
    PoseStamped,
    Quaternion,
    Vector3,
    Vector3Stamped,
    time_from_ns,
)
from zteam.tf import Buffer, ExtrapolationException, InvalidArgumentException, LookupException

TURNED = math.sin(math.pi / 4)


def turned_buffer() -> Buffer:
    """`robot` stands in `map` at (1, 2), turned left by 90°, from 1 s to 2 s."""
    buffer = Buffer()
    for time in (1, 2):
        buffer.set_transform(stamped("map", "robot", time * S, 1.0, 2.0, math.pi / 2), "t")
    return buffer


def header(frame: str, stamp: int = 0) -> Header:
    """A header."""
    return Header(time_from_ns(stamp), frame)


def test_points_are_moved_and_vectors_only_turned() -> None:
    """One metre ahead of the robot lies to the left in map; the result is stamped with the look-up's time."""
    buffer = turned_buffer()
    point = buffer.transform_point(PointStamped(header("robot"), Point(1.0, 0.0, 0.0)), "map")
    assert (point.point.x, point.point.y, point.point.z) == pytest.approx((1.0, 3.0, 0.0))
    assert (point.header.frame_id, point.header.stamp) == ("map", time_from_ns(2 * S))
    vector = buffer.transform_vector(Vector3Stamped(header("robot", S), Vector3(1.0, 0.0, 0.0)), "map")
    assert (vector.vector.x, vector.vector.y, vector.vector.z) == pytest.approx((0.0, 1.0, 0.0))
    assert vector.header.stamp == time_from_ns(S)


def test_a_pose_keeps_its_place_in_the_world() -> None:
    """Headings add up, and a pose transformed to another frame and back is the same pose."""
    buffer = turned_buffer()
    pose = PoseStamped(header("robot", S), Pose(Point(1.0, -1.0, 0.0), Quaternion(0.0, 0.0, TURNED, TURNED)))
    there = buffer.transform_pose(pose, "map")
    assert abs(there.pose.orientation.z) == pytest.approx(1.0)
    back = buffer.transform_pose(there, "robot")
    assert (back.pose.position.x, back.pose.position.y) == pytest.approx((1.0, -1.0))
    with pytest.raises(ExtrapolationException):
        buffer.transform_pose(PoseStamped(header("robot", 3 * S)), "map")
    with pytest.raises(LookupException):
        buffer.transform_pose(PoseStamped(header("nobody")), "map")


def test_a_scan_becomes_points_where_its_beams_ended() -> None:
    """A beam with a hit becomes a point in the target; a miss, NaN or too short a range becomes NaN."""
    ranges = np.array([1.0, 2.0, 8.0, np.nan, 0.01], np.float32)
    scan = LaserScan(
        header=header("robot", S),
        angle_min=0.0,
        angle_increment=math.pi / 2,
        range_min=0.1,
        range_max=8.0,
        ranges=ranges,
    )
    points = turned_buffer().transform_scan(scan, "map")
    assert points[:2] == pytest.approx(np.array([[1.0, 3.0, 0.0], [-1.0, 2.0, 0.0]]))
    assert np.isnan(points[2:]).all()


def test_arrays_of_poses_agree_with_single_ones() -> None:
    """A thousand planar poses transformed at once equal those transformed one by one."""
    buffer = turned_buffer()
    poses = np.random.default_rng(1).uniform(-3, 3, (1000, 3))
    moved = buffer.transform_poses(poses, "map", "robot", 0)
    for (x, y, yaw), ours in zip(poses[::97], moved[::97], strict=True):
        single = PoseStamped(
            header("robot"), Pose(Point(x, y, 0.0), Quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))
        )
        there = buffer.transform_pose(single, "map").pose
        assert ours[:2] == pytest.approx((there.position.x, there.position.y))
        heading = 2.0 * math.atan2(there.orientation.z, there.orientation.w)
        assert math.remainder(ours[2] - heading, math.tau) == pytest.approx(0.0, abs=1e-9)


def test_a_twist_is_the_mean_velocity_about_a_time() -> None:
    """A frame that drives at 0.5 m/s and turns at 0.2 rad/s has this twist, also at the newest data."""
    buffer = Buffer()
    for k in range(21):
        buffer.set_transform(stamped("map", "robot", S + k * S // 10, 0.05 * k, 0.0, 0.02 * k), "t")
    for time in (2 * S, 0, 3 * S - 1):
        twist = buffer.lookup_twist("robot", "map", time, 0.2)
        assert (twist.linear.x, twist.linear.y) == pytest.approx((0.5, 0.0), abs=1e-9)
        assert (twist.angular.x, twist.angular.z) == pytest.approx((0.0, 0.2), abs=1e-9)
    with pytest.raises(ExtrapolationException):
        buffer.lookup_twist("robot", "map", S, 0.2)
    with pytest.raises(InvalidArgumentException):
        buffer.lookup_twist("robot", "map", 0, 0.0)


def test_a_jump_back_clears_and_says_so(caplog: pytest.LogCaptureFixture) -> None:
    """After a jump back, moving data is forgotten and static data stays."""
    buffer = turned_buffer()
    buffer.set_transform_static(stamped("robot", "laser", 0, 0.1), "t")
    assert not buffer.take_time(5 * S)
    with caplog.at_level(logging.WARNING):
        assert buffer.take_time(S)
    assert "jump back in time" in caplog.text
    assert not buffer.can_transform("map", "robot", 0)[0]
    assert buffer.can_transform("robot", "laser", 0)[0]


def test_threads_may_set_and_look_up_at_once() -> None:
    """Four writers and two readers for thousands of rounds: every answer is consistent, and nothing raises."""
    buffer = Buffer(cache_time=0.2)
    faults: list[BaseException] = []
    done = threading.Event()

    def write(robot: int) -> None:
        try:
            for k in range(3000):
                # x is the time in seconds, so that any interpolated answer can be checked.
                buffer.set_transform(stamped("map", f"r{robot}", S + k * S // 1000, 1.0 + k / 1000), "t")
        except BaseException as fault:
            faults.append(fault)

    def read() -> None:
        try:
            while not done.is_set():
                for robot in range(4):
                    if buffer.can_transform("map", f"r{robot}", 0)[0]:
                        found = buffer.lookup_transform("map", f"r{robot}", 0)
                        stamp = found.header.stamp.sec + found.header.stamp.nanosec * 1e-9
                        assert found.transform.translation.x == pytest.approx(stamp, abs=1e-9)
        except BaseException as fault:
            faults.append(fault)

    readers = [threading.Thread(target=read) for _ in range(2)]
    writers = [threading.Thread(target=write, args=(i,)) for i in range(4)]
    for thread in readers + writers:
        thread.start()
    for thread in writers:
        thread.join()
    done.set()
    for thread in readers:
        thread.join()
    assert faults == []
    assert all(info.samples == 201 for info in buffer.frames().values())
