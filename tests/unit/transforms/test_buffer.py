"""What the buffer stores, refuses and answers; golden runs compare its look-ups with tf2's."""

import itertools
import math

import pytest

from support.transforms import S, chain, stamped
from zteam import tf
from zteam.geometry import Pose2, quaternion_from_rpy
from zteam.messages import Quaternion, TransformStamped, ns_from_time
from zteam.tf import Buffer


def filled() -> Buffer:
    """map -> odom is static by `first`, odom -> base has samples at 12 s and 20 s by `second`."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "odom", 0, 1.0), "first")
    for second in (12, 20):
        buffer.set_transform(stamped("odom", "base", second * S, float(second)), "second")
    return buffer


def with_number(field: str, value: float) -> TransformStamped:
    """The sample that follows in `filled`, with another number."""
    message = stamped("odom", "base", 21 * S, 3.0, 0.0, 0.3)
    part = message.transform.translation if field in "xyz" else message.transform.rotation
    setattr(part, field[-1], value)
    return message


def with_rotation(*numbers: float) -> TransformStamped:
    """The same with a rotation that may be no unit quaternion."""
    message = stamped("odom", "base", 21 * S, 3.0)
    message.transform.rotation = Quaternion(*numbers)
    return message


NUMBERS = [("TF_NAN_INPUT", with_number(field, value)) for field in ("x", "y", "z", "qx", "qy", "qz", "qw")
           for value in (math.inf, -math.inf, math.nan)]  # fmt: skip
NAMES = [
    ("TF_NO_CHILD_FRAME_ID", stamped("map", "", 21 * S)),
    ("TF_NO_CHILD_FRAME_ID", stamped("map", "/", 21 * S)),
    ("TF_NO_FRAME_ID", stamped("", "base", 21 * S)),
    ("TF_NO_FRAME_ID", stamped("/", "base", 21 * S)),
    ("TF_SELF_TRANSFORM", stamped("base", "base", 21 * S)),
    ("TF_SELF_TRANSFORM", stamped("/base", "base", 21 * S)),
    ("TF_LOOP", stamped("base", "map", 21 * S)),
]


@pytest.mark.parametrize(
    ("code", "sample"),
    [
        *NUMBERS,
        *NAMES,
        ("TF_DENORMALIZED_QUATERNION", with_rotation(0.0, 0.0, 0.0, math.sqrt(0.985))),
        ("TF_DENORMALIZED_QUATERNION", with_rotation(0.0, 0.0, 0.6 * 1.01, 0.8 * 1.01)),
        ("TF_DENORMALIZED_QUATERNION", with_rotation(0.0, 0.0, 0.0, 0.0)),
        ("TF_STATIC_FRAME", stamped("map", "odom", 21 * S)),
        ("TF_OLD_DATA", stamped("odom", "base", 10 * S - 1)),
        ("TF_REPEATED_DATA", stamped("odom", "base", 20 * S, 5.0)),
        ("TF_REPEATED_DATA", stamped("other", "base", 12 * S, 12.0)),
    ],
)
def test_a_refused_sample_changes_nothing(code: str, sample: TransformStamped) -> None:
    """The refusal has tf2's code; no frame is added, none changes, and the stream goes on."""
    buffer = filled()
    before = buffer.frames()
    refused = buffer.set_transform(sample, "robot_1")
    assert refused is not None
    assert refused.code == code
    assert buffer.frames() == before
    with pytest.raises(tf.LookupException):
        buffer.lookup_transform("other", "base", 0)
    assert buffer.set_transform(stamped("odom", "base", 21 * S, 4.0), "robot_1") is None
    assert buffer.lookup_pose2("map", "base", 0)[0].x == 5.0


@pytest.mark.parametrize(("code", "sample"), NAMES)
def test_static_transforms_are_checked_as_moving_ones_are(code: str, sample: TransformStamped) -> None:
    """They are refused for the same names, and for a loop; the text names the authority."""
    refused = filled().set_transform_static(sample, "robot_1")
    assert refused is not None
    assert refused.code == code
    assert "robot_1" in refused.text


def test_a_refusal_names_both_authorities() -> None:
    """That of the frame, and that of the sample: of a loop and of a static frame."""
    buffer = filled()
    buffer.set_transform_static(stamped("base", "tip", 0), "fourth")
    for sample, other in (
        (stamped("base", "map", 21 * S), "second"),
        (stamped("tip", "base", 21 * S), "fourth"),
        (stamped("map", "odom", S), "first"),
    ):
        refused = buffer.set_transform(sample, "third")
        assert refused is not None
        assert "third" in refused.text
        assert other in refused.text


@pytest.mark.parametrize("square", [0.9901, 1.0099])
@pytest.mark.parametrize("stamp", [11 * S, 21 * S], ids=["late", "newest"])
def test_a_quaternion_is_normalised(square: float, stamp: int) -> None:
    """One that is slightly too long or short is stored with length 1: it does not scale what it rotates."""
    buffer, scale = filled(), math.sqrt(square)
    sample = with_rotation(0.0, 0.0, 0.6 * scale, 0.8 * scale)
    sample.header.stamp.sec = stamp // S
    assert buffer.set_transform(sample, "test") is None
    rotation = buffer.lookup_transform("odom", "base", stamp).transform.rotation
    assert (rotation.z, rotation.w) == pytest.approx((0.6, 0.8), abs=1e-15)


def test_numbers_and_names_that_are_taken() -> None:
    """Coordinates of any size, and names with a leading slash, which is stripped."""
    buffer = filled()
    assert buffer.set_transform(stamped("odom", "base", 21 * S, 1.5e308, 1.5e308), "test") is None
    assert buffer.lookup_pose2("odom", "base", 0)[0][:2] == (1.5e308, 1.5e308)
    for second, (parent, child) in enumerate([("/odom", "base"), ("odom", "/base"), ("/odom", "/base")], start=22):
        assert buffer.set_transform(stamped(parent, child, second * S), "test") is None
    assert buffer.frames()["base"].newest == 24 * S
    assert list(buffer.frames()) == ["base", "odom"]


def test_the_figures_of_a_frame() -> None:
    """Parent, authority and stamps of the newest sample, the rate of the intervals, and the number of samples."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S), "first")
    assert buffer.frames()["base"].rate == 0.0
    for i in range(1, 21):
        buffer.set_transform(stamped("map", "base", S + i * S // 20), "second")
    info = buffer.frame("base")
    assert info == buffer.frames()["base"]
    assert info is not None
    assert (info.parent, info.authority, info.static, info.oldest, info.newest) == ("map", "second", False, S, 2 * S)
    assert (info.rate, info.samples) == (pytest.approx(20.0), 21)
    assert buffer.frame("nowhere") is None
    assert (buffer.chain("base"), buffer.chain("nowhere")) == (["base", "map"], ["nowhere"])


def test_exact_duplicates_are_counted_silently() -> None:
    """A sample that came again, as the newest one or late, is no error and is stored once."""
    buffer = filled()
    for second in (20, 12):
        assert buffer.set_transform(stamped("odom", "base", second * S, float(second)), "second") is None
    assert (buffer.duplicates, buffer.frames()["base"].samples) == (2, 2)


@pytest.mark.parametrize("roll", [0.0, 0.1], ids=["planar", "spatial"])
def test_the_cache_of_each_frame_ends_to_the_nanosecond(roll: float) -> None:
    """A sample as old as the cache, counted from its own frame's newest one, is kept and used, an older one is not."""
    buffer = Buffer(cache_time=10.0)
    buffer.set_transform(stamped("map", "slow", S, 7.0), "test")
    for stamp in (20 * S, 10 * S, 20 * S + 1):
        sample = stamped("map", "base", stamp, stamp / S)
        sample.transform.rotation = Quaternion(*quaternion_from_rpy(roll, 0.0, 0.0))
        assert buffer.set_transform(sample, "test") is None
        oldest = 20 * S if stamp > 20 * S else 10 * S
        if stamp != 20 * S:
            assert buffer.frames()["base"].oldest == oldest
            assert buffer.lookup_pose2("map", "base", oldest)[0].x == oldest / S
            with pytest.raises(tf.BackwardExtrapolationException):
                buffer.lookup_transform("map", "base", oldest - 1)
    buffer.set_transform(stamped("map", "base", 31 * S), "test")
    with pytest.raises(tf.NoDataForExtrapolationException):
        buffer.lookup_transform("map", "base", 31 * S - 1)
    assert buffer.lookup_pose2("map", "slow", S)[0].x == 7.0


@pytest.mark.parametrize("ahead", [10, 11, 2**31])
def test_a_sample_far_ahead_of_the_time_hides_no_later_one(ahead: int) -> None:
    """Where the time is known, what is further ahead of it than the buffer remembers is refused."""
    buffer = Buffer()
    refused = buffer.set_transforms([stamped("map", "base", (100 + ahead) * S, 9.0)], "test", 100 * S)
    assert [each.code for each in refused] == (["TF_FUTURE_DATA"] if ahead > 10 else [])
    assert buffer.set_transforms([stamped("map", "base", 100 * S, 1.0)], "test", 100 * S) == []
    assert buffer.lookup_pose2("map", "base", 100 * S)[0].x == 1.0


def test_a_late_sample_of_the_old_parent_goes_where_it_belongs() -> None:
    """Each time has the parent of its own sample, also after a late sample; outdated paths are not used."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "room", 0, 100.0), "test")
    buffer.set_transform(stamped("map", "base", S, 1.0), "test")
    buffer.set_transform(stamped("room", "base", 3 * S, 3.0), "test")
    assert buffer.lookup_pose2("map", "base", 2 * S)[0].x == 1.0
    buffer.set_transform(stamped("map", "base", 2 * S, 2.0), "test")
    assert [buffer.lookup_pose2("map", "base", time * S // 2)[0].x for time in (4, 3, 0)] == [2.0, 1.5, 103.0]


def test_a_frame_that_has_come_once_takes_little_memory() -> None:
    """Any program can invent frames."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S), "test")
    assert buffer._edges["base"].edge.room <= 2


def test_the_full_static_set_replaces_the_old_one_whole() -> None:
    """Edges that it no longer has are forgotten, and those of the old set make no loop with the new ones."""
    buffer = Buffer()
    buffer.set_all_static([stamped("map", "a", 0, 1.0), stamped("a", "b", 0, 2.0)], "tf")
    buffer.set_transform_static(stamped("map", "door", 0), "other")
    assert buffer.set_all_static([stamped("/b", "a", 0, 5.0), stamped("map", "/b", 0, 6.0)], "tf") == []
    assert {child: info.parent for child, info in buffer.frames().items()} == {"a": "b", "b": "map", "door": "map"}
    assert [each.code for each in buffer.set_all_static([stamped("map", "b", 0, 3.0), stamped("", "c", 0)], "tf")] == [
        "TF_NO_FRAME_ID"
    ]
    assert list(buffer.frames()) == ["b", "door"]
    assert buffer.lookup_pose2("map", "b", 0)[0].x == 3.0
    assert buffer.set_transform(stamped("map", "a", S, 5.0), "robot") is None


def test_a_static_transform_that_changes_is_used_at_once() -> None:
    """A new value or parent of a static edge, and a moving edge that becomes static, also on a prepared path."""
    buffer = filled()
    buffer.set_transform_static(stamped("base", "tip", 0, 1.0), "test")
    buffer.set_transform_static(stamped("map", "room", 0, 100.0), "test")
    assert buffer.lookup_pose2("map", "tip", 20 * S)[0].x == 22.0
    for edge, x in (
        (stamped("base", "tip", 0, 2.0), 23.0),
        (stamped("room", "odom", 0, 3.0), 125.0),
        (stamped("map", "room", 0, 200.0), 225.0),
        (stamped("odom", "base", 0, 0.0), 205.0),
    ):
        assert buffer.set_transform_static(edge, "test") is None
        assert buffer.lookup_pose2("map", "tip", 20 * S)[0].x == x
    assert buffer.lookup_pose2("map", "tip", 99 * S)[0].x == 205.0
    assert buffer.frames()["base"].static


def test_a_forgotten_frame_may_come_back_elsewhere() -> None:
    """A forgotten edge gives no answers, and its frame can be stored under another parent."""
    buffer = chain(2)
    assert buffer.lookup_pose2("f0", "f2", 0)[0].x == 2.0
    buffer.forget("f1")
    assert not buffer.can_transform("f0", "f2", 0)[0]
    assert list(buffer.frames()) == ["f2"]
    assert buffer.set_transform(stamped("moon", "f1", S, 7.0), "test") is None
    assert buffer.lookup_pose2("moon", "f2", 0) == (Pose2(8.0, 0.0, 0.0), S)


def test_time_that_goes_back_clears_the_buffer(caplog: pytest.LogCaptureFixture) -> None:
    """tf2's time_backwards: moving data goes, static data stays, the jump is logged, and new data is stored."""
    buffer = filled()
    assert [buffer.take_time(now * S) for now in (19, 20, 20)] == [False, False, False]
    assert caplog.text == ""
    assert buffer.take_time(10 * S)
    assert "jump back in time of 10.000 s" in caplog.text
    assert list(buffer.frames()) == ["odom"]
    with pytest.raises(tf.ExtrapolationException, match="it was cleared"):
        buffer.lookup_transform("map", "base", S)
    with pytest.raises(tf.ConnectivityException):
        buffer.lookup_transform("map", "base", 0)
    assert buffer.set_transform(stamped("odom", "base", 10 * S, 5.0), "test") is None
    assert buffer.lookup_pose2("map", "base", 0)[0].x == 6.0
    assert not buffer.take_time(11 * S)
    buffer.clear()
    assert buffer.set_transform_static(stamped("odom", "base", 0, 2.0), "test") is None
    assert buffer.lookup_pose2("map", "base", 77 * S)[0].x == 3.0


def test_a_ring_of_frames_seen_from_everywhere() -> None:
    """Look-ups between eight frames at 45 degrees are right, at sampled times and between them."""
    step = Pose2(math.cos(math.pi / 4) - 1.0, math.sin(math.pi / 4), math.pi / 4)
    buffer = Buffer()
    for stamp, i in itertools.product((S, 2 * S), range(7)):
        buffer.set_transform(stamped(f"r{i}", f"r{i + 1}", stamp, *step), "test")
    poses = list(itertools.accumulate([step] * 7, Pose2.compose, initial=Pose2(0.0, 0.0, 0.0)))
    for (i, a), (j, b) in itertools.product(enumerate(poses), repeat=2):
        expected = a.inverse().compose(b)
        for time in (0, S, 3 * S // 2, 2 * S):
            pose, stamp = buffer.lookup_pose2(f"r{i}", f"r{j}", time)
            assert pose[:2] == pytest.approx(expected[:2], abs=1e-9)
            assert math.cos(pose.yaw - expected.yaw) == pytest.approx(1.0, abs=1e-12)
            assert stamp == (time or (0 if i == j == 0 else 2 * S))


def test_a_robot_may_leave_the_plane() -> None:
    """A look-up follows z and pitch in the middle of a stream, through turned and raised static edges on both sides."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("base", "tip", 0, 1.0, 0.5, 0.0), "test")
    mast = stamped("tip", "mast", 0)
    mast.transform.translation.z = 2.0
    buffer.set_transform_static(mast, "test")
    samples = [stamped("map", "base", second * S, float(second), 0.0, math.pi / 2) for second in (1, 2, 3, 4)]
    samples[2].transform.translation.z = 1.0
    samples[3].transform.rotation = Quaternion(*quaternion_from_rpy(0.0, -math.pi / 2, 0.0))
    for sample in samples:
        assert buffer.set_transform(sample, "test") is None
        found = buffer.lookup_transform("map", "mast", 0).transform.translation
        back = buffer.lookup_transform("mast", "map", 0).transform.translation
    assert (found.x, found.y, found.z) == pytest.approx((2.0, 0.5, 1.0))
    assert (back.x, back.y, back.z) == pytest.approx((-1.0, -0.5, 2.0))
    for time, place in ((3 * S // 2, (1.0, 1.0, 2.0)), (5 * S // 2, (2.0, 1.0, 2.5))):
        found = buffer.lookup_transform("map", "mast", time).transform.translation
        assert (found.x, found.y, found.z) == pytest.approx(place)


def test_a_very_deep_chain_is_not_called_a_loop() -> None:
    """A chain of any depth is walked (tf2 stops at a thousand frames), and static edges hold at any time."""
    buffer = chain(1100)
    for time in (0, 10**18):
        found = buffer.lookup_transform("f1100", "f50", time)
        assert found.transform.translation.x == -1050.0
        assert (ns_from_time(found.header.stamp), found.header.frame_id, found.child_frame_id) == (
            time,
            "f1100",
            "f50",
        )


def test_the_latest_common_time_is_the_slowest_edges_newest() -> None:
    """It is the minimum over the path's moving edges; 0 if all are static, None without a path."""
    buffer = filled()
    buffer.set_transform(stamped("map", "other", 2 * S), "test")
    buffer.set_transform_static(stamped("moon", "crater", 0), "test")
    for target, source, expected in (
        ("map", "base", 20 * S),
        ("base", "other", 2 * S),
        ("odom", "map", 0),
        ("base", "base", 20 * S),
        ("map", "map", 0),
        ("map", "crater", None),
        ("map", "nowhere", None),
    ):
        assert buffer.latest_common_time(target, source) == expected


def test_a_moving_frame_stamped_0_does_not_hold_back_the_others() -> None:
    """As in tf2, a sample stamped 0 does not count for the latest common time, and is valid only at 0."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "odom", 0, 1.0), "test")
    assert buffer.lookup_pose2("map", "odom", 0) == (Pose2(1.0, 0.0, 0.0), 0)
    for stamp in (3 * S, 0):
        buffer.set_transform(stamped("odom", "base", stamp), "test")
    assert buffer.latest_common_time("map", "base") == 3 * S
    with pytest.raises(tf.NoDataForExtrapolationException):
        buffer.lookup_transform("map", "base", 0)


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
    assert "at 99.000000000 s" in why
    assert "'nobody'" in buffer.can_transform_full("me", S, "ball", S, "nobody")[1]


@pytest.mark.parametrize(
    ("target", "source", "time", "kind", "text"),
    [
        ("map", "nowhere", 0, tf.LookupException, "source_frame: there is no frame 'nowhere'"),
        ("nowhere", "map", S, tf.LookupException, "target_frame: there is no frame 'nowhere'"),
        ("", "map", 0, tf.InvalidArgumentException, "target_frame: '' is no name"),
        ("map", "/base", 0, tf.InvalidArgumentException, "source_frame: '/base' is no name"),
        ("map", "crater", 0, tf.ConnectivityException, "'map' and 'crater'"),
        ("map", "crater", S, tf.ConnectivityException, "'map' and 'crater'"),
        ("moon", "crater", 2 * S, tf.NoDataForExtrapolationException, "at 2.000000000 s, but from 1.000000000 s"),
        ("map", "base", 20 * S + 1, tf.ForwardExtrapolationException, "at 20.000000001 s, but from 12.000000000 s"),
        ("map", "base", 10**30, tf.ForwardExtrapolationException, "there is no data between"),
        ("base", "map", 12 * S - 1, tf.BackwardExtrapolationException, "at 11.999999999 s, but from 12.000000000 s to"),
    ],
)  # fmt: skip
def test_why_not_is_always_said(target: str, source: str, time: int, kind: type[Exception], text: str) -> None:
    """The exceptions are tf2's, times in their texts to the nanosecond; can_transform returns the same text."""
    buffer = filled()
    buffer.set_transform(stamped("moon", "crater", S), "test")
    with pytest.raises(kind) as caught:
        buffer.lookup_transform(target, source, time)
    assert text in str(caught.value)
    assert buffer.can_transform(target, source, time) == (False, str(caught.value))
