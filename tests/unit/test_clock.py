"""Clocks: simulated time, and which time it is."""

import threading

import pytest

from zteam import clock
from zteam.clock import AutoClock, Every, SimClock, WallClock, to_ns, to_seconds, wait_until


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
