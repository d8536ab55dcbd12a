"""The codec's edges: header, padding, what may not be a message."""

import math

import numpy as np
import pytest

from zteam.errors import DecodeError, EncodeError
from zteam.messages import (
    Bool,
    Header,
    LaserScan,
    Odometry,
    PoseStamped,
    Range,
    RobotStatus,
    String,
    TFMessage,
    Tick,
    Time,
    TransformStamped,
    Twist,
    Vector3,
    decode,
    encode,
)


def test_a_twist_has_the_bytes_ros2_gives_it() -> None:
    """A Twist is the header and six little-endian doubles: 52 bytes."""
    payload = encode(Twist(Vector3(1.0, 2.0, 3.0), Vector3(4.0, 5.0, 6.0)))
    assert payload[:4] == b"\0\1\0\0"
    assert np.frombuffer(payload, "<f8", offset=4).tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]


def test_up_to_three_bytes_of_padding_are_taken() -> None:
    """Writers may pad a payload to a multiple of four, with any option bytes in the header; more is garbage."""
    payload = b"\0\1\xab\xcd" + encode(Bool(True))[4:]
    for padding in range(4):
        assert decode(Bool, payload + bytes(padding)) == Bool(True)
    with pytest.raises(DecodeError, match="4 bytes of garbage"):
        decode(Bool, payload + bytes(4))


@pytest.mark.parametrize("header", [b"\0\2\0\0", b"\1\1\0\0", b"{}  ", b"\0\7\0\0"])
def test_other_representations_are_refused(header: bytes) -> None:
    """Only plain CDR of either byte order is read."""
    with pytest.raises(DecodeError, match="not CDR"):
        decode(Bool, header + b"\1")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_numbers_that_move_robots_must_be_finite(value: float) -> None:
    """NaN or inf in a command, a pose or a transform makes it undecodable."""
    bad = PoseStamped()
    bad.pose.orientation.w = value
    transform = TransformStamped()
    transform.transform.translation.y = value
    for message in (Twist(Vector3(value)), bad, TFMessage([transform])):
        with pytest.raises(DecodeError, match="not finite"):
            decode(type(message), encode(message))


def test_ranges_may_be_infinite() -> None:
    """No-hit beams may be inf or NaN, and so may a fixed-distance ranger's reading."""
    scan = LaserScan(ranges=np.array([math.inf, math.nan, 1.0], np.float32))
    assert decode(LaserScan, encode(scan)) == scan
    assert decode(Range, encode(Range(range=math.inf))).range == math.inf


def test_a_text_needs_its_nul() -> None:
    """And UTF-8, and no more bytes than there are. Some writers send the empty text as length 0."""
    assert decode(String, b"\0\1\0\0" + bytes(4)) == String("")
    for body in (b"\2\0\0\0ab", b"\2\0\0\0\xff\0", b"\xff\xff\xff\xffab", b"\3\0\0\0a\0"):
        with pytest.raises(DecodeError):
            decode(String, b"\0\1\0\0" + body)


def test_a_bool_is_zero_or_one() -> None:
    """numpy's truth values are encoded like Python's own; anything else is none, neither in bytes nor in a message."""
    for true in (True, np.True_, 1):
        assert encode(Bool(true)) == encode(Bool(True))
    with pytest.raises(DecodeError, match="neither true nor false"):
        decode(Bool, b"\0\1\0\0\2")
    for wrong in (2, "yes", None):
        with pytest.raises(EncodeError, match=r"cannot encode Bool: .* is neither true nor false"):
            encode(Bool(wrong))  # type: ignore[arg-type]


def test_values_that_do_not_fit_are_named() -> None:
    """Encoding says which message cannot be sent."""
    with pytest.raises(EncodeError, match="RobotStatus"):
        encode(RobotStatus(robot_id=2**40))
    with pytest.raises(EncodeError, match="Header"):
        encode(Header(Time(), 5))  # type: ignore[arg-type]
    odometry = Odometry()
    odometry.pose.covariance = np.zeros(3)
    with pytest.raises(EncodeError, match="36 numbers"):
        encode(odometry)


def test_lists_are_taken_for_sequences() -> None:
    """A plain list of numbers is encoded like the array it stands for."""
    as_list = LaserScan(ranges=[1.0, 2.0])  # type: ignore[arg-type]
    assert decode(LaserScan, encode(as_list)).ranges.tolist() == [1.0, 2.0]


def test_two_messages_with_the_same_texts_share_no_list() -> None:
    """The texts at the end of a message are read anew only if they have changed; a receiver may change its list."""
    first, second, third = (decode(Tick, encode(Tick(tick=i, participants=["tf", "sim"[:i]]))) for i in (3, 3, 2))
    first.participants.append("me")
    assert (second.participants, third.participants) == (["tf", "sim"], ["tf", "si"])
