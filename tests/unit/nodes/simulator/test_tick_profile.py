"""What a tick's time is spent on."""

import pytest

from zteam.nodes.simulator import statistics
from zteam.nodes.simulator.statistics import IDLE, PHYSICS, SENSORS, TickProfile
from zteam.services.simulator import Timing


@pytest.fixture
def host(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The host's time, which the test sets."""
    time = [100.0]
    monkeypatch.setattr(statistics, "monotonic", lambda: time[0])
    return time


def spend(host: list[float], profile: TickProfile, phase: str, seconds: float) -> None:
    """Let a phase take this long."""
    host[0] += seconds
    profile.end(phase)


def test_the_timing_is_the_mean_of_whole_ticks(host: list[float]) -> None:
    """In milliseconds; the open tick does not count."""
    profile = TickProfile()
    for seconds in (0.001, 0.003):
        spend(host, profile, PHYSICS, seconds)
        spend(host, profile, SENSORS, 0.010)
        profile.end_tick()
    spend(host, profile, PHYSICS, 9.0)
    timing = profile.timing()
    assert (timing.physics, timing.sensors) == (pytest.approx(2.0), pytest.approx(10.0))
    assert (timing.wait, timing.publish, timing.idle) == (0.0, 0.0, 0.0)


def test_before_the_first_tick_all_is_zero(host: list[float]) -> None:
    """Instead of a division by zero."""
    assert TickProfile().timing() == Timing(0.0, 0.0, 0.0, 0.0, 0.0)


def test_a_start_forgets_what_was_before(host: list[float]) -> None:
    """The open tick's phases included."""
    profile = TickProfile()
    spend(host, profile, PHYSICS, 5.0)
    host[0] += 5.0
    profile.start()
    spend(host, profile, PHYSICS, 0.001)
    profile.end_tick()
    assert profile.timing().physics == pytest.approx(1.0)


def test_the_last_tick_in_words_names_what_took_time(host: list[float]) -> None:
    """In the order of a tick, without idle time and phases that took none."""
    profile = TickProfile()
    for phase, seconds in ((SENSORS, 0.1126), (PHYSICS, 0.002), (IDLE, 1.0)):
        spend(host, profile, phase, seconds)
    profile.end_tick()
    assert profile.last_text() == "physics 2.0 ms, sensors 112.6 ms"
