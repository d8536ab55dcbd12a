"""How late messages are, told by stamps of clocks that differ."""

import pytest

from zteam.bus.lateness import LATE, Lateness
from zteam.bus.transport import RawSample


@pytest.mark.parametrize("apart", [-3600.0, -1.0, 0.0, 1.0, 3600.0])
def test_the_quickest_message_tells_how_far_clocks_are_apart(apart: float) -> None:
    """What a message takes longer than that one is its lateness, whatever the clock of its session shows."""
    lateness = Lateness()
    delays = [0.002, 0.001, 0.101, 1.601]
    found = [lateness.measure("a", delay + apart, 0.1 * i) for i, delay in enumerate(delays)]
    assert found == pytest.approx([0.0, 0.0, 0.1, 1.6], abs=3e-3)


def test_a_link_that_was_slow_from_the_start_is_late() -> None:
    """Clocks that differ by a second are expected; 1.6 s are a link's."""
    lateness = Lateness()
    assert all(lateness.measure("a", 1.6, 0.1 * i) > LATE for i in range(100))


def test_a_burst_after_a_cut_is_late_but_for_its_newest_messages() -> None:
    """The messages of 20 s come at once: those of the last 0.5 s are in time."""
    lateness = Lateness()
    lateness.measure("a", 0.001, 0.0)
    found = [lateness.measure("a", 20.0 - 0.1 * i, 20.0) > LATE for i in range(201)]
    assert found == [True] * 195 + [False] * 6


def test_clocks_may_drift() -> None:
    """A clock that loses 0.5 ms a second, until it is a second behind, makes no message late."""
    lateness = Lateness()
    assert max(lateness.measure("a", 5e-4 * i, float(i)) for i in range(2001)) < LATE


def test_sessions_are_measured_each_by_itself() -> None:
    """One with a clock that is a second behind does not make another one late, and neither do thousands."""
    lateness = Lateness()
    assert lateness.measure("a", 1.0, 0.0) == lateness.measure("b", 0.0, 0.0) == 0.0
    for i in range(10_000):
        lateness.measure(f"invented {i}", 0.0, 0.0)
    assert lateness.measure("a", 1.5, 0.1) == pytest.approx(0.5, abs=2e-3)
    assert len(lateness._quickest) <= 4096


def test_a_late_command_is_named() -> None:
    """One without a stamp has no delay: it is in time."""
    lateness = Lateness()
    on_time, late = (RawSample("robot_1/cmd_vel", b"", "", 1, "a", delay) for delay in (0.0, 1.6))
    assert [lateness.problem(sample) for sample in (on_time, late)] == [
        "",
        "it came more than 0.5 s late: its link is slow, or was cut",
    ]
    assert not lateness.problem(RawSample("robot_1/cmd_vel", b"", ""))
