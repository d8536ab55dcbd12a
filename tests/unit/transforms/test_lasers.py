"""Where a robot's lasers are on its base, and scans that cannot be used."""

import math

import numpy as np
import pytest

from support.transforms import S, stamped
from zteam.geometry import quaternion_from_rpy
from zteam.messages import Header, LaserScan, Quaternion, Transform, TransformStamped, Vector3, time_from_ns
from zteam.tf import Buffer
from zteam.transforms.lasers import MAX_TILT, LaserMounts, turn_scan

BASE = "robot_0/base_footprint"


def scan_in(frame: str, stamp: int = S, way: float = 1.0) -> LaserScan:
    """Beams at -0.2, 0 and 0.3 rad and so on, whose ranges are their numbers from 1 on."""
    ranges = np.arange(1.0, 7.0, dtype=np.float32)
    return LaserScan(Header(time_from_ns(stamp), frame), -0.2, 0.3, way * 0.1, 0.0, 0.0, 0.1, 8.0, ranges, 10 * ranges)


def laser(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0, child: str = "robot_0/laser") -> TransformStamped:
    """A laser 0.1 m before the base's origin."""
    rotation = Quaternion(*quaternion_from_rpy(roll, pitch, yaw))
    return TransformStamped(Header(frame_id=BASE), child, Transform(Vector3(0.1, 0.0, 0.3), rotation))


@pytest.fixture
def buffer() -> Buffer:
    """Robots 0 and 1 in `map`, each with a laser; robot 0 has also one with a name of the team's."""
    tree = Buffer()
    for i in (0, 1):
        tree.set_transform_static(stamped("map", f"robot_{i}/odom", 0, 2.0 * i), "test")
        tree.set_transform(stamped(f"robot_{i}/odom", f"robot_{i}/base_footprint", S), "test")
        tree.set_transform_static(stamped(f"robot_{i}/base_footprint", f"robot_{i}/laser", 0, 0.1), "test")
    tree.set_transform_static(stamped("robot_0/base_footprint", "front_laser", 0, 0.2), "test")
    tree.set_transform_static(stamped("robot_0/base_footprint", "robot_0/far_laser", 0, 180.0), "test")
    return tree


@pytest.mark.parametrize(
    ("frame", "x"),
    [("robot_0/laser", 0.1), ("/robot_0/laser", 0.1), ("base_footprint", 0.0), ("front_laser", 0.2)],
)
def test_a_level_laser_needs_no_turn(buffer: Buffer, frame: str, x: float) -> None:
    """The scan itself is passed on, by whichever name its frame is known; a scan may be in the base's own frame."""
    scan = scan_in(frame)
    assert LaserMounts(0, buffer).level(scan) == (scan, (x, 0.0), None)
    assert LaserMounts(0, buffer).level(scan).scan is scan


@pytest.mark.parametrize(
    ("frame", "noun"),
    [
        ("laser_2", "its laser's frame robot_0/laser_2 (robot_0/tf_static, from its base)"),
        ("robot_7/laser", "its laser's frame robot_7/laser (robot_0/tf_static, from its base)"),
        ("", "a frame_id in the header of its scans"),
        ("/", "a frame_id in the header of its scans"),
        ("robot_1/laser", "a laser on its own base (its scans are in robot_1/laser, which is not)"),
        ("odom", "a laser on its own base (its scans are in robot_0/odom, which is not)"),
        ("map", "a laser on its own base (its scans are in map, which is not)"),
        ("far_laser", "a laser on its base (robot_0/far_laser is 180 m away from it, 5 m is the most)"),
    ],
)
def test_a_scan_from_no_known_place_on_the_base_is_of_no_use(buffer: Buffer, frame: str, noun: str) -> None:
    """Its frame is in no tree, it is empty, it is another robot's, the base moves away from it, or it is far away, as
    in millimetres: what lacks is named, and something to do."""
    seen = LaserMounts(0, buffer).level(scan_in(frame))
    assert seen.problem is not None
    assert (seen.scan, seen.problem.noun) == (None, noun)
    assert seen.problem.way_out


@pytest.mark.parametrize("over", [0.0, math.pi])
def test_a_laser_may_be_tilted_a_little(over: float) -> None:
    """Up to ten degrees, upright or upside down; with more, no beam is used, and the angle is told."""
    mounts = LaserMounts(0, tree := Buffer())
    tree.set_transform_static(laser(over + math.radians(9.99)), "test")
    assert mounts.level(scan_in("laser")).scan is not None
    tree.set_transform_static(laser(over, math.radians(25.0), 1.0), "test")
    seen = mounts.level(scan_in("laser"))
    assert seen.problem is not None
    assert seen.problem.noun == "a level laser (robot_0/laser is tilted by 25°, 10° is the most)"


def test_a_laser_that_moves_on_its_base_has_to_be_told_anew(buffer: Buffer) -> None:
    """Where it was at the scan's time counts, or half a second before at most."""
    for stamp, yaw in ((S, 0.0), (2 * S, 1.0)):
        buffer.set_transform(stamped(BASE, "robot_0/pan", stamp, 0.0, 0.0, yaw), "test")
    mounts = LaserMounts(0, buffer)
    turned = mounts.level(scan_in("pan", 3 * S // 2)).scan
    assert turned is not None
    assert turned.angle_min == pytest.approx(0.5 - 0.2)
    assert mounts.level(scan_in("pan", 5 * S // 2)).scan is not None
    seen = mounts.level(scan_in("pan", 5 * S // 2 + 1))
    assert seen.problem is not None
    assert seen.problem.noun == "newer transforms of its laser's frame robot_0/pan (robot_0/tf)"


def test_a_frame_that_is_lost_is_known_no_more(buffer: Buffer) -> None:
    """It hangs under a frame that is in no tree; by another buffer it may still be known."""
    other = Buffer()
    other.set_transform_static(laser(), "test")
    mounts, both = LaserMounts(0, buffer), LaserMounts(0, buffer, other)
    assert mounts.level(scan_in("laser")).problem is None
    buffer.set_transform_static(stamped("robot_0/elsewhere", "robot_0/laser", 0), "test")
    assert mounts.level(scan_in("laser")).problem is not None
    assert both.level(scan_in("laser")).laser == (0.1, 0.0)


@pytest.mark.parametrize(
    ("rotation", "way", "first", "numbers"),
    [
        ((0.0, 0.0, 0.0), -1.0, -0.7, [6, 5, 4, 3, 2, 1]),
        ((0.0, 0.0, 2.0), 1.0, 1.8, [1, 2, 3, 4, 5, 6]),
        ((math.pi, 0.0, 0.0), 1.0, -0.3, [6, 5, 4, 3, 2, 1]),
        ((math.pi, 0.0, 0.0), -1.0, 0.2, [1, 2, 3, 4, 5, 6]),
        ((math.pi, 0.0, 0.5), 1.0, 0.2, [6, 5, 4, 3, 2, 1]),
        ((0.0, math.pi, 0.0), 1.0, math.pi - 0.3, [6, 5, 4, 3, 2, 1]),
    ],
)
def test_beams_run_from_right_to_left(
    rotation: tuple[float, float, float], way: float, first: float, numbers: list[int]
) -> None:
    """Whichever way round the laser turns, and if it is upside down; intensities stay with their beams."""
    turned = turn_scan(scan_in("laser", way=way), quaternion_from_rpy(*rotation))
    assert turned.angle_increment == pytest.approx(0.1)
    assert turned.angle_min == pytest.approx(first)
    assert turned.angle_max == pytest.approx(first + 0.5)
    assert turned.ranges.tolist() == numbers
    assert turned.intensities.tolist() == [10 * number for number in numbers]


def test_a_tilt_keeps_what_a_range_means() -> None:
    """Nothing met stays nothing met, silence stays silence, and what is near the limits of the laser stays within."""
    scan = scan_in("laser")
    scan.ranges = np.array([8.0, math.inf, math.nan, -math.inf, 0.1, 7.9], np.float32)
    turned = turn_scan(scan, quaternion_from_rpy(0.0, MAX_TILT, 0.0))
    assert turned.ranges.tolist()[:4] == pytest.approx([math.inf, math.inf, math.nan, -math.inf], nan_ok=True)
    assert turned.range_min <= turned.ranges[4] < 0.1
    assert turned.ranges[5] < turned.range_max
