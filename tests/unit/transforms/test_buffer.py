"""The buffer's public calls: look-ups, names and clearing. The golden tests compare with tf2 itself."""

import math

import pytest

from support.transforms import S, chain, stamped
from zteam.errors import ZteamError
from zteam.geometry import Pose2
from zteam.messages import ns_from_time
from zteam.tf import (
    BackwardExtrapolationException,
    Buffer,
    ConnectivityException,
    ExtrapolationException,
    ForwardExtrapolationException,
    InvalidArgumentException,
    LookupException,
    NoDataForExtrapolationException,
    TimeoutException,
    TransformException,
)


def test_the_pose_of_a_source_in_a_target() -> None:
    """A look-up returns the pose of the source in the target; with the frames exchanged, it returns the inverse."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "odom", 0, 6.5, 18.5, math.pi / 2), "test")
    buffer.set_transform(stamped("odom", "base", S, 1.0, 0.0), "test")
    pose, stamp = buffer.lookup_pose2("map", "base", 0)
    assert pose == pytest.approx((6.5, 19.5, math.pi / 2))
    assert stamp == S
    assert buffer.lookup_pose2("base", "map", 0)[0] == pytest.approx((-19.5, 6.5, -math.pi / 2))


def test_a_sample_between_two_is_interpolated() -> None:
    """Halfway in time, place and angle are halfway too; the rotation takes the shorter way."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S, 0.0, 0.0, math.radians(170)), "test")
    buffer.set_transform(stamped("map", "base", 3 * S, 2.0, 4.0, math.radians(-170)), "test")
    pose, _ = buffer.lookup_pose2("map", "base", 2 * S)
    assert pose[:2] == pytest.approx((1.0, 2.0))
    assert abs(pose.yaw) == pytest.approx(math.pi)


def test_extrapolation_has_three_names() -> None:
    """A time before the data, one after it, and a single sample raise three different exceptions, as in ROS 2."""
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
    """A look-up refuses empty names and leading slashes; a stored transform loses its leading slash."""
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


@pytest.mark.parametrize(
    ("kind", "base"),
    [
        (TransformException, ZteamError),
        (LookupException, TransformException),
        (ConnectivityException, TransformException),
        (InvalidArgumentException, TransformException),
        (TimeoutException, TransformException),
        (ExtrapolationException, TransformException),
        (BackwardExtrapolationException, ExtrapolationException),
        (ForwardExtrapolationException, ExtrapolationException),
        (NoDataForExtrapolationException, ExtrapolationException),
    ],
)
def test_the_exceptions_form_tf2s_family(kind: type[Exception], base: type[Exception]) -> None:
    """Code that catches tf2's (or ROS 2's) class catches ours."""
    assert issubclass(kind, base)


def test_clear_keeps_static_transforms() -> None:
    """After a clear, static transforms still answer, and a look-up of moving ones raises with a reason."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "odom", 0, 1.0), "test")
    buffer.set_transform(stamped("odom", "base", 5 * S, 1.0), "test")
    assert buffer.lookup_pose2("map", "base", 0)[0].x == 2.0
    buffer.clear()
    assert buffer.lookup_pose2("map", "odom", 0)[0].x == 1.0
    able, why = buffer.can_transform("map", "base", 0)
    assert not able
    assert why
    assert buffer.set_transform(stamped("odom", "base", S, 2.0), "test") is None
    assert buffer.lookup_pose2("map", "base", 0)[0].x == 3.0


def test_after_a_clear_a_time_is_an_extrapolation() -> None:
    """As in tf2 the frames stay known after a clear, and the text says that their data is missing."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S), "test")
    buffer.clear()
    with pytest.raises(ExtrapolationException, match="cleared"):
        buffer.lookup_transform("map", "base", S)
    with pytest.raises(ConnectivityException):
        buffer.lookup_transform("map", "base", 0)


def test_fixed_transforms_hold_at_any_time_and_carry_the_time_asked_for() -> None:
    """A static transform is the same in past and future, and is stamped with the time asked for."""
    buffer = chain(3)
    for time in (0, 1, S, 10**18):
        transform = buffer.lookup_transform("f3", "f0", time)
        assert transform.transform.translation.x == -3.0
        assert ns_from_time(transform.header.stamp) == time
        assert (transform.header.frame_id, transform.child_frame_id) == ("f3", "f0")


@pytest.mark.parametrize("ahead", [10, 11, 2**31])
def test_a_sample_far_ahead_of_the_time_hides_no_later_one(ahead: int) -> None:
    """Where the time is known, what is further ahead of it than the buffer remembers is refused."""
    buffer = Buffer()
    refused = buffer.set_transforms([stamped("map", "base", (100 + ahead) * S, 9.0)], "test", 100 * S)
    assert [each.code for each in refused] == (["TF_FUTURE_DATA"] if ahead > 10 else [])
    assert buffer.set_transforms([stamped("map", "base", 100 * S, 1.0)], "test", 100 * S) == []
    assert buffer.lookup_pose2("map", "base", 100 * S)[0].x == 1.0


def test_a_frame_seen_from_itself() -> None:
    """The answer is the identity, stamped with the time asked for or with the frame's newest sample."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", 3 * S, 5.0), "test")
    assert buffer.lookup_pose2("base", "base", 0) == (Pose2(0.0, 0.0, 0.0), 3 * S)
    assert buffer.lookup_pose2("base", "base", S) == (Pose2(0.0, 0.0, 0.0), S)


def test_where_something_was_seen_from_where_i_am_now() -> None:
    """A fixed frame connects two times, and the answer has the target's time as its stamp."""
    buffer = Buffer()
    for second in range(1, 11):
        buffer.set_transform(stamped("map", "me", second * S, float(second)), "test")
        buffer.set_transform(stamped("map", "ball", second * S, 0.0, float(second)), "test")
    transform = buffer.lookup_transform_full("me", 9 * S, "ball", 2 * S, "map")
    assert (transform.transform.translation.x, transform.transform.translation.y) == (-9.0, 2.0)
    assert ns_from_time(transform.header.stamp) == 9 * S
    assert ns_from_time(buffer.lookup_transform_full("me", 0, "ball", 2 * S, "map").header.stamp) == 10 * S
    assert buffer.can_transform_full("me", 9 * S, "ball", 2 * S, "map") == (True, "")
    able, why = buffer.can_transform_full("me", 9 * S, "ball", 99 * S, "map")
    assert not able
    assert "future" in why


def test_why_not_is_always_said() -> None:
    """can_transform returns the text of the look-up's exception, which is never empty."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S), "test")
    buffer.set_transform(stamped("moon", "crater", S), "test")
    for target, source, time in (
        ("map", "nowhere", 0),
        ("", "map", 0),
        ("/map", "base", 0),
        ("map", "crater", 0),
        ("map", "crater", S),
        ("map", "base", 2 * S),
    ):
        able, why = buffer.can_transform(target, source, time)
        assert not able
        with pytest.raises(TransformException) as caught:
            buffer.lookup_transform(target, source, time)
        assert why == str(caught.value) != ""


def test_error_texts_are_tf2s() -> None:
    """Error texts print all nanoseconds: one nanosecond too late does not read 'requested 1.0, latest 1.0'."""
    buffer = Buffer()
    for stamp in (S, 2 * S):
        buffer.set_transform(stamped("map", "base", stamp), "test")
    with pytest.raises(ForwardExtrapolationException) as caught:
        buffer.lookup_transform("map", "base", 2 * S + 1)
    assert str(caught.value) == (
        "Lookup would require extrapolation 0.000000001s into the future.  Requested time 2.000000001 "
        "but the latest data is at time 2.000000000, when looking up transform from frame [base] to frame [map]"
    )
    with pytest.raises(LookupException) as missing:
        buffer.lookup_transform("map", "nowhere", 0)
    assert str(missing.value) == '"nowhere" passed to lookupTransform argument source_frame does not exist. '


def test_time_that_goes_back_clears_the_buffer(caplog: pytest.LogCaptureFixture) -> None:
    """tf2's time_backwards: moving data goes, static data stays, the jump is logged, and new data is stored."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "odom", 0, 1.0), "test")
    buffer.set_transform(stamped("odom", "base", 100 * S, 1.0), "test")
    assert [buffer.take_time(now * S) for now in (99, 100, 100)] == [False, False, False]
    assert buffer.lookup_pose2("map", "base", 0)[0].x == 2.0
    assert caplog.text == ""
    assert buffer.take_time(90 * S) is True
    assert "jump back in time of 10.000 s" in caplog.text
    assert list(buffer.frames()) == ["odom"]
    assert buffer.set_transform(stamped("odom", "base", 90 * S, 5.0), "test") is None
    assert buffer.lookup_pose2("map", "base", 0)[0].x == 6.0
    assert buffer.take_time(91 * S) is False
