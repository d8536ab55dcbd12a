"""Parts of a TFMessage read from its bytes; any message against `decode` is in the property tests."""

import pytest

from support.bundles import bundle
from zteam.messages import TFMessage, Time, TransformStamped, decode, encode
from zteam.messages.tf_layout import Layout, MessageLayout


def payload_of(tick: int, robots: list[int]) -> bytes:
    """A tick's bundle."""
    return encode(TFMessage(bundle(tick, robots)))


def test_only_stamps_and_numbers_may_differ() -> None:
    """The same frames in the same order fit at any time; the transforms are those that were encoded."""
    layout, later = Layout(payload_of(1, [0, 1, 2])), payload_of(77, [0, 1, 2])
    assert layout.children == ["robot_0/base_footprint", "robot_1/base_footprint", "robot_2/base_footprint"]
    assert layout.fits(later)
    assert [layout.transform(later, index) for index in range(3)] == bundle(77, [0, 1, 2])
    assert layout.stamp(later, -1) == 7_700_000_000


def test_messages_fit_as_their_bytes_do() -> None:
    """Where a bundle is shared in memory, the same frames in the same order fit, and no others."""
    message, later = TFMessage(bundle(1, [0, 1, 2])), TFMessage(bundle(77, [0, 1, 2]))
    layout = MessageLayout(message)
    assert layout.children == ["robot_0/base_footprint", "robot_1/base_footprint", "robot_2/base_footprint"]
    for robots in ([0, 1], [0, 2, 1], [0, 1, 2, 3]):
        assert not layout.fits(TFMessage(bundle(77, robots)))
        assert layout.fits(later)
    assert not layout.fits(encode(later))
    assert (layout.stamp(later, -1), layout.transform(later, 1)) == (7_700_000_000, bundle(77, [0, 1, 2])[1])


def test_stamps_and_numbers_without_the_message() -> None:
    """The span of the stamps and the numbers of each transform are those of the message, from bytes as in memory."""
    message = TFMessage(bundle(7, [0, 1, 2]))
    places = [t.transform.translation for t in message.transforms]
    for stamps in ([5, 5, 5], [5, 9, 2], [-3, -3, 7]):
        for one, sec in zip(message.transforms, stamps, strict=True):
            one.header.stamp = Time(sec, 10)
        span = 1_000_000_000 * min(stamps) + 10, 1_000_000_000 * max(stamps) + 10
        payload, shared = encode(message), decode(TFMessage, encode(message))
        in_bytes, in_memory = Layout(payload), MessageLayout(shared)
        assert in_bytes.span(payload) == in_memory.span(shared) == span
        assert in_bytes.parents == in_memory.parents == ["robot_0/odom", "robot_1/odom", "robot_2/odom"]
        for index in range(3):
            assert in_bytes.numbers(payload, index) == in_memory.numbers(shared, index) == (
                places[index].x, places[index].y, 0.0, 0.0, 0.0, 0.0, 1.0,
            )  # fmt: skip


@pytest.mark.parametrize(
    "robots", [[0, 3, 2], [3, 1, 2], [0, 1, 3], [2, 1, 0], [0, 1], [0, 1, 2, 3]], ids=lambda robots: str(robots)
)
def test_other_frames_do_not_fit(robots: list[int]) -> None:
    """Another robot at any place, another order and another number of robots are another layout."""
    assert not Layout(payload_of(1, [0, 1, 2])).fits(payload_of(1, robots))


@pytest.mark.parametrize("payload", [b"", b"\0\1\0\0", b"\0\0\0\0\0\0\0\0", b"\xff" * 200])
def test_garbage_does_not_fit(payload: bytes) -> None:
    """What is no message with these frames is refused, whatever its length."""
    layout = Layout(payload_of(1, [0]))
    assert not layout.fits(payload)
    assert not layout.fits(payload.ljust(len(payload_of(1, [0])), b"\xff"))


def test_an_empty_text_may_lack_its_nul() -> None:
    """A writer that sends the empty frame as a length of 0 is read as `decode` reads it."""
    with_nul = encode(TFMessage([TransformStamped()]))
    # Header, count and stamp take 16 bytes; then both names, each a length of 1, a NUL and padding to four.
    without = with_nul[:16] + bytes(8) + with_nul[32:]
    layout = Layout(without)
    assert layout.children == [""]
    assert [layout.transform(without, 0)] == decode(TFMessage, without).transforms == [TransformStamped()]
