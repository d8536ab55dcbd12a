"""Simulated time, the choice between it and wall time, and waiting at a rate."""

import threading

import pytest

from support.limits import LIMIT
from zteam import clock
from zteam.clock import (
    AutoClock,
    Every,
    Rate,
    SimClock,
    Ticker,
    monotonic,
    to_ns,
    to_seconds,
    wait_until,
)


def moments(rate: Rate, times: list[int]) -> list[int]:
    """Those of `times` at which a moment was due."""
    come = []
    for now in times:
        if not rate.left(now):
            come.append(now)
            rate.take(now)
    return come


class TickerThread:
    """A thread that waits with a Ticker of simulated time again and again, until the `with` block ends."""

    def __init__(self, period: float) -> None:
        self._clock = AutoClock()
        self._clock.use_simulated()
        self._ticker = Ticker(period, self._clock)
        self.changed = threading.Condition()
        self.come: list[int] = []
        """Simulated ns of the moments so far."""
        self._waits = 0
        """Number of waits begun."""
        self._still: list[int] = []
        """Simulated ns of the calls that reported that time stands still."""
        self._over = False
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> "TickerThread":
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
        """Set simulated time to `stamp` (ns)."""
        self._clock.sim.set(stamp)

    def wait_for(self, count: int) -> list[int]:
        """The moments, once there are `count` and the thread waits for the next one."""
        with self.changed:
            assert wait_until(self.changed, lambda: len(self.come) == count and self._waits == count + 1, LIMIT)
            return list(self.come)

    def wait_until_still(self) -> None:
        """Wait until two calls reported that time stands still at the current time: the thread has seen it then."""
        now = self._clock.now()
        with self.changed:
            assert wait_until(self.changed, lambda: self._still[-2:] == [now, now], LIMIT)


def test_seconds_and_nanoseconds() -> None:
    """Seconds become the nearest integer nanosecond, and nanoseconds become seconds."""
    assert to_ns(0.1) == 100_000_000
    assert to_ns(1e-9 * 0.6) == 1
    assert to_seconds(1_500_000_000) == 1.5


def test_simulated_time_is_the_last_stamp() -> None:
    """Simulated time is 0 before the first stamp, then the last stamp."""
    sim = SimClock()
    assert sim.now() == 0
    sim.set(100)
    assert sim.now() == 100


def test_a_jump_back_is_reported_with_both_times() -> None:
    """A smaller stamp is accepted and reported to the callbacks; an equal or larger one is not reported."""
    sim, heard = SimClock(), []
    sim.on_jump_back(lambda old, new: heard.append((old, new, sim.now())))
    for stamp in (100, 200, 200, 50, 60):
        sim.set(stamp)
    assert heard == [(200, 50, 50)]


def test_auto_is_undecided_until_there_is_evidence() -> None:
    """Before any evidence the clock is undecided and its time is 0."""
    auto = AutoClock()
    assert (auto.decided, auto.simulated, auto.now()) == (False, False, 0)


def test_auto_stays_in_simulated_time() -> None:
    """Once a simulator was seen, the clock never becomes wall time."""
    auto = AutoClock()
    auto.use_simulated()
    auto.sim.set(300)
    auto.use_wall()
    assert (auto.decided, auto.simulated, auto.now()) == (True, True, 300)


def test_auto_stays_in_wall_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once a base's data decided for the host's time, a later simulator changes nothing."""
    monkeypatch.setattr(clock.time, "time_ns", lambda: 42)
    auto = AutoClock()
    auto.use_wall()
    auto.use_simulated()
    auto.sim.set(300)
    assert (auto.decided, auto.simulated, auto.now()) == (True, False, 42)
    assert clock.wall_ns() == 42


def test_every_is_due_once_a_period(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is due at once, then after each whole period; missed periods are skipped."""
    now = [100.0]
    monkeypatch.setattr(clock.time, "monotonic", lambda: now[0])
    every, due = Every(1.0), []
    assert every.left() == 0.0
    for now[0] in (100.0, 100.5, 101.0, 101.5, 105.0, 105.5, 106.0):
        due.append(every.due())
    assert due == [True, False, True, False, True, False, True]


def test_every_tells_how_long_it_is_until_it_is_due(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rest of the period, and 0 from its end on: a wait of that length is not too short."""
    now = [100.0]
    monkeypatch.setattr(clock.time, "monotonic", lambda: now[0])
    every = Every(1.0)
    every.due()
    left = []
    for now[0] in (100.0, 100.25, 101.0, 105.0):
        left.append(every.left())
    assert left == [1.0, 0.75, 0.0, 0.0]


def test_a_wait_ends_when_its_condition_holds() -> None:
    """A wait returns True once another thread makes the condition true."""
    changed, done = threading.Condition(), []

    def set_it() -> None:
        with changed:
            done.append(1)
            changed.notify_all()

    thread = threading.Thread(target=set_it)
    with changed:
        thread.start()
        assert wait_until(changed, lambda: bool(done), LIMIT)
    thread.join()


def test_a_wait_times_out() -> None:
    """A wait returns False if its condition does not become true in time."""
    changed = threading.Condition()
    with changed:
        assert not wait_until(changed, lambda: False, 0.01)


def test_a_wait_for_a_change_times_out() -> None:
    """Waiting for a change from the current time returns False, and from another time True, at once."""
    sim = SimClock()
    sim.set(100)
    assert not sim.wait_for_change(100, 0.01)
    assert sim.wait_for_change(50, 0.0)


def test_a_new_stamp_wakes_a_waiting_thread() -> None:
    """A thread that waits for a change of simulated time goes on with the next stamp."""
    sim = SimClock()
    sim.set(100)
    thread = threading.Timer(0.01, lambda: sim.set(200))  # noqa: TID251
    thread.start()
    begin = monotonic()
    assert sim.wait_for_change(100, LIMIT)
    assert monotonic() - begin < LIMIT / 2
    thread.join()


def test_a_rate_equal_to_the_tick() -> None:
    """A period equal to the tick gives one moment per tick after the start."""
    ticks = [n * 100 for n in range(11, 16)]
    assert moments(Rate(100, 1000), [1000, *ticks]) == ticks


def test_a_rate_keeps_its_average() -> None:
    """A moment between two ticks is due at the next tick, and does not delay the later ones."""
    come = moments(Rate(300, 0), [n * 100 for n in range(1, 100)])
    assert come == [n * 300 for n in range(1, 34)]
    come = moments(Rate(333, 0), [n * 100 for n in range(1, 101)])
    assert come[:4] == [400, 700, 1000, 1400]
    assert len(come) == 30


def test_a_rate_above_the_ticks_gives_one_moment_per_tick() -> None:
    """Several moments between two ticks become one."""
    ticks = [n * 100 for n in range(1, 10)]
    assert moments(Rate(10, 0), ticks) == ticks
    assert moments(Rate(50, 0), ticks) == ticks


def test_missed_moments_are_skipped() -> None:
    """After a long gap one moment is due, and the next a whole period later."""
    assert moments(Rate(100, 0), [100, 1030, 1031, 1100, 1129, 1130, 1230]) == [100, 1030, 1130, 1230]


def test_after_a_jump_back_a_rate_counts_from_the_new_time() -> None:
    """The next moment is a period after the new time, not at the old schedule."""
    rate = Rate(100, 5000)
    assert rate.left(5050) == 50
    assert rate.left(20) == 100
    assert moments(rate, [80, 119, 120, 180, 220]) == [120, 220]


def test_time_left_is_never_negative() -> None:
    """A moment that is late has 0 ns left."""
    rate = Rate(100, 0)
    assert [rate.left(now) for now in (0, 40, 100, 250)] == [100, 60, 0, 0]


def test_a_period_is_at_least_a_nanosecond() -> None:
    """A period of 0 gives one moment per change of the time."""
    assert moments(Rate(0, 0), [0, 1, 2]) == [1, 2]


def test_a_ticker_follows_simulated_time() -> None:
    """A moment comes with the stamp that reaches it, and not before."""
    with TickerThread(1e-6) as ticking:
        for n, stamp in enumerate((1000, 2000, 3500, 4000), 1):
            ticking.go_to(stamp - 1)
            ticking.go_to(stamp)
            assert ticking.wait_for(n)[-1] == stamp


def test_a_ticker_stands_still_with_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """While time stands still no moment comes, and the callback reports it repeatedly."""
    monkeypatch.setattr(clock, "STILL", 0.01)
    with TickerThread(1e-6) as ticking:
        ticking.go_to(999)
        ticking.wait_until_still()
        assert ticking.come == []
        ticking.go_to(1000)
        assert ticking.wait_for(1) == [1000]


def test_a_ticker_goes_on_after_a_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    """After time jumps back, the next moment is a period after the new time."""
    monkeypatch.setattr(clock, "STILL", 0.01)
    with TickerThread(1e-6) as ticking:
        ticking.go_to(50_000)
        ticking.wait_for(1)
        ticking.go_to(100)
        ticking.wait_until_still()
        ticking.go_to(1099)
        ticking.wait_until_still()
        ticking.go_to(1100)
        assert ticking.wait_for(2) == [50_000, 1100]


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
    ticker = Ticker(0.1, wall)
    ticker.wait()
    now[0] += to_ns(0.03)
    ticker.wait()
    now[0] += to_ns(0.35)
    ticker.wait()
    ticker.wait()
    assert slept == [0.1, 0.07, 0.1]
