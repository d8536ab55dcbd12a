"""How late messages are, told by stamps of clocks that differ."""

import pytest

from zteam.bus.lateness import LATE, Lateness
from zteam.bus.transport import RawSample

KEY = "robot_1/cmd_vel"


def is_late(lateness: Lateness, delay: float, now: float, key: str = KEY) -> bool:
    """Whether a message on a key is refused."""
    return lateness.measure(key, delay, now) > LATE


@pytest.mark.parametrize("apart", [0.0, 1.0, 3600.0])
def test_the_quickest_message_tells_how_far_clocks_are_apart(apart: float) -> None:
    """What a message takes longer than that one is its lateness, also where its sender's clock is behind."""
    lateness = Lateness()
    delays = [0.002, 0.001, 0.101, 1.601]
    found = [lateness.measure(KEY, delay + apart, 0.1 * i) for i, delay in enumerate(delays)]
    assert found == pytest.approx([0.0, 0.0, 0.1, 1.6], abs=3e-3)


@pytest.mark.parametrize(("apart", "late"), [(0.2, 0.71), (1.0, 1.51), (3600.0, 3600.51)])
def test_a_clock_that_is_ahead_hides_as_much_of_a_delay(apart: float, late: float) -> None:
    """Its stamps are taken for those of now, so nothing of it is remembered."""
    lateness = Lateness()
    assert not any(is_late(lateness, 0.001 - apart, 0.1 * i) for i in range(100))
    assert not is_late(lateness, late - 0.02 - apart, 10.0)
    assert is_late(lateness, late - apart, 10.1)


@pytest.mark.parametrize("forged", [-3600.0, -1e9, 0.0, 5.0, 1800.0, 1e9])
@pytest.mark.parametrize("true", [0.0, 0.4, 0.9, 3600.0])
def test_one_message_makes_no_later_one_late_for_longer_than_seconds(true: float, forged: float) -> None:
    """Whatever stamp a forged message has on the key itself, and whatever the clock of its writer: 5 s of messages
    later all are in time, and of a clock that is set none was late."""
    lateness = Lateness()
    for i in range(30):
        lateness.measure(KEY, true, 0.1 * i)
    lateness.measure(KEY, forged, 3.0)
    found = [is_late(lateness, true, 3.0 + 0.1 * i) for i in range(1, 60)]
    assert not any(found[50:])
    assert true > LATE or not any(found)


def test_a_writer_whose_clock_was_set_back_is_heard_again() -> None:
    """Its host was started anew, and its clock is an hour behind: it stands for seconds, not for good."""
    lateness = Lateness()
    for i in range(100):
        lateness.measure(KEY, -3600.0 if i < 50 else 0.0, 0.1 * i)
    found = [is_late(lateness, 3600.0, 10.0 + 0.1 * i) for i in range(60)]
    assert found[0]
    assert not any(found[50:])


def test_a_link_that_becomes_ever_slower_stays_late() -> None:
    """Messages pile up before it until each takes 20 s. No clock explains that, for as long as it lasts."""
    lateness = Lateness()
    delays = [min(0.5 * 0.1 * i, 20.0) for i in range(3000)]
    found = [is_late(lateness, delay, 0.2 * i) for i, delay in enumerate(delays)]
    assert all(found[40:])
    assert not any(is_late(lateness, 0.01, 600.0 + 0.1 * i) for i in range(10))


def test_a_burst_after_a_cut_is_late_but_for_its_newest_messages() -> None:
    """The messages of 20 s come at once: those of the last 0.5 s are in time."""
    lateness = Lateness()
    lateness.measure(KEY, 0.001, 0.0)
    found = [is_late(lateness, 20.0 - 0.1 * i, 20.0) for i in range(201)]
    assert found == [True] * 195 + [False] * 6


def test_clocks_may_drift() -> None:
    """A clock that loses 0.5 ms a second, until it is a second behind, makes no message late."""
    lateness = Lateness()
    assert max(lateness.measure(KEY, 5e-4 * i, float(i)) for i in range(2001)) < LATE


def test_keys_are_measured_each_by_itself() -> None:
    """What comes on one key, whoever sent it, makes no message of another key late."""
    lateness = Lateness()
    assert lateness.measure(KEY, 1.0, 0.0) == lateness.measure("robot_2/cmd_vel", 0.0, 0.0) == 0.0
    assert lateness.measure(KEY, 1.5, 0.1) == pytest.approx(0.5, abs=2e-3)


def test_a_late_command_is_named() -> None:
    """One without a stamp has no delay: it is in time. The session in a stamp plays no part."""
    lateness = Lateness()
    samples = [RawSample(KEY, b"", "", 1, source, delay) for source, delay in (("a", 0.0), ("b", 1.6), ("", 0.0))]
    late = "it came more than 0.5 s late: its link is slow, or was cut"
    assert [lateness.problem(sample) for sample in samples] == ["", late, ""]
