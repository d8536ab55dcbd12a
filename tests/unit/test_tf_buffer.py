"""The buffer's deviations from tf2, waiting, and threads; what is tf2's own is in the golden tests."""

import math
import threading

import pytest

from zteam.messages import Header, Quaternion, Transform, TransformStamped, Vector3, ns_from_time, time_from_ns
from zteam.tf import (
    BackwardExtrapolationException,
    Buffer,
    ConnectivityException,
    ExtrapolationException,
    ForwardExtrapolationException,
    InvalidArgumentException,
    LookupException,
    NoDataForExtrapolationException,
)

S = 1_000_000_000


def stamped(parent: str, child: str, stamp: int, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> TransformStamped:
    """A planar transform."""
    rotation = Quaternion(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    return TransformStamped(Header(time_from_ns(stamp), parent), child, Transform(Vector3(x, y, 0.0), rotation))


def test_the_pose_of_a_source_in_a_target() -> None:
    """A look-up gives where the source is, seen from the target, and its inverse the other way round."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "odom", 0, 6.5, 18.5, math.pi / 2), "test")
    buffer.set_transform(stamped("odom", "base", S, 1.0, 0.0), "test")
    pose, stamp = buffer.lookup_pose2("map", "base", 0)
    assert pose == pytest.approx((6.5, 19.5, math.pi / 2))
    assert stamp == S
    assert buffer.lookup_pose2("base", "map", 0)[0] == pytest.approx((-19.5, 6.5, -math.pi / 2))


def test_a_sample_between_two_is_interpolated() -> None:
    """Half way in time is half way in space and angle, the short way round."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S, 0.0, 0.0, math.radians(170)), "test")
    buffer.set_transform(stamped("map", "base", 3 * S, 2.0, 4.0, math.radians(-170)), "test")
    pose, _ = buffer.lookup_pose2("map", "base", 2 * S)
    assert pose[:2] == pytest.approx((1.0, 2.0))
    assert abs(pose.yaw) == pytest.approx(math.pi)


def test_extrapolation_has_three_names() -> None:
    """Before, after, and with one sample only are told apart, as in ROS 2."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", 2 * S), "test")
    with pytest.raises(NoDataForExtrapolationException):
        buffer.lookup_transform("map", "base", S)
    buffer.set_transform(stamped("map", "base", 3 * S), "test")
    with pytest.raises(BackwardExtrapolationException, match="into the past"):
        buffer.lookup_transform("map", "base", S)
    with pytest.raises(ForwardExtrapolationException, match="into the future"):
        buffer.lookup_transform("map", "base", 4 * S)


def test_names_are_as_strict_as_tf2s() -> None:
    """No leading slash and no empty name in a look-up; a slash is stripped when a transform is stored."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("/map", "/odom", 0, 1.0), "test")
    assert buffer.lookup_pose2("map", "odom", 0)[0].x == 1.0
    for name in ("/map", ""):
        with pytest.raises(InvalidArgumentException):
            buffer.lookup_transform(name, "odom", 0)
    with pytest.raises(LookupException, match='"nowhere"'):
        buffer.lookup_transform("map", "nowhere", 0)
    buffer.set_transform_static(stamped("other", "frame", 0), "test")
    with pytest.raises(ConnectivityException):
        buffer.lookup_transform("map", "frame", 0)


def test_a_quaternion_is_normalised() -> None:
    """A rotation that is slightly too long does not stretch what it rotates (tf2 lets it)."""
    buffer = Buffer()
    long = stamped("map", "a", 0, 0.0, 0.0, 0.3)
    rotation = long.transform.rotation
    rotation.z, rotation.w = rotation.z * 1.004, rotation.w * 1.004
    assert buffer.set_transform_static(long, "test") is None
    buffer.set_transform_static(stamped("a", "b", 0, 10.0), "test")
    pose, _ = buffer.lookup_pose2("map", "b", 0)
    assert math.hypot(pose.x, pose.y) == pytest.approx(10.0, abs=1e-12)


@pytest.mark.parametrize("value", [math.inf, math.nan])
def test_numbers_that_are_not_finite_are_refused(value: float) -> None:
    """inf and NaN are refused when they come, and leave no frame behind."""
    buffer = Buffer()
    refused = buffer.set_transform(stamped("map", "base", S, value), "robot_1")
    assert refused is not None
    assert refused.code == "TF_NAN_INPUT"
    assert "robot_1" in refused.text
    assert buffer.frames() == {}
    with pytest.raises(LookupException):
        buffer.lookup_transform("map", "base", 0)


def test_a_loop_names_both_authorities() -> None:
    """What would close a loop is refused when it comes."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("a", "b", 0), "first")
    buffer.set_transform_static(stamped("b", "c", 0), "second")
    refused = buffer.set_transform_static(stamped("c", "a", 0), "third")
    assert refused is not None
    assert refused.code == "TF_LOOP"
    assert "third" in refused.text
    assert "second" in refused.text


def test_exact_duplicates_are_counted_silently() -> None:
    """The same sample twice is no error; another value for the same time is."""
    buffer = Buffer()
    assert buffer.set_transform(stamped("map", "base", S, 1.0), "test") is None
    assert buffer.set_transform(stamped("map", "base", S, 1.0), "test") is None
    assert buffer.duplicates == 1
    refused = buffer.set_transform(stamped("map", "base", S, 2.0), "test")
    assert refused is not None
    assert refused.code == "TF_REPEATED_DATA"


def test_moving_data_on_a_static_frame_is_refused() -> None:
    """A static frame stays where it is, and the message names who said so."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "odom", 0, 1.0), "team file")
    refused = buffer.set_transform(stamped("map", "odom", S, 2.0), "robot_1")
    assert refused is not None
    assert "team file" in refused.text
    assert buffer.lookup_pose2("map", "odom", 0)[0].x == 1.0


def test_old_samples_are_forgotten_and_refused() -> None:
    """The cache is counted from the edge's own newest stamp."""
    buffer = Buffer(cache_time=10.0)
    for second in range(1, 31):
        buffer.set_transform(stamped("map", "base", second * S, float(second)), "test")
    info = buffer.frames()["base"]
    assert (info.oldest, info.newest, info.samples) == (20 * S, 30 * S, 11)
    assert info.rate == pytest.approx(1.0)
    refused = buffer.set_transform(stamped("map", "base", 19 * S), "test")
    assert refused is not None
    assert refused.code == "TF_OLD_DATA"


def test_a_new_parent_takes_over_from_its_time_on() -> None:
    """Past look-ups use the parent of that time, the newest one the new parent."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "room", 0, 100.0), "test")
    buffer.set_transform(stamped("map", "base", S, 1.0), "test")
    buffer.set_transform(stamped("map", "base", 2 * S, 2.0), "test")
    buffer.set_transform(stamped("room", "base", 3 * S, 3.0), "test")
    assert buffer.lookup_pose2("map", "base", S)[0].x == 1.0
    assert buffer.lookup_pose2("map", "base", 5 * S // 2)[0].x == 2.0
    assert buffer.lookup_pose2("map", "base", 0)[0].x == 103.0


def test_clear_keeps_static_transforms() -> None:
    """After a jump back the fixed part of the tree still answers, the moving part says why not."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "odom", 0, 1.0), "test")
    buffer.set_transform(stamped("odom", "base", 5 * S, 1.0), "test")
    buffer.clear()
    assert buffer.lookup_pose2("map", "odom", 0)[0].x == 1.0
    able, why = buffer.can_transform("map", "base", 0)
    assert not able
    assert why
    assert buffer.set_transform(stamped("odom", "base", S, 2.0), "test") is None
    assert buffer.lookup_pose2("map", "base", 0)[0].x == 3.0


def test_the_full_static_set_forgets_what_it_no_longer_has() -> None:
    """A latched set replaces the one before."""
    buffer = Buffer()
    buffer.set_all_static([stamped("map", "a", 0, 1.0), stamped("map", "b", 0, 2.0)], "tf")
    buffer.set_all_static([stamped("map", "b", 0, 3.0)], "tf")
    assert list(buffer.frames()) == ["b"]
    assert buffer.lookup_pose2("map", "b", 0)[0].x == 3.0
    assert buffer.set_transform(stamped("map", "a", S, 5.0), "robot") is None


def test_a_look_up_can_wait() -> None:
    """A waiting look-up answers as soon as the sample is there, and raises its own error at the end of the wait."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S), "test")
    answers = []
    waiting = threading.Thread(target=lambda: answers.append(buffer.wait_for_transform("map", "base", 2 * S, 20.0)))
    waiting.start()
    buffer.set_transform(stamped("map", "base", 2 * S, 7.0), "test")
    waiting.join(20.0)
    assert answers[0].transform.translation.x == 7.0
    with pytest.raises(ExtrapolationException):
        buffer.wait_for_transform("map", "base", 9 * S, 0.01)


def test_threads_may_store_and_look_up_at_once() -> None:
    """A reader never sees a half-stored tree."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S, float(S)), "test")
    done = threading.Event()

    def store() -> None:
        for i in range(1, 3000):
            buffer.set_transform(stamped("map", "base", S + i, float(S + i)), "test")
        done.set()

    writer = threading.Thread(target=store)
    writer.start()
    while not done.is_set():
        transform = buffer.lookup_transform("map", "base", 0)
        assert transform.transform.translation.x == float(ns_from_time(transform.header.stamp))
    writer.join(20.0)
