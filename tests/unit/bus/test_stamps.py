"""Time stamps of samples."""

from types import SimpleNamespace

import pytest
import zenoh

from zteam.bus.zenoh_session import ZenohSample, stamping_as


def stamped(stamp: zenoh.Timestamp | None) -> ZenohSample:
    return ZenohSample("a", b"", "", sample=SimpleNamespace(timestamp=stamp))


@pytest.mark.parametrize("session", ["955b777d3b85846280c89ce442bac183", "a5b777d3b85846280c89ce442bac183", "7"])
def test_a_stamp_names_its_session(session: str) -> None:
    """Also where Zenoh has left out zeros at the front of the id."""
    sample = stamped(stamping_as(session)())
    assert sample.source == session
    assert 0.0 <= sample.delay < 60.0


def test_each_stamp_is_later_than_the_one_before() -> None:
    """So the newest message of a latched key is known."""
    stamp = stamping_as("7")
    times = [stamped(stamp()).timestamp for _ in range(1000)]
    assert times == sorted(set(times))


def test_a_sample_without_a_stamp_has_no_session() -> None:
    """Plain Zenoh clients make none."""
    sample = stamped(None)
    assert (sample.timestamp, sample.source, sample.delay) == (0, "", 0.0)
