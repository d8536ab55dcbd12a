"""Poses of messages in the plane."""

import math
from collections import defaultdict

import pytest

from support.goals import make_goal
from support.log_capture import captured_log
from zteam.clock import Every
from zteam.geometry import Pose2
from zteam.messages import (
    Header,
    Point,
    Pose,
    Quaternion,
    Transform,
    TransformStamped,
    Twist,
    Vector3,
    time_from_ns,
)
from zteam.messages import planar as planar_module
from zteam.messages.planar import checked_command, goal_in_map, pose2_of, pose_message
from zteam.tf import Buffer, TransformException

SECOND = 1_000_000_000


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
def test_a_turn_rate_in_degrees_is_told_once_for_each_robot(
    rate: float, told: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A rate above a full turn a second is most likely meant in degrees. It is handed on as it is."""
    monkeypatch.setattr(planar_module, "_MAY_WARN", defaultdict(lambda: Every(60.0)))
    with captured_log() as log:
        for robot in (0, 1, 0, 1):
            assert checked_command(Twist(angular=Vector3(z=rate)), "Mine.step", robot).angular.z is rate
    assert log.count("Mine.step") == log.count("radians") == 2 * told


def tree() -> Buffer:
    """Robot 1 drives along y by 1 m a second from (10, 0), heading to y; a door of the team stands still at (5, 5)."""
    buffer, turned = Buffer(), Quaternion(z=math.sqrt(0.5), w=math.sqrt(0.5))
    place = Transform(Vector3(10.0), turned)
    buffer.set_transform_static(TransformStamped(Header(frame_id="map"), "robot_1/odom", place), "test")
    buffer.set_transform_static(TransformStamped(Header(frame_id="map"), "door", Transform(Vector3(5.0, 5.0))), "test")
    buffer.set_transform_static(
        TransformStamped(Header(frame_id="robot_1/base_footprint"), "robot_1/base_link"), "test"
    )
    for second in range(1, 6):
        header = Header(time_from_ns(second * SECOND), "robot_1/odom")
        buffer.set_transform(TransformStamped(header, "robot_1/base_footprint", Transform(Vector3(float(second)))), "")
    return buffer


@pytest.mark.parametrize(
    ("frame", "time", "place"),
    [
        ("map", 0.0, (1.0, 0.0, 0.0)),
        ("/map", 99.0, (1.0, 0.0, 0.0)),
        ("", 3.0, (1.0, 0.0, 0.0)),
        ("door", 77.0, (6.0, 5.0, 0.0)),
        ("odom", 0.0, (10.0, 1.0, math.pi / 2)),
        ("robot_1/odom", 99.0, (10.0, 1.0, math.pi / 2)),
        ("base_link", 0.0, (10.0, 6.0, math.pi / 2)),
        ("/base_footprint", 2.0, (10.0, 3.0, math.pi / 2)),
        ("/robot_1/base_link", 2.5, (10.0, 3.5, math.pi / 2)),
        ("base_link", 60.0, (10.0, 6.0, math.pi / 2)),
        ("base_link", 0.5, "too old"),
        ("camera", 0.0, "'camera', from which no transform leads to map"),
        ("robot_2/odom", 0.0, "'robot_2/odom', from which no transform leads to map"),
    ],
)
def test_a_goal_of_any_frame_is_taken_to_the_map_at_its_time(
    frame: str, time: float, place: tuple[float, float, float] | str
) -> None:
    """A metre ahead in each frame; a time that is 0 or has not come is the newest, one that is forgotten is refused."""
    buffer = tree()

    def find(target: str, source: str, time: int = 0) -> tuple[Pose2, int] | None:
        try:
            return buffer.lookup_pose2(target, source, time)
        except TransformException:
            return None

    goal = make_goal(1.0, 0.0, 0.0, frame)
    goal.header.stamp = time_from_ns(round(time * SECOND))
    found = goal_in_map(goal, 1, find)
    if isinstance(place, str):
        assert isinstance(found, str)
        assert place in found
    else:
        assert found == pytest.approx(place)
