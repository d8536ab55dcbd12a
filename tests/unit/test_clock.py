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


def test_a_jump_back_is_reported_with_both_times() -> None:
    """A smaller stamp is accepted and reported to the callbacks, an equal or larger one is not. Time is 0 at first."""
    sim, heard = SimClock(), []
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
        auto.sim.set(300)
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
    sim = SimClock()
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


def test_a_ticker_goes_on_after_a_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    """A moment comes with the stamp that reaches it; while time stands still none does, which is reported. After time
    jumps back, the next moment is a period after the new time."""
    monkeypatch.setattr(clock, "STILL", 0.01)
    with TickerThread(1e-6) as ticking:
        ticking.go_to(999)
        ticking.wait_until_still()
        assert ticking.come == []
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
