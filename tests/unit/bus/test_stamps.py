"""Time stamps of samples."""

import pytest

from support.log_capture import captured_log
from zteam.bus.stamps import ClockWatch, read_stamp, stamping_as
from zteam.clock import APART


@pytest.mark.parametrize("session", ["955b777d3b85846280c89ce442bac183", "a5b777d3b85846280c89ce442bac183", "7"])
def test_a_stamp_names_its_session(session: str) -> None:
    """Also where Zenoh has left out zeros at the front of the id."""
    _, source, delay = read_stamp(str(stamping_as(session)()))
    assert source == session
    assert 0.0 <= delay < 60.0


def test_each_stamp_is_later_than_the_one_before() -> None:
    """So the newest message of a latched key is known."""
    stamp = stamping_as("7")
    times = [read_stamp(str(stamp()))[0] for _ in range(1000)]
    assert times == sorted(set(times))


def test_a_sample_without_a_stamp_has_no_session() -> None:
    """Plain Zenoh clients make none."""
    assert read_stamp("") == (0, "", 0.0)


def test_a_clock_that_is_ahead_is_told_once() -> None:
    """Neither a slow link nor a small difference is taken for one, and further sessions of the host add no line."""
    watch = ClockWatch()
    with captured_log() as heard:
        for session, delay in (("slow", 2.0), ("near", -0.5 * APART), ("a", -1.0), ("a", -1.0), ("b", -1.0)):
            watch.look(session, delay)
    text = "the clock of session a is 1.00 s ahead of this process's: 'zteam doctor' compares the hosts"
    assert heard.lines == [text]
