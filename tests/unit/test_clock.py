"""Simulated time, the choice between it and wall time, and waiting at a rate."""

import threading

import pytest

from support.limits import LIMIT
from support.transports import wait_until_true
from zteam import clock
from zteam.clock import (
    AutoClock,
    Every,
    Rate,
    moments,
    monotonic,
    to_ns,
    to_seconds,
)


def test_seconds_and_nanoseconds() -> None:
    """Seconds become the nearest integer nanosecond, and nanoseconds become seconds."""
    assert to_ns(0.1) == 100_000_000
    assert to_ns(1e-9 * 0.6) == 1
    assert to_seconds(1_500_000_000) == 1.5


def test_a_jump_back_is_reported_with_both_times() -> None:
    """A smaller stamp is accepted and reported to the callbacks, an equal or larger one is not. Time is 0 at first."""
    sim, heard = AutoClock(), []
    assert sim.now() == 0
    sim.on_jump_back(lambda old, new: heard.append((old, new, sim.now())))
    for stamp in (100, 200, 200, 50, 60):
        sim.set(stamp)
    assert heard == [(200, 50, 50)]


def test_an_auto_clock_stays_what_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is 0 before any evidence, and then for ever simulated time or the host's, whichever was seen first."""
    monkeypatch.setattr(clock.time, "time_ns", lambda: 42)
    simulated, host = AutoClock(), AutoClock()
    assert (host.decided, host.simulated, host.now()) == (False, False, 0)
    for auto, decisions in ((simulated, ("use_simulated", "use_wall")), (host, ("use_wall", "use_simulated"))):
        for decide in decisions:
            getattr(auto, decide)()
        auto.set(300)
    assert (simulated.decided, simulated.simulated, simulated.now()) == (True, True, 300)
    assert (host.decided, host.simulated, host.now()) == (True, False, 42)
    assert clock.wall_ns() == 42


def test_every_is_due_once_a_period(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is due at once, then after each whole period; missed periods are skipped.."""
    now = [100.0]
    monkeypatch.setattr(clock.time, "monotonic", lambda: now[0])
    every = Every(1.0)
    seen = []
    for now[0] in (100.0, 100.25, 101.0, 101.5, 105.0, 105.5, 106.0):
        seen.append((every.left(), every.due()))
    assert seen == [(0.0, True), (0.75, False), (0.0, True), (0.5, False), (0.0, True), (0.5, False), (0.0, True)]


def test_a_change_of_simulated_time_is_waited_for() -> None:
    """A thread goes on with the next stamp; without one its wait times out, and from another time it does not wait."""
    sim = AutoClock()
    sim.set(100)
    assert not sim.wait_for_change(100, 0.01)
    assert sim.wait_for_change(50, 0.0)
    thread = threading.Timer(0.01, lambda: sim.set(200))  # noqa: TID251
    thread.start()
    begin = monotonic()
    assert sim.wait_for_change(100, LIMIT)
    assert monotonic() - begin < LIMIT / 2
    thread.join()


HUNDREDS = [n * 100 for n in range(1, 101)]


@pytest.mark.parametrize(
    ("period", "start", "times", "due"),
    [
        (100, 0, HUNDREDS, HUNDREDS),
        (300, 0, HUNDREDS, HUNDREDS[2::3]),
        (333, 0, HUNDREDS[:14], [400, 700, 1000, 1400]),
        (50, 0, HUNDREDS, HUNDREDS),
        (100, 0, [100, 1030, 1031, 1100, 1129, 1130, 1230], [100, 1030, 1130, 1230]),
        (100, 5000, [5050, 20, 80, 119, 120, 180, 220], [120, 220]),
        (0, 0, [0, 1, 2], [1, 2]),
    ],
    ids=["each tick", "every third", "between ticks", "twice a tick", "missed", "jump back", "no period"],
)
def test_a_rate_gives_evenly_spaced_moments(period: int, start: int, times: list[int], due: list[int]) -> None:
    """A moment between two ticks is due at the next one and does not delay later ones; missed ones are skipped; after a
    jump back they count from the new time."""
    rate, come = Rate(period, start), []
    for now in times:
        if not rate.left(now):
            come.append(now)
            rate.take(now)
    assert come == due


def test_time_left_is_never_negative() -> None:
    """A moment that is late has 0 ns left."""
    rate = Rate(100, 0)
    assert [rate.left(now) for now in (0, 40, 100, 250)] == [100, 60, 0, 0]


def test_a_ticker_follows_simulated_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A moment comes with the stamp that reaches it; while time stands still none does, which is reported. After time
    jumps back, the next moment is a period after the new time."""
    monkeypatch.setattr(clock, "STILL", 0.01)
    auto = AutoClock()
    auto.use_simulated()
    come: list[int] = []
    still: list[int] = []
    wait = moments(1e-6, auto, lambda: still.append(auto.now()))

    def run() -> None:
        for _ in range(2):
            wait()
            come.append(auto.now())

    def stand(stamp: int) -> None:
        auto.set(stamp)
        wait_until_true(lambda: still[-2:] == [stamp, stamp])

    thread = threading.Thread(target=run)
    thread.start()
    stand(999)
    assert come == []
    auto.set(50_000)
    wait_until_true(lambda: come == [50_000])
    stand(100)
    stand(1099)
    assert come == [50_000]
    auto.set(1100)
    thread.join(LIMIT)
    assert come == [50_000, 1100]


def test_a_ticker_of_the_host_sleeps_until_each_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    """In wall time a ticker sleeps on the host's monotonic clock, and skips missed moments."""
    now, slept = [5_000_000_000], []

    def sleep(seconds: float) -> None:
        slept.append(round(seconds, 9))
        now[0] += to_ns(seconds)

    monkeypatch.setattr(clock.time, "monotonic_ns", lambda: now[0])
    monkeypatch.setattr(clock.time, "sleep", sleep)
    wall = AutoClock()
    wall.use_wall()
    wait = moments(0.1, wall)
    wait()
    now[0] += to_ns(0.03)
    wait()
    now[0] += to_ns(0.35)
    wait()
    wait()
    assert slept == [0.1, 0.07, 0.1]
