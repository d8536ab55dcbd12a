"""Laws of the buffer for any tree, any samples and any order of arrival."""

import itertools
import math
from typing import NamedTuple

from hypothesis import given
from hypothesis import strategies as st

from support.examples import examples
from zteam.kernels.transforms import Floats, compose, invert
from zteam.messages import (
    Header,
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    decode,
    encode,
    ns_from_time,
    time_from_ns,
)  # fmt: skip
from zteam.tf import Buffer, TransformException
from zteam.transforms.rigid import IDENTITY

S = 1_000_000_000
FRAMES = 6
TOLERANCE = 1e-9

_metres = st.floats(-50.0, 50.0)
_stamps = st.one_of(st.integers(S, 9 * S), st.integers(1, 9).map(lambda s: s * S))


@st.composite
def _floats(draw: st.DrawFn) -> Floats:
    """Any rigid transform, also with rotations by 0 and by pi."""
    axis = draw(st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda a: math.hypot(*a) > 1e-3))
    half = draw(st.one_of(st.sampled_from([0.0, math.pi / 2, math.pi]), st.floats(-math.pi, math.pi)))
    scale = math.sin(half) / math.hypot(*axis)
    i, j, k = (scale * a for a in axis)
    return (draw(_metres), draw(_metres), draw(_metres), i, j, k, math.cos(half))


class Said(NamedTuple):
    """One sample for a buffer; the parent has a lower number than the child, so there is no loop."""

    child: int
    parent: int
    stamp: int
    floats: Floats

    def transform(self) -> TransformStamped:
        x, y, z, i, j, k, w = self.floats
        return TransformStamped(
            Header(time_from_ns(self.stamp), f"f{self.parent}"),
            f"f{self.child}",
            Transform(Vector3(x, y, z), Quaternion(i, j, k, w)),
        )

    def put(self, buffer: Buffer, static: frozenset[int]) -> None:
        put = buffer.set_transform_static if self.child in static else buffer.set_transform
        assert put(self.transform(), "test") is None


@st.composite
def _sample(draw: st.DrawFn) -> Said:
    child = draw(st.integers(1, FRAMES - 1))
    return Said(child, draw(st.integers(0, child - 1)), draw(_stamps), draw(_floats()))


_histories = st.lists(_sample(), min_size=1, max_size=25, unique_by=lambda s: (s.child, s.stamp))
"""Samples with different (frame, stamp) within one cache; frames may change parents."""
_static = st.frozensets(st.integers(1, FRAMES - 1), max_size=2)
_frame = st.integers(0, FRAMES - 1).map(lambda i: f"f{i}")


def _buffer(history: list[Said], static: frozenset[int] = frozenset()) -> Buffer:
    buffer = Buffer(cache_time=10.0)
    for said in history:
        said.put(buffer, static)
    return buffer


def _numbers(transform: TransformStamped) -> Floats:
    t, r = transform.transform.translation, transform.transform.rotation
    return (t.x, t.y, t.z, r.x, r.y, r.z, r.w)


def _ask(buffer: Buffer, target: str, source: str, time: int) -> tuple[int, Floats] | str:
    """The stamp and numbers of an answer, or the class of its exception."""
    try:
        found = buffer.lookup_transform(target, source, time)
    except TransformException as error:
        return type(error).__name__
    return ns_from_time(found.header.stamp), _numbers(found)


def _same_place(a: Floats, b: Floats) -> bool:
    """Equal up to the sign of the quaternion."""
    sign = math.copysign(1.0, sum(p * q for p, q in zip(a[3:], b[3:], strict=True)))
    turned = (*b[:3], *(sign * q for q in b[3:]))
    return all(abs(p - q) <= TOLERANCE * (1.0 + abs(p)) for p, q in zip(a, turned, strict=True))


def _times(history: list[Said]) -> list[int]:
    """The time of every sample, and one between each two neighbours."""
    stamps = sorted({said.stamp for said in history})
    return [*stamps, *((a + b) // 2 for a, b in itertools.pairwise(stamps))]


@given(_floats(), _floats(), _floats())
def test_transforms_form_a_group(a: Floats, b: Floats, c: Floats) -> None:
    """A transform times its inverse is the identity, and the product is associative."""
    assert _same_place(compose(a, invert(a)), IDENTITY)
    assert _same_place(compose(invert(a), a), IDENTITY)
    assert _same_place(compose(a, IDENTITY), a)
    assert _same_place(compose(compose(a, b), c), compose(a, compose(b, c)))


@given(_floats(), _floats(), st.integers(0, S))
def test_between_two_samples(a: Floats, b: Floats, after: int) -> None:
    """Translation is linear, rotation takes its share of the shorter turn, the quaternion stays a unit one."""
    buffer = _buffer([Said(1, 0, S, a), Said(1, 0, 2 * S, b)])
    middle, fraction = _numbers(buffer.lookup_transform("f0", "f1", S + after)), after / S
    for p, q, m in zip(a[:3], b[:3], middle[:3], strict=True):
        assert abs(p + fraction * (q - p) - m) < TOLERANCE
    assert abs(math.hypot(*middle[3:]) - 1.0) < TOLERANCE
    whole, part = _turn(a, b), _turn(a, middle)
    assert abs(part - fraction * whole) < 1e-6
    assert abs(_turn(middle, b) - (1.0 - fraction) * whole) < 1e-6


def _turn(a: Floats, b: Floats) -> float:
    """The angle (rad, 0 to pi) between the rotations a and b."""
    between = compose(invert((0.0, 0.0, 0.0, *a[3:])), (0.0, 0.0, 0.0, *b[3:]))
    return 2.0 * math.atan2(math.hypot(*between[3:6]), abs(between[6]))


@given(_histories, _static, _frame, _frame)
def test_there_and_back_is_nowhere(history: list[Said], static: frozenset[int], a: str, b: str) -> None:
    """Either both directions answer, with equal stamps and inverse transforms, or neither does."""
    buffer = _buffer(history, static)
    for time in _times(history):
        there, back = _ask(buffer, a, b, time), _ask(buffer, b, a, time)
        if isinstance(there, str) or isinstance(back, str):
            assert isinstance(there, str)
            assert isinstance(back, str)
        else:
            assert there[0] == back[0]
            assert _same_place(compose(there[1], back[1]), IDENTITY)


@given(_histories, _static, _frame, _frame, _frame)
def test_the_way_over_a_third_frame(history: list[Said], static: frozenset[int], a: str, b: str, c: str) -> None:
    """If two consecutive look-ups answer at a time, the whole look-up answers with their product."""
    buffer = _buffer(history, static)
    for time in _times(history):
        first, second, whole = _ask(buffer, a, b, time), _ask(buffer, b, c, time), _ask(buffer, a, c, time)
        if not isinstance(first, str) and not isinstance(second, str):
            assert not isinstance(whole, str)
            assert _same_place(compose(first[1], second[1]), whole[1])


@given(st.data(), _histories, _static)
@examples(50)
def test_the_order_of_arrival_does_not_matter(data: st.DataObject, history: list[Said], static: frozenset[int]) -> None:
    """The order of moving samples, and look-ups between them, do not change any answer."""
    history = [said for said in history if said.child not in static]
    shuffled = data.draw(st.permutations(history))
    straight, other = _buffer(history), Buffer(cache_time=10.0)
    frames = [f"f{i}" for i in range(FRAMES)]
    for said in shuffled:
        said.put(other, frozenset())
        # Look-ups between the samples prepare paths that later samples make invalid.
        _ask(other, frames[0], f"f{said.child}", 0)
        _ask(other, f"f{said.parent}", frames[-1], said.stamp)
    for time in (0, *_times(history)):
        for a in frames:
            for b in frames[:2]:
                assert _ask(straight, a, b, time) == _ask(other, a, b, time)


@given(_histories, _static, _frame, _frame)
def test_latest_is_consistent_across_changes_of_parent(
    history: list[Said], static: frozenset[int], a: str, b: str
) -> None:
    """The look-up at 0 equals that at its stamp, also if frames change their parents."""
    buffer = _buffer(history, static)
    latest = _ask(buffer, a, b, 0)
    if not isinstance(latest, str) and latest[0]:
        assert _ask(buffer, a, b, latest[0]) == latest
        if a != b:
            assert buffer.latest_common_time(a, b) == latest[0]


_said = st.one_of(
    _sample(),
    _sample().map(lambda said: said._replace(stamp=said.stamp + 100 * S)),
    _sample().map(lambda said: said._replace(floats=(*said.floats[:3], 0.5, 0.5, 0.5, 0.6))),
    _sample().map(lambda said: said._replace(parent=said.child)),
)


@given(st.lists(st.lists(_said, max_size=6), max_size=6), _static, st.sampled_from(["f", "/f", "é"]), _frame)
def test_a_message_of_bytes_is_stored_as_one_of_objects(
    bundles: list[list[Said]], static: frozenset[int], prefix: str, target: str
) -> None:
    """Whatever a bundle holds, its bytes leave the same samples, refusals and answers as its transforms one by one."""
    one, other = Buffer(), Buffer()
    for number in sorted(static):
        for buffer in (one, other):
            Said(number, 0, 0, IDENTITY).put(buffer, static)
    for said in bundles:
        bundle = TFMessage([each.transform() for each in said])
        for each in bundle.transforms:
            each.child_frame_id = each.child_frame_id.replace("f", prefix)
        # Sent twice: what is known already is no second sample.
        received = decode(TFMessage, encode(bundle))
        assert received == bundle
        assert bundle == received
        for _ in range(2):
            refused = one.set_transforms(bundle.transforms, "test", 9 * S)
            assert other.set_transforms(received.transforms, "test", 9 * S) == refused
    assert one.frames() == other.frames()
    assert one.duplicates == other.duplicates
    sources = tuple(f"f{i}" for i in range(FRAMES))
    for _ in range(2):
        poses, stamps = other.find_poses2(target, sources)
        for row, source in enumerate(sources):
            try:
                (x, y, yaw), stamp = one.lookup_pose2(target, source)
            except TransformException:
                assert math.isnan(poses[4 * row])
            else:
                assert [*poses[4 * row : 4 * row + 4], stamps[row]] == [x, y, yaw, stamp, stamp]
