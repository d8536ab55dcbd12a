"""More of tf2's contract, by hand: windows, walks through the tree, times that do not fit, waiting, threads."""

import itertools
import math
import random
import threading
from collections.abc import Callable

import pytest
from test_tf_buffer import S, stamped

from zteam.clock import wait_until
from zteam.errors import ZteamError
from zteam.geometry import Pose2, compose2, inverse2
from zteam.messages import Quaternion, ns_from_time
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


def _chain(count: int) -> Buffer:
    """f0 → f1 → … → f<count>, one metre each, all fixed."""
    buffer = Buffer()
    for i in range(count):
        assert buffer.set_transform_static(stamped(f"f{i}", f"f{i + 1}", 0, 1.0), "test") is None
    return buffer


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


@pytest.mark.parametrize(
    ("parent", "child", "code"),
    [
        ("map", "", "TF_NO_CHILD_FRAME_ID"),
        ("map", "/", "TF_NO_CHILD_FRAME_ID"),
        ("", "base", "TF_NO_FRAME_ID"),
        ("/", "base", "TF_NO_FRAME_ID"),
        ("base", "base", "TF_SELF_TRANSFORM"),
        ("/base", "base", "TF_SELF_TRANSFORM"),
    ],
)
@pytest.mark.parametrize("static", [False, True], ids=["moving", "static"])
def test_bad_names_are_refused_without_a_trace(parent: str, child: str, code: str, static: bool) -> None:
    """tf2's code, a text that names who sent it, and neither frame is known afterwards."""
    buffer = Buffer()
    put = buffer.set_transform_static if static else buffer.set_transform
    refused = put(stamped(parent, child, S), "robot_1")
    assert refused is not None
    assert refused.code == code
    assert "robot_1" in refused.text
    for name in ("map", "base"):
        with pytest.raises(LookupException):
            buffer.lookup_transform(name, "other", 0)


@pytest.mark.parametrize(("square", "accepted"), [(0.985, False), (0.9901, True), (1.0099, True), (1.011, False)])
def test_how_far_from_a_unit_quaternion_is_accepted(square: float, accepted: bool) -> None:
    """tf2's tolerance on the squared length; what is accepted comes out as a unit quaternion."""
    buffer = Buffer()
    transform = stamped("map", "base", S)
    transform.transform.rotation = Quaternion(0.0, 0.0, 0.0, math.sqrt(square))
    refused = buffer.set_transform(transform, "test")
    if accepted:
        assert refused is None
        assert buffer.lookup_transform("map", "base", S).transform.rotation.w == pytest.approx(1.0, abs=1e-15)
    else:
        assert refused is not None
        assert refused.code == "TF_DENORMALIZED_QUATERNION"


def test_a_refused_sample_changes_nothing() -> None:
    """What is refused registers no frame, no authority, no parent."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", 20 * S, 1.0), "first")
    before = buffer.frames()
    for transform in (
        stamped("other", "base", 20 * S, 5.0),
        stamped("other", "base", 9 * S),
        stamped("base", "map", S),
    ):
        assert buffer.set_transform(transform, "second") is not None
    assert buffer.frames() == before
    with pytest.raises(LookupException, match="other"):
        buffer.lookup_transform("other", "base", 0)


def test_a_sample_exactly_as_old_as_the_cache_is_kept() -> None:
    """The window is closed at its old end, on insertion and on pruning, to the nanosecond."""
    buffer = Buffer(cache_time=10.0)
    buffer.set_transform(stamped("map", "base", 20 * S, 2.0), "test")
    assert buffer.set_transform(stamped("map", "base", 10 * S, 1.0), "test") is None
    refused = buffer.set_transform(stamped("map", "base", 10 * S - 1), "test")
    assert refused is not None
    assert refused.code == "TF_OLD_DATA"
    assert buffer.frames()["base"].oldest == 10 * S
    buffer.set_transform(stamped("map", "base", 20 * S + 1), "test")
    assert buffer.frames()["base"].oldest == 20 * S


def test_the_cache_is_counted_per_frame() -> None:
    """A fast frame's progress takes nothing from a slow frame's history."""
    buffer = Buffer(cache_time=2.0)
    buffer.set_transform(stamped("map", "slow", S, 1.0), "test")
    for second in range(1, 60):
        buffer.set_transform(stamped("map", "fast", second * S), "test")
    assert buffer.frames()["slow"].newest == S
    assert buffer.lookup_pose2("map", "slow", S)[0].x == 1.0


def test_rates_are_counted_from_intervals() -> None:
    """Twenty intervals in a second are 20 Hz, and one sample has no rate."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S), "test")
    assert buffer.frames()["base"].rate == 0.0
    for i in range(1, 21):
        buffer.set_transform(stamped("map", "base", S + i * S // 20), "test")
    assert buffer.frames()["base"].rate == pytest.approx(20.0)


def test_a_ring_of_frames_seen_from_everywhere() -> None:
    """Eight frames at 45 degrees: each seen from each other one, at sampled times and between them."""
    step = Pose2(math.cos(math.pi / 4) - 1.0, math.sin(math.pi / 4), math.pi / 4)
    buffer = Buffer()
    for stamp in (S, 2 * S):
        for i in range(7):
            buffer.set_transform(stamped(f"r{i}", f"r{i + 1}", stamp, *step), "test")
    poses = list(itertools.accumulate([step] * 7, compose2, initial=Pose2(0.0, 0.0, 0.0)))
    for (i, a), (j, b) in itertools.product(enumerate(poses), repeat=2):
        expected = compose2(inverse2(a), b)
        for time in (0, S, 3 * S // 2, 2 * S):
            pose, _ = buffer.lookup_pose2(f"r{i}", f"r{j}", time)
            assert pose[:2] == pytest.approx(expected[:2], abs=1e-9)
            assert math.cos(pose.yaw - expected.yaw) == pytest.approx(1.0, abs=1e-12)


def test_a_helix_is_followed_between_its_samples() -> None:
    """A moving and turning frame, sampled at 100 Hz, is where it should be between the samples."""
    buffer = Buffer()

    def pose_at(t: float) -> Pose2:
        return Pose2(2.0 * math.cos(t), 2.0 * math.sin(t), t)

    for i in range(101):
        x, y, yaw = pose_at(i / 100)
        transform = stamped("map", "base", S + i * S // 100, x, y, yaw)
        transform.transform.translation.z = i / 100
        buffer.set_transform(transform, "test")
    for i in range(1, 1000):
        found = buffer.lookup_transform("map", "base", S + i * S // 1000).transform
        x, y, yaw = pose_at(i / 1000)
        # The chord lies at most r (1 - cos(half a step)) inside the arc.
        assert (found.translation.x, found.translation.y) == pytest.approx((x, y), abs=2.0 * (1 - math.cos(0.005)))
        assert found.translation.z == pytest.approx(i / 1000, abs=1e-9)
        assert 2.0 * math.atan2(found.rotation.z, found.rotation.w) == pytest.approx(yaw, abs=1e-9)


def test_a_very_deep_chain_is_not_called_a_loop() -> None:
    """Depth alone is no fault (tf2 gives up at a thousand)."""
    buffer = _chain(1500)
    assert buffer.lookup_pose2("f0", "f1500", 0)[0].x == 1500.0
    assert buffer.lookup_pose2("f1500", "f700", S)[0].x == -800.0


def test_what_is_missing_above_the_common_ancestor_does_not_matter() -> None:
    """Two frames of one robot are connected at a time of which the robot's place is not known."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S, 50.0), "test")
    for stamp in (S, 5 * S):
        buffer.set_transform(stamped("base", "left", stamp, 0.0, 1.0), "test")
        buffer.set_transform(stamped("base", "right", stamp, 0.0, -1.0), "test")
    pose, stamp = buffer.lookup_pose2("right", "left", 4 * S)
    assert pose.y == 2.0
    assert buffer.lookup_pose2("right", "left", 0)[1] == 5 * S
    with pytest.raises(ExtrapolationException):
        buffer.lookup_transform("map", "left", 4 * S)


def test_the_latest_common_time_is_the_slowest_edges_newest() -> None:
    """The minimum over the path, fixed edges not counted; 0 if all are fixed, None where there is no path."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "odom", 0), "test")
    buffer.set_transform_static(stamped("base", "laser", 0), "test")
    buffer.set_transform(stamped("odom", "base", 3 * S), "test")
    buffer.set_transform(stamped("map", "other", 2 * S), "test")
    buffer.set_transform_static(stamped("moon", "crater", 0), "test")
    assert buffer.latest_common_time("map", "laser") == 3 * S
    assert buffer.latest_common_time("laser", "other") == 2 * S
    assert buffer.latest_common_time("odom", "map") == 0
    assert buffer.latest_common_time("map", "crater") is None
    assert buffer.latest_common_time("map", "nowhere") is None


def test_a_moving_frame_stamped_0_does_not_hold_back_the_others() -> None:
    """As in tf2, data without a stamp does not count for the latest common time; it holds at 0 and then only."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "odom", 0, 1.0), "test")
    assert buffer.lookup_pose2("map", "odom", 0) == (Pose2(1.0, 0.0, 0.0), 0)
    buffer.set_transform(stamped("odom", "base", 3 * S), "test")
    assert buffer.latest_common_time("map", "base") == 3 * S
    with pytest.raises(NoDataForExtrapolationException):
        buffer.lookup_transform("map", "base", 0)


def test_the_latest_common_time_may_lie_before_an_edges_history() -> None:
    """A one-shot edge keeps 'latest' at a time that a fast edge has forgotten: that is an extrapolation."""
    buffer = Buffer(cache_time=1.0)
    buffer.set_transform(stamped("map", "odom", S), "test")
    for second in (5, 6):
        buffer.set_transform(stamped("odom", "base", second * S), "test")
    with pytest.raises(BackwardExtrapolationException):
        buffer.lookup_transform("map", "base", 0)


def test_fixed_transforms_hold_at_any_time_and_carry_the_time_asked_for() -> None:
    """Past, present and future give the same place; the answer's stamp is the question's."""
    buffer = _chain(3)
    for time in (0, 1, S, 10**18):
        transform = buffer.lookup_transform("f3", "f0", time)
        assert transform.transform.translation.x == -3.0
        assert ns_from_time(transform.header.stamp) == time
        assert (transform.header.frame_id, transform.child_frame_id) == ("f3", "f0")


def test_a_frame_seen_from_itself() -> None:
    """Identity, stamped with the time asked for or with the frame's newest sample."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", 3 * S, 5.0), "test")
    assert buffer.lookup_pose2("base", "base", 0) == (Pose2(0.0, 0.0, 0.0), 3 * S)
    assert buffer.lookup_pose2("base", "base", S) == (Pose2(0.0, 0.0, 0.0), S)


def test_where_something_was_seen_from_where_i_am_now() -> None:
    """Two times tied together by a fixed frame; the stamp is the target's time."""
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
    """can_transform's text is the exception's own, and never empty."""
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


def test_a_fixed_edge_that_moves_is_not_remembered() -> None:
    """A new value or a new parent of a static transform shows at once, also on a path that was used before."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "room", 0, 100.0), "test")
    buffer.set_transform_static(stamped("map", "table", 0, 1.0), "test")
    assert buffer.lookup_pose2("map", "table", 0)[0].x == 1.0
    buffer.set_transform_static(stamped("map", "table", 0, 2.0), "test")
    assert buffer.lookup_pose2("map", "table", 0)[0].x == 2.0
    buffer.set_transform_static(stamped("room", "table", 0, 3.0), "test")
    assert buffer.lookup_pose2("map", "table", 0)[0].x == 103.0
    buffer.set_transform_static(stamped("map", "room", 0, 200.0), "test")
    assert buffer.lookup_pose2("map", "table", 0)[0].x == 203.0


def test_a_moving_frame_may_become_fixed() -> None:
    """Static data takes a frame over, history and all, also after a clear."""
    for clear in (False, True):
        buffer = Buffer()
        buffer.set_transform(stamped("map", "base", 5 * S, 1.0), "test")
        if clear:
            buffer.clear()
        assert buffer.set_transform_static(stamped("map", "base", 0, 2.0), "test") is None
        assert buffer.lookup_pose2("map", "base", 77 * S)[0].x == 2.0
        assert buffer.frames()["base"].static


def test_a_late_sample_of_the_old_parent_goes_where_it_belongs() -> None:
    """Out of order and across a change of parent: each time has its own parent, and old paths are not reused."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "room", 0, 100.0), "test")
    buffer.set_transform(stamped("map", "base", S, 1.0), "test")
    buffer.set_transform(stamped("room", "base", 3 * S, 3.0), "test")
    assert buffer.lookup_pose2("map", "base", 2 * S)[0].x == 1.0
    buffer.set_transform(stamped("map", "base", 2 * S, 2.0), "test")
    assert buffer.lookup_pose2("map", "base", 2 * S)[0].x == 2.0
    assert buffer.lookup_pose2("map", "base", 3 * S // 2)[0].x == 1.5
    assert buffer.lookup_pose2("map", "base", 0)[0].x == 103.0


def test_a_forgotten_frame_may_come_back_elsewhere() -> None:
    """Nothing of a forgotten edge answers, and nothing of it stands in the way."""
    buffer = Buffer()
    buffer.set_transform_static(stamped("map", "a", 0, 1.0), "test")
    buffer.set_transform_static(stamped("a", "b", 0, 1.0), "test")
    assert buffer.lookup_pose2("map", "b", 0)[0].x == 2.0
    buffer.forget("a")
    assert not buffer.can_transform("map", "b", 0)[0]
    assert list(buffer.frames()) == ["b"]
    assert buffer.set_transform(stamped("moon", "a", S, 7.0), "test") is None
    assert buffer.lookup_pose2("moon", "b", 0) == (Pose2(8.0, 0.0, 0.0), S)


def test_every_waiter_is_woken(monkeypatch: pytest.MonkeyPatch) -> None:
    """Waits for several pairs end as their own data comes, static data included, long before their time-out."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "slow", S), "test")
    answers: dict[str, float] = {}
    asleep = threading.Semaphore(0)

    def announce(condition: threading.Condition, ready: Callable[[], bool], timeout: float) -> bool:
        # The caller holds the lock: whoever gets it after this finds the caller asleep.
        asleep.release()
        return wait_until(condition, ready, timeout)

    monkeypatch.setattr("zteam.tf.buffer.wait_until", announce)

    def wait(frame: str) -> None:
        found = buffer.wait_for_transform("map", frame, 0, 1000.0)
        answers[frame] = found.transform.translation.x

    threads = [threading.Thread(target=wait, args=(name,), daemon=True) for name in ("a", "b", "c")]
    for thread in threads:
        thread.start()
        assert asleep.acquire(timeout=30.0)
    buffer.set_transform_static(stamped("map", "a", 0, 1.0), "test")
    buffer.set_transform(stamped("map", "b", S, 2.0), "test")
    buffer.set_all_static([stamped("map", "c", 0, 3.0)], "other")
    for thread in threads:
        thread.join(30.0)
    assert answers == {"a": 1.0, "b": 2.0, "c": 3.0}


def test_a_wait_in_vain_ends_with_its_own_reason() -> None:
    """The look-up's exception, not a time-out's."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S), "test")
    with pytest.raises(LookupException):
        buffer.wait_for_transform("map", "nowhere", 0, 0.01)
    with pytest.raises(NoDataForExtrapolationException):
        buffer.wait_for_transform("map", "base", 2 * S, 0.01)


def test_many_threads_see_one_tree() -> None:
    """Writers, late samples, a changing parent and readers at once: every answer is right, or one of tf2's errors.

    Every edge says its own stamp as x, so along map → base → arm any time's answer is that time once per moving edge.
    """
    buffer = Buffer(cache_time=1.0)
    ms = S // 1000
    buffer.set_transform_static(stamped("map", "room", 0), "test")
    for name, parent in (("base", "map"), ("arm", "base")):
        buffer.set_transform(stamped(parent, name, S, 1000.0), name)
    failures: list[str] = []
    answered = [0, 0]
    done = threading.Event()

    def write(name: str, parents: tuple[str, ...], seed: int) -> None:
        stamps = list(range(1001, 3000))
        shuffle = random.Random(seed)
        for i in range(0, len(stamps), 4):
            block = stamps[i : i + 4]
            shuffle.shuffle(block)
            for stamp in block:
                parent = parents[(stamp // 50) % len(parents)]
                refused = buffer.set_transform(stamped(parent, name, stamp * ms, float(stamp)), name)
                if refused is not None:
                    failures.append(refused.text)

    def read(index: int) -> None:
        pick = random.Random(index)
        while not done.is_set() or answered[index] < 100:
            newest = buffer.frames()["arm"].newest
            time = pick.choice([0, newest - pick.randrange(200) * ms])
            try:
                found = buffer.lookup_transform("base", "arm", time)
                whole = buffer.lookup_transform("room", "arm", ns_from_time(found.header.stamp))
            except ExtrapolationException:
                continue
            answered[index] += 1
            stamp = ns_from_time(found.header.stamp) / ms
            if abs(found.transform.translation.x - stamp) > 1e-6:
                failures.append(f"base → arm at {stamp}: {found.transform.translation.x}")
            # Across a change of parent the older sample holds; its neighbour is at most four stamps of a block away.
            if not 2 * stamp - 5 <= whole.transform.translation.x <= 2 * stamp + 1e-6:
                failures.append(f"room → arm at {stamp}: {whole.transform.translation.x}")

    writers = [
        threading.Thread(target=write, args=("base", ("map", "room"), 1)),
        threading.Thread(target=write, args=("arm", ("base",), 2)),
    ]
    readers = [threading.Thread(target=read, args=(index,)) for index in (0, 1)]
    for thread in writers + readers:
        thread.start()
    for thread in writers:
        thread.join(60.0)
    done.set()
    for thread in readers:
        thread.join(60.0)
    assert not any(thread.is_alive() for thread in writers + readers)
    assert failures == []
    assert buffer.frames()["arm"].newest == 2999 * ms


def test_the_latest_look_up_uses_the_parents_of_its_time() -> None:
    """'Latest' answers as a look-up at the time that it reports, also if a parent changed after that time."""
    buffer = Buffer()
    for half in (2, 3):
        buffer.set_transform(stamped("map", "room", half * S // 2, 100.0), "test")
    buffer.set_transform(stamped("map", "base", S, 1.0), "test")
    buffer.set_transform(stamped("map", "base", 2 * S, 2.0), "test")
    buffer.set_transform(stamped("room", "base", 3 * S, 3.0), "test")
    assert buffer.lookup_pose2("map", "base", 3 * S // 2)[0].x == 1.5
    pose, stamp = buffer.lookup_pose2("map", "base", 0)
    assert (pose.x, stamp) == (1.5, 3 * S // 2)


def test_after_a_clear_a_time_is_an_extrapolation() -> None:
    """As in tf2 the frames are still known, and it is their data that is missing; the text says so."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", S), "test")
    buffer.clear()
    with pytest.raises(ExtrapolationException, match="cleared"):
        buffer.lookup_transform("map", "base", S)
    with pytest.raises(ConnectivityException):
        buffer.lookup_transform("map", "base", 0)


def test_a_frames_latest_common_time_with_itself_is_its_newest() -> None:
    """As tf2's, and as the stamp of the look-up itself."""
    buffer = Buffer()
    buffer.set_transform(stamped("map", "base", 3 * S), "test")
    assert buffer.latest_common_time("base", "base") == 3 * S


def test_a_fixed_set_of_another_shape_replaces_the_old_one_whole() -> None:
    """What counts is the new set: an edge of the old one is no loop in it."""
    buffer = Buffer()
    buffer.set_all_static([stamped("map", "a", 0, 1.0), stamped("a", "b", 0, 1.0)], "tf")
    assert buffer.set_all_static([stamped("b", "a", 0, 5.0), stamped("map", "b", 0, 5.0)], "tf") == []
    assert {child: info.parent for child, info in buffer.frames().items()} == {"a": "b", "b": "map"}


def test_error_texts_are_tf2s() -> None:
    """Nanoseconds in full, so that a look-up a nanosecond late does not say 'requested 1.0, latest 1.0'."""
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
