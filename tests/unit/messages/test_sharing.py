"""Messages within one process: what receivers share is what they would have decoded."""

import numpy as np
import pytest

from zteam.errors import DecodeError, EncodeError
from zteam.messages import (
    Bool,
    Fiducial,
    Fiducials,
    Float64,
    Header,
    Int32,
    LaserScan,
    Message,
    PoseStamped,
    String,
    Tick,
    sharing,
)
from zteam.messages.sharing import adopt, share


def test_what_the_sender_changes_afterwards_is_not_seen() -> None:
    """Neither a field, nor a list, nor a number in an array."""
    tick, scan = Tick(participants=["tf"]), LaserScan(ranges=np.ones(3, np.float32))
    shared_tick, shared_scan = share(tick), share(scan)
    tick.participants.append("robot_0")
    tick.stamp.sec, scan.header.frame_id = 7, "elsewhere"
    scan.ranges[0] = 9.0
    assert shared_tick == Tick(participants=["tf"])
    assert shared_scan == LaserScan(ranges=np.ones(3, np.float32))


def test_a_read_only_array_is_not_copied() -> None:
    """The simulator's scans reach every receiver as the one array that was measured."""
    ranges = np.ones(3, np.float32)
    ranges.flags.writeable = False
    assert share(LaserScan(ranges=ranges)).ranges is ranges


def test_receivers_cannot_write_into_an_array() -> None:
    """They share it."""
    assert not share(LaserScan(ranges=[1.0, 2.0])).ranges.flags.writeable  # type: ignore[arg-type]


def test_a_number_that_is_not_finite_is_refused() -> None:
    """As `decode` refuses it."""
    message = PoseStamped(Header())
    message.pose.position.x = float("nan")
    with pytest.raises(DecodeError, match="not finite"):
        share(message)


@pytest.mark.parametrize(
    "message",
    [
        Int32(2**31),
        Bool(2),
        String(None),  # type: ignore[arg-type]
        String("\ud800"),
        LaserScan(ranges=np.ones((2, 2), np.float32)),
        Tick(participants=[1]),  # type: ignore[list-item]
    ],
)
def test_what_has_no_bytes_is_not_shared(message: object) -> None:
    """The sender gets the error that `encode` gives it."""
    with pytest.raises(EncodeError, match=f"cannot encode {type(message).__name__}"):
        share(message)  # type: ignore[type-var]


def test_a_large_message_is_left_to_its_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its receivers are to see how large it is: texts, lists and sequences count."""
    monkeypatch.setattr(sharing, "LARGEST", 100)
    for message in (String("a" * 101), Tick(participants=["a" * 50, "b" * 50]), LaserScan(ranges=np.ones(26))):  # type: ignore[arg-type]
        with pytest.raises(DecodeError, match="too many to be shared"):
            share(message)
    assert share(String("a" * 50)) == String("a" * 50)


def test_an_adopted_message_is_the_senders_own() -> None:
    """Neither it nor its arrays are copied; they become read-only."""
    scan, tick = LaserScan(ranges=np.ones(3, np.float32)), Tick(participants=["tf"])
    ranges = scan.ranges
    assert adopt(scan) is scan
    assert scan.ranges is ranges
    assert not ranges.flags.writeable
    assert adopt(tick) is tick


def test_an_adopted_message_has_the_precision_of_the_wire() -> None:
    """Fields that are float32 on the wire are narrowed, in lists of messages too, and so are arrays."""
    scan = adopt(LaserScan(angle_min=0.1, ranges=np.array([0.1]), range_max=float("inf")))  # type: ignore[arg-type]
    assert (scan.angle_min, scan.range_max) == (np.float32(0.1), float("inf"))
    assert scan == share(LaserScan(angle_min=0.1, ranges=[0.1], range_max=float("inf")))  # type: ignore[arg-type]
    seen = adopt(Fiducials(fiducials=[Fiducial(range=0.1), Fiducial(bearing=0.2)]))
    assert (seen.fiducials[0].range, seen.fiducials[1].bearing) == (np.float32(0.1), np.float32(0.2))


@pytest.mark.parametrize("message", [Float64(np.float64(1.0)), Float64(1), Bool(1), Bool(np.True_)])
def test_the_tests_check_what_is_adopted(message: Message) -> None:
    """A message that receivers would get with other types over Zenoh is an error of its sender."""
    with pytest.raises(EncodeError, match="was handed over where"):
        adopt(message)
