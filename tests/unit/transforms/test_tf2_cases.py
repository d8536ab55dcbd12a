"""Cases of tf2's own test suites, written anew for this buffer; each docstring begins with tf2's name."""

import itertools
import math
import random

import pytest

from support.transforms import S, chain, stamped
from zteam.geometry import quaternion_from_rpy
from zteam.messages import Header, Quaternion, Transform, TransformStamped, Vector3, ns_from_time, time_from_ns
from zteam.tf import (
    Buffer,
    ExtrapolationException,
    LookupException,
    NoDataForExtrapolationException,
    TransformException,
)

TREES: dict[str, list[tuple[str, str]]] = {
    "one link": [("a", "b")],
    "i": [("a", "b"), ("b", "c")],
    "v": [("a", "b"), ("b", "c"), ("a", "d"), ("d", "e")],
    "y": [("a", "b"), ("b", "c"), ("b", "d"), ("d", "e")],
}
MULTI = [*TREES["v"], ("f", "g"), ("g", "h")]


def _tree(edges: list[tuple[str, str]], *stamps: int) -> Buffer:
    """A buffer in which every edge is one metre along x, at each of the stamps."""
    buffer = Buffer()
    for stamp in stamps:
        for parent, child in edges:
            assert buffer.set_transform(stamped(parent, child, stamp, 1.0), "test") is None
    return buffer


def _depths(edges: list[tuple[str, str]]) -> dict[str, int]:
    depths: dict[str, int] = {}
    for parent, child in edges:
        depths[child] = depths.setdefault(parent, 0) + 1
    return depths


@pytest.mark.parametrize("shape", TREES)
def test_every_pair_of_a_tree(shape: str) -> None:
    """one_link, i, v and y: look-ups between all frames, at samples, between them and at the latest time."""
    buffer = _tree(TREES[shape], S, 3 * S)
    depths = _depths(TREES[shape])
    for (target, t), (source, s) in itertools.product(depths.items(), repeat=2):
        for time in (0, S, 2 * S, 3 * S):
            found = buffer.lookup_transform(target, source, time)
            assert found.transform.translation.x == pytest.approx(s - t, abs=1e-12)
            assert ns_from_time(found.header.stamp) == (time or (3 * S if (target, source) != ("a", "a") else 0))


def test_pairs_of_two_trees_are_not_connected() -> None:
    """multi: frames of one tree are connected, frames of different trees are not."""
    buffer = _tree(MULTI, S, 2 * S)
    first, second = "abcde", "fgh"
    for target, source in itertools.product(first + second, repeat=2):
        together = (target in first) == (source in first)
        for time in (0, S, 3 * S // 2):
            assert buffer.can_transform(target, source, time)[0] is together


@pytest.mark.parametrize("direction", ["forward", "inverse", "through the root"])
def test_random_offsets_add_up(direction: str) -> None:
    """ListOne, ListTwo, ThroughRoot: translations add up in each direction, to the precision of doubles."""
    pick = random.Random(1)
    for _ in range(100):
        offsets = [[pick.uniform(-10.0, 10.0) for _ in range(3)] for _ in range(2)]
        parents = ("a", "b") if direction != "through the root" else ("a", "a")
        buffer = Buffer()
        for parent, child, offset in zip(parents, "bc", offsets, strict=True):
            message = stamped(parent, child, S)
            message.transform.translation = Vector3(*offset)
            buffer.set_transform(message, "test")
        first, second = offsets
        if direction == "forward":
            found, expected = buffer.lookup_transform("a", "c", S), [p + q for p, q in zip(first, second, strict=True)]
        elif direction == "inverse":
            found, expected = buffer.lookup_transform("c", "a", S), [-p - q for p, q in zip(first, second, strict=True)]
        else:
            found, expected = buffer.lookup_transform("b", "c", S), [q - p for p, q in zip(first, second, strict=True)]
        t = found.transform.translation
        assert [t.x, t.y, t.z] == pytest.approx(expected, abs=1e-13)


def _spatial(stamp: int, place: list[float], rpy: list[float]) -> TransformStamped:
    rotation = Quaternion(*quaternion_from_rpy(*rpy))
    return TransformStamped(Header(time_from_ns(stamp), "a"), "b", Transform(Vector3(*place), rotation))


def test_places_between_two_samples_lie_on_the_line() -> None:
    """CartesianInterpolation: places are linear at a hundred times between two random samples."""
    pick = random.Random(2)
    for _ in range(20):
        first, last = ([pick.uniform(-10.0, 10.0) for _ in range(3)] for _ in range(2))
        buffer = Buffer()
        buffer.set_transform(_spatial(S, first, [0.0, 0.0, 0.0]), "test")
        buffer.set_transform(_spatial(2 * S, last, [0.0, 0.0, 0.0]), "test")
        for part in range(101):
            t = buffer.lookup_transform("a", "b", S + part * S // 100).transform.translation
            expected = [p + (q - p) * part / 100 for p, q in zip(first, last, strict=True)]
            assert [t.x, t.y, t.z] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2], ids=["roll", "pitch", "yaw"])
def test_angles_between_two_samples_are_divided_evenly(axis: int) -> None:
    """Slerp, AngularInterpolation: angles about each axis are linear in time, also where they pass pi."""
    pick = random.Random(3)
    for _ in range(20):
        begin, turn = pick.uniform(-3.0, 3.0), pick.uniform(-3.0, 3.0)
        buffer = Buffer()
        for stamp, angle in ((S, begin), (2 * S, begin + turn)):
            rpy = [0.0, 0.0, 0.0]
            rpy[axis] = angle
            buffer.set_transform(_spatial(stamp, [0.0, 0.0, 0.0], rpy), "test")
        for part in range(101):
            r = buffer.lookup_transform("a", "b", S + part * S // 100).transform.rotation
            half = math.atan2((r.x, r.y, r.z)[axis], r.w)
            assert math.cos(2.0 * half - begin - turn * part / 100) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("order", ["forward", "reverse", "random"])
def test_the_order_of_insertion(order: str) -> None:
    """Repeatability, ReverseInsertOrder, RandomInsertOrder: each order gives the same history."""
    stamps = list(range(S, 6 * S, S // 10))
    if order == "reverse":
        stamps.reverse()
    elif order == "random":
        random.Random(4).shuffle(stamps)
    buffer = Buffer()
    for stamp in stamps:
        assert buffer.set_transform(stamped("a", "b", stamp, stamp / S), "test") is None
    info = buffer.frames()["b"]
    assert (info.oldest, info.newest, info.samples) == (S, 6 * S - S // 10, 50)
    for stamp in stamps:
        assert buffer.lookup_pose2("a", "b", stamp)[0].x == stamp / S


def test_repeated_samples_are_kept_once() -> None:
    """RepeatedElements, RepeatedTimes: equal stamps divide nothing by zero, and the first value stays."""
    buffer = Buffer()
    for stamp in (S, S, 2 * S, 2 * S):
        buffer.set_transform(stamped("a", "b", stamp, 1.0), "test")
    assert buffer.set_transform(stamped("a", "b", S, 9.0), "test") is not None
    assert buffer.frames()["b"].samples == 2
    for time in (S, 3 * S // 2, 2 * S):
        assert buffer.lookup_pose2("a", "b", time)[0].x == 1.0


def test_zero_asks_for_the_newest() -> None:
    """ZeroAtFront: a look-up at 0 gives the newest sample, after each new one."""
    buffer = Buffer()
    for second in range(1, 10):
        buffer.set_transform(stamped("a", "b", second * S, float(second)), "test")
        assert buffer.lookup_pose2("a", "b", 0)[0].x == second


@pytest.mark.parametrize("seconds", range(2, 98, 19))
def test_the_length_of_the_cache(seconds: int) -> None:
    """cache_time: a time in the cache is answered, and an older one raises, to the nanosecond."""
    buffer = Buffer(cache_time=seconds)
    for second in range(1, 2 * seconds + 2):
        buffer.set_transform(stamped("a", "b", second * S, float(second)), "test")
    end = (seconds + 1) * S
    with pytest.raises(ExtrapolationException):
        buffer.lookup_transform("a", "b", end - 1)
    for second in range(seconds + 1, 2 * seconds + 2):
        assert buffer.lookup_pose2("a", "b", second * S)[0].x == second


@pytest.mark.parametrize("target_time", ["old", "zero", "valid", "future"])
@pytest.mark.parametrize("source_time", ["old", "zero", "valid", "future"])
def test_both_times_of_a_full_look_up_have_to_be_there(target_time: str, source_time: str) -> None:
    """canTransform, lookupTransform: two branches, each at an old, the latest, a stored or a future time."""
    times = {"old": S // 2, "zero": 0, "valid": 2 * S, "future": 4 * S}
    buffer = _tree(TREES["v"], S, 3 * S)
    able = {target_time, source_time} <= {"zero", "valid"}
    asked = ("c", times[target_time], "e", times[source_time], "a")
    assert buffer.can_transform_full(*asked)[0] is able
    if able:
        assert buffer.lookup_transform_full(*asked).transform.translation.x == pytest.approx(0.0, abs=1e-12)
    else:
        with pytest.raises(ExtrapolationException):
            buffer.lookup_transform_full(*asked)


@pytest.mark.parametrize("time", [0, S])
def test_frames_without_a_sample(time: int) -> None:
    """Nothing_Exists and One_Exists: LookupException names the missing frame, can_transform says the same."""
    buffer = Buffer()
    for put in (False, True):
        if put:
            buffer.set_transform(stamped("a", "b", S), "test")
        for target, source in (("a", "x"), ("x", "b"), ("x", "y")):
            missing = next(name for name in (target, source) if not put or name not in "ab")
            with pytest.raises(LookupException, match=f'"{missing}"'):
                buffer.lookup_transform(target, source, time)
            assert f'"{missing}"' in buffer.can_transform(target, source, time)[1]


def test_one_value_is_not_extrapolated() -> None:
    """ExtrapolationFromOneValue: a single sample is not extrapolated, alone or within a longer path."""
    buffer = Buffer()
    buffer.set_transform(stamped("a", "b", 10 * S), "test")
    for stamp in (5 * S, 15 * S):
        buffer.set_transform(stamped("b", "c", stamp), "test")
    for time in (9 * S, 11 * S):
        for source in "bc":
            with pytest.raises(NoDataForExtrapolationException):
                buffer.lookup_transform("a", source, time)
    assert buffer.can_transform("a", "c", 10 * S)[0]


def test_fixed_and_moving_links() -> None:
    """test_static_publisher: static links hold at any time, moving ones within their data; a parent may change."""
    buffer = chain(2)
    for stamp in (10 * S, 12 * S):
        buffer.set_transform(stamped("f2", "d", stamp, 1.0), "test")
    for time in (0, S, 10**12):
        assert buffer.lookup_pose2("f0", "f2", time)[0].x == 2.0
    assert buffer.lookup_pose2("f0", "d", 11 * S)[0].x == 3.0
    for time in (9 * S, 13 * S):
        with pytest.raises(TransformException):
            buffer.lookup_transform("f0", "d", time)
    buffer.set_transform_static(stamped("f0", "f2", 0, 5.0), "test")
    assert buffer.lookup_pose2("f0", "d", 11 * S)[0].x == 6.0
    assert buffer.lookup_pose2("f1", "d", 11 * S)[0].x == 5.0
