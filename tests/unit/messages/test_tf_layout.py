"""Parts of a TFMessage read from its bytes; any message against `decode` is in the property tests."""

import pytest

from support.bundles import bundle
from zteam.messages import TFMessage, TransformStamped, decode, encode
from zteam.messages.tf_layout import Layout


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
