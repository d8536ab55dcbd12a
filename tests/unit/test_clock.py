"""Clocks: simulated time, and which time it is."""

import threading

import pytest

from zteam import clock
from zteam.clock import (
    AutoClock,
    Every,
    Rate,
    SimClock,
    Ticker,
    WallClock,
    monotonic,
    to_ns,
    to_seconds,
    wait_until,
)

LIMIT = 20.0
"""Host seconds after which a wait has failed."""


def moments(rate: Rate, times: list[int]) -> list[int]:
    """Those of `times` at which a moment had come."""
    come = []
    for now in times:
        if not rate.left(now):
            come.append(now)
            rate.take(now)
    return come


class Ticking:
    """Somebody who waits at a rate of simulated time, in a thread of its own until the `with` ends."""

    def __init__(self, period: float) -> None:
        self._clock = AutoClock()
        self._clock.use_simulated()
        self._ticker = Ticker(period, self._clock)
        self.changed = threading.Condition()
        self.come: list[int] = []
        """Simulated ns of the moments."""
        self._waits = 0
        """How often it has begun to wait."""
        self._still: list[int] = []
        """Simulated ns at which it was told that time stands still."""
        self._over = False
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> "Ticking":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over = True
        self.go_to(10**18)
        self._thread.join(LIMIT)
        assert not self._thread.is_alive()

    def _run(self) -> None:
        while not self._over:
            with self.changed:
                self._waits += 1
                self.changed.notify_all()
            self._ticker.wait(self._on_still)
            with self.changed:
                self.come.append(self._clock.now())

    def _on_still(self) -> None:
        with self.changed:
            self._still.append(self._clock.now())
            self.changed.notify_all()

    def go_to(self, stamp: int) -> None:
        """A tick at `stamp` (ns)."""
        self._clock.sim.set(stamp)

    def wait_for(self, count: int) -> list[int]:
        """The moments, once there are so many and the next one is waited for."""
        with self.changed:
            assert wait_until(self.changed, lambda: len(self.come) == count and self._waits == count + 1, LIMIT)
            return list(self.come)

    def stand(self) -> None:
        """Wait until it has found twice that time stands still where it is now, so that it has seen that time."""
        now = self._clock.now()
        with self.changed:
            assert wait_until(self.changed, lambda: self._still[-2:] == [now, now], LIMIT)


def test_seconds_and_nanoseconds() -> None:
    """Conversion rounds to the nearest nanosecond, both ways."""
    assert to_ns(0.1) == 100_000_000
    assert to_ns(1e-9 * 0.6) == 1
    assert to_seconds(1_500_000_000) == 1.5


def test_simulated_time_is_what_was_heard() -> None:
    """0 before the first stamp, then the newest one, whatever the host's clock does."""
    sim = SimClock()
    assert sim.now() == 0
    sim.set(100)
    assert sim.now() == 100
    assert sim.now() == 100


def test_a_jump_back_is_told_with_both_times() -> None:
    """A restarted simulator's time is taken, and everybody who asked hears of it; going on is no jump."""
    sim, heard = SimClock(), []
    sim.on_jump_back(lambda old, new: heard.append((old, new, sim.now())))
    for stamp in (100, 200, 200, 50, 60):
        sim.set(stamp)
    assert heard == [(200, 50, 50)]


def test_auto_is_undecided_until_there_is_evidence() -> None:
    """Before any evidence time is unknown, and is said to be."""
    auto = AutoClock()
    assert (auto.decided, auto.simulated, auto.now()) == (False, False, 0)


def test_auto_stays_in_simulated_time() -> None:
    """Once a simulator was seen it never becomes wall time: a simulator that is gone stops time."""
    auto = AutoClock()
    auto.use_simulated()
    auto.sim.set(300)
    auto.use_wall()
    assert (auto.decided, auto.simulated, auto.now()) == (True, True, 300)


def test_auto_stays_in_wall_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once a base's data was seen without a simulator it is the host's time, even if one starts later."""
    monkeypatch.setattr(clock.time, "time_ns", lambda: 42)
    auto = AutoClock()
    auto.use_wall()
    auto.use_simulated()
    auto.sim.set(300)
    assert (auto.decided, auto.simulated, auto.now()) == (True, False, 42)
    assert WallClock().now() == clock.wall_ns() == 42


def test_every_is_due_once_a_period(monkeypatch: pytest.MonkeyPatch) -> None:
    """At once, then not until a whole period of the host's clock has gone by; missed periods are not made up for."""
    now = [100.0]
    monkeypatch.setattr(clock.time, "monotonic", lambda: now[0])
    every, due = Every(1.0), []
    for now[0] in (100.0, 100.5, 101.0, 101.5, 105.0, 105.5, 106.0):
        due.append(every.due())
    assert due == [True, False, True, False, True, False, True]


def test_waiting_ends_with_its_condition() -> None:
    """A wait returns True when another thread makes it so, and False when nobody does."""
    changed, done = threading.Condition(), []

    def set_it() -> None:
        with changed:
            done.append(1)
            changed.notify_all()

    thread = threading.Thread(target=set_it)
    with changed:
        thread.start()
        assert wait_until(changed, lambda: bool(done), 30.0)
        assert not wait_until(changed, lambda: len(done) > 1, 0.01)
    thread.join()


def test_another_thread_hears_of_the_next_stamp() -> None:
    """Whoever waits for a change of simulated time is woken by it, and not by the same stamp again."""
    sim = SimClock()
    sim.set(100)
    assert not sim.wait_for_change(100, 0.01)
    assert sim.wait_for_change(50, 0.0)
    thread = threading.Timer(0.01, lambda: sim.set(200))
    thread.start()
    begin = monotonic()
    assert sim.wait_for_change(100, LIMIT)
    assert monotonic() - begin < LIMIT / 2
    thread.join()


def test_a_rate_that_fits_the_ticks() -> None:
    """One moment for every tick, from the first one after the start on."""
    ticks = [n * 100 for n in range(11, 16)]
    assert moments(Rate(100, 1000), [1000, *ticks]) == ticks


def test_a_rate_keeps_its_average() -> None:
    """Moments between two ticks come with the next tick, and the schedule does not slip with them."""
    come = moments(Rate(300, 0), [n * 100 for n in range(1, 100)])
    assert come == [n * 300 for n in range(1, 34)]
    come = moments(Rate(333, 0), [n * 100 for n in range(1, 101)])
    assert come[:4] == [400, 700, 1000, 1400]
    assert len(come) == 30


def test_missed_moments_are_not_made_up_for() -> None:
    """A rate above the ticks' is the ticks'; after a long gap one moment comes, and the next a whole period later."""
    ticks = [n * 100 for n in range(1, 10)]
    assert moments(Rate(10, 0), ticks) == ticks
    assert moments(Rate(50, 0), ticks) == ticks
    assert moments(Rate(100, 0), [100, 1030, 1031, 1100, 1129, 1130, 1230]) == [100, 1030, 1130, 1230]


def test_after_a_jump_back_a_rate_counts_from_the_new_time() -> None:
    """It does not wait until the old time is reached again."""
    rate = Rate(100, 5000)
    assert rate.left(5050) == 50
    assert rate.left(20) == 100
    assert moments(rate, [80, 119, 120, 180, 220]) == [120, 220]


def test_time_left_is_never_negative() -> None:
    """A moment that is late is there: nobody sleeps for less than nothing."""
    rate = Rate(100, 0)
    assert [rate.left(now) for now in (0, 40, 100, 250)] == [100, 60, 0, 0]


def test_a_period_is_never_nothing() -> None:
    """A rate beyond the clock's resolution comes with every change of the time, and does not hang."""
    assert moments(Rate(0, 0), [0, 1, 2]) == [1, 2]


def test_a_ticker_goes_by_simulated_time() -> None:
    """Its moments come with the stamps they belong to, however fast or slow those come."""
    with Ticking(1e-6) as ticking:
        for n, stamp in enumerate((1000, 2000, 3500, 4000), 1):
            ticking.go_to(stamp - 1)
            ticking.go_to(stamp)
            assert ticking.wait_for(n)[-1] == stamp


def test_a_ticker_stands_still_with_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """While no stamp comes no moment does; whoever waits hears of it, again and again."""
    monkeypatch.setattr(clock, "STILL", 0.01)
    with Ticking(1e-6) as ticking:
        ticking.go_to(999)
        ticking.stand()
        assert ticking.come == []
        ticking.go_to(1000)
        assert ticking.wait_for(1) == [1000]


def test_a_ticker_goes_on_after_a_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    """When time jumps back, the next moment is a period after the new time."""
    monkeypatch.setattr(clock, "STILL", 0.01)
    with Ticking(1e-6) as ticking:
        ticking.go_to(50_000)
        ticking.wait_for(1)
        ticking.go_to(100)
        ticking.stand()
        ticking.go_to(1099)
        ticking.stand()
        ticking.go_to(1100)
        assert ticking.wait_for(2) == [50_000, 1100]


def test_a_ticker_of_the_host_sleeps_until_each_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    """In wall time it goes by the host's monotonic clock, which nobody sets, and makes up for nothing."""
    now, slept = [5_000_000_000], []

    def sleep(seconds: float) -> None:
        slept.append(round(seconds, 9))
        now[0] += to_ns(seconds)

    monkeypatch.setattr(clock.time, "monotonic_ns", lambda: now[0])
    monkeypatch.setattr(clock.time, "sleep", sleep)
    wall = AutoClock()
    wall.use_wall()
    ticker = Ticker(0.1, wall)
    ticker.wait()
    now[0] += to_ns(0.03)
    ticker.wait()
    now[0] += to_ns(0.35)
    ticker.wait()
    ticker.wait()
    assert slept == [0.1, 0.07, 0.1]
