"""Messages that their sender gives away: receivers in its process get what they would have decoded."""

import numpy as np
import pytest

from zteam.errors import EncodeError
from zteam.messages import (
    Bool,
    Fiducial,
    Fiducials,
    Float64,
    LaserScan,
    Message,
    Tick,
    decode,
    encode,
)
from zteam.messages.cdr import adopt


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
    assert scan == decode(LaserScan, encode(scan))
    seen = adopt(Fiducials(fiducials=[Fiducial(range=0.1), Fiducial(bearing=0.2)]))
    assert (seen.fiducials[0].range, seen.fiducials[1].bearing) == (np.float32(0.1), np.float32(0.2))


@pytest.mark.parametrize("message", [Float64(np.float64(1.0)), Float64(1), Bool(1), Bool(np.True_)])
def test_the_tests_check_what_is_adopted(message: Message) -> None:
    """A message that receivers would get with other types over Zenoh is an error of its sender."""
    with pytest.raises(EncodeError, match="was handed over where"):
        adopt(message)
