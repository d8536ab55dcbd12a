"""All clocks: the host's, and simulated time from the bus. No other module reads a clock or sleeps.

Simulated and wall time are integer nanoseconds. Use `monotonic` to measure and for time-outs of things outside zteam (a
router that does not answer); no decision of a robot may depend on it.
"""

import math
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import NamedTuple

NS_PER_S = 1_000_000_000
STANDS = 1.0
"""Host seconds without a new simulated time after which nothing is late or early by it."""
STILL = 2.0
"""Host seconds without a new simulated time after which a waiting tool tells its user."""


PATIENCE_BOUNDS = (1.0, 100.0)
"""Of ZTEAM_PATIENCE."""
HOST_FACTOR = 1.0
with suppress(ValueError):
    # Of what is no number BusOptions.from_environment tells the user.
    _given = float(os.environ.get("ZTEAM_PATIENCE") or 1.0)
    HOST_FACTOR = _given if PATIENCE_BOUNDS[0] <= _given <= PATIENCE_BOUNDS[1] else 1.0
"""Times every limit of the host's: how long a process may take to start or to end, and how long a silent link counts
as whole. `ZTEAM_PATIENCE` sets it, for a busy machine. It changes no limit of a robot: neither the watchdog nor the
limits on old data nor the time-out of lock-step."""

monotonic: Callable[[], float] = time.monotonic
"""Seconds on the host's monotonic clock. Every tick asks for it often, so there is no function around it."""

thread_time: Callable[[], float] = time.thread_time
"""Processor time of this thread, in seconds."""
process_time: Callable[[], float] = time.process_time
"""CPU seconds of this process: benchmarks use them because other load affects them little."""

_BOOT = getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC)
"""The host's clock that also runs while the machine is suspended, where there is one (Linux)."""
boot_time: Callable[[], float] = partial(time.clock_gettime, _BOOT)
"""Seconds on that clock."""


def monotonic_times() -> Iterator[int]:
    """Nanoseconds on the host's monotonic clock, one at each `next`, from any thread."""
    return iter(time.monotonic_ns, None)


def wall_ns() -> int:
    """Nanoseconds since the Unix epoch on the host's clock."""
    return time.time_ns()


APART = 0.25
"""Seconds that the clocks of two hosts may differ before people are told."""
_TOGETHER = 1.0
"""Host seconds within which a late subscriber gets what living writers of a latched key have kept."""


class Sent(NamedTuple):
    """When a message was sent, by the clock of its sender, and when it came."""

    stamp: int = 0
    """Of any unit; 0 where it is not known."""
    delay: float = 0.0
    """Seconds from the stamp to its arrival, by two clocks that may differ."""
    arrival: float = 0.0
    """Host time."""

    def hides(self, other: "Sent") -> bool:
        """Whether a message that comes after this one was not sent later.

        Stamps are compared for a moment only, in which a late subscriber gets what was kept. Whatever comes later
        counts: the clock of its host may be behind, or have been set back since. A stamp that is ahead of the host's
        clock hides nothing.
        """
        is_together = other.arrival - self.arrival < _TOGETHER and self.delay >= -APART
        return is_together and 0 < other.stamp <= self.stamp


NOT_KNOWN = Sent()


_EPOCH_NS = time.time_ns() - time.clock_gettime_ns(_BOOT)


def stamp_ns() -> int:
    """Nanoseconds since the Unix epoch by the host's clock as it was at the start of this process: never set back.

    It goes on while the machine is suspended, so that processes from before and after that agree.
    """
    return _EPOCH_NS + time.clock_gettime_ns(_BOOT)


FREEZE_WATCH = 0.1
"""Host seconds between two looks of a process at whether it was frozen."""
_LATE = 1.0
"""Host seconds by which a look has to be late for a freeze."""
_BUSY = 0.2
"""Share of that time from which on the process itself worked: then it was busy, and not frozen."""
AFTERMATH = 3.0 * HOST_FACTOR
"""Host seconds after a freeze within which a lost link follows from it."""


class Freezes:
    """Whether this process stood still: stopped by a signal or a debugger, paused with its container, or suspended with
    the machine. What it missed meanwhile says nothing about other processes.

    One thread calls `look` every FREEZE_WATCH. Code that judges others calls it too, as it may run before that thread.
    """

    def __init__(
        self,
        now: Callable[[], float] = boot_time,
        worked: Callable[[], float] = process_time,
        host: Callable[[], float] = time.monotonic,
    ) -> None:
        """The clocks: one that runs during the freeze, this process's processor time, and that of `look`."""
        self._now, self._worked, self._host = now, worked, host
        self._lock = threading.Lock()
        self._last: tuple[float, float] | None = None
        """`now` and `worked` at the last look; None before `begin`."""
        self._woke = -math.inf
        self._frozen = 0.0

    def begin(self) -> None:
        with self._lock:
            self._last, self._frozen = (self._now(), self._worked()), 0.0

    def look(self) -> float:
        """Host time (`monotonic`) at which this process went on after its last freeze; -inf without one.

        No silence of others counts that began before.
        """
        with self._lock:
            # Just after the last look there is nothing to see, and the processor time is slow to read.
            if self._last is not None and (now := self._now()) - self._last[0] >= FREEZE_WATCH / 2:
                worked, late = self._worked(), now - self._last[0] - FREEZE_WATCH
                if late > _LATE and worked - self._last[1] < _BUSY * late:
                    self._woke, self._frozen = self._host(), self._frozen + late
                self._last = now, worked
            return self._woke

    def has_just_woken(self) -> bool:
        """Whether a freeze has ended within AFTERMATH."""
        return self._host() - self.look() < AFTERMATH

    def take(self) -> float:
        """Seconds of the freezes since the last call."""
        self.look()
        with self._lock:
            frozen, self._frozen = self._frozen, 0.0
            return frozen


FREEZES = Freezes()
"""Those of this process."""


def pause(seconds: float) -> None:
    """Sleep on the host's clock. Use it only between attempts at something that gives no sign when it is ready."""
    time.sleep(seconds)


def later(seconds: float, act: Callable[[], None], name: str) -> Callable[[], None]:
    """Call `act()` on the host's clock, in a thread of this name; returns what takes it back.

    Use it only where no other thread can wait for a condition.
    """
    timer = threading.Timer(seconds, act)
    timer.name, timer.daemon = name, True
    timer.start()
    return timer.cancel


def local_time_text(moment: int | None = None) -> str:
    """The host's local time of day, now or at `moment` (ns since the Unix epoch), for log lines: HH:MM:SS."""
    return time.strftime("%H:%M:%S", time.localtime(None if moment is None else moment / NS_PER_S))


def utc_text(seconds: float) -> str:
    """A moment in seconds since the Unix epoch, for people on any machine: `2026-11-29 01:30 UTC`."""
    return time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime(seconds))


def to_ns(seconds: float) -> int:
    """Seconds as integer nanoseconds."""
    return round(seconds * NS_PER_S)


def to_seconds(nanoseconds: int) -> float:
    """Integer nanoseconds as seconds."""
    return nanoseconds / NS_PER_S


def wait_until(condition: threading.Condition, ready: Callable[[], bool], timeout: float | None) -> bool:
    """Wait on `condition` until `ready()`, for at most `timeout` host seconds if given; return whether it is ready.

    The caller holds the lock of `condition`.
    """
    return condition.wait_for(ready, timeout)


class WatchedCondition(threading.Condition):
    """A condition whose waits are looked at by the thread that changes something.

    A thread that is woken for nothing waits for the interpreter's lock. Until it gets it, each numpy call of the other
    threads that gives the lock away has to signal it: with four robots in one process that took a fifth of a tick.
    """

    def __init__(self, lock: threading.RLock) -> None:
        super().__init__(lock)
        self.awaited: list[Callable[[], bool]] = []
        """What each thread in `wait_until` waits for."""

    def wait_until(self, ready: Callable[[], bool], timeout: float) -> None:
        """Wait until `ready()`, for at most `timeout` host seconds, under the lock. `look` calls `ready` too."""
        self.awaited.append(ready)
        try:
            wait_until(self, ready, timeout)
        finally:
            self.awaited.remove(ready)

    def look(self) -> None:
        """Something has changed: wake the threads in `wait_until` if one of them is ready. Call it under the lock."""
        for ready in self.awaited:
            if ready():
                self.notify_all()
                return


class AutoClock:
    """Undecided at first; then simulated time or wall time for the life of the process (docs/time.md).

    A simulator's presence or a `clock` message decides for simulated time; a base's data without either decides for
    wall time. Simulated time stands still between ticks and when a simulator ends: it never becomes wall time.
    """

    def __init__(self) -> None:
        self.simulated = self._wall = False
        """Whether this is simulated time, or the host's."""
        self._now = 0
        self._set = -math.inf
        self._changed = WatchedCondition(threading.RLock())
        self._on_jump_back: list[Callable[[int, int], None]] = []

    @property
    def decided(self) -> bool:
        return self.simulated or self._wall

    def now(self) -> int:
        """Nanoseconds; 0 while undecided or before the simulator's first tick."""
        return time.time_ns() if self._wall else self._now

    def steady(self) -> int:
        """Nanoseconds for measuring intervals: simulated time, or the host's monotonic clock, which is never set."""
        return self._now if self.simulated else time.monotonic_ns()

    @property
    def stands(self) -> bool:
        """Whether simulated time was not set for STANDS: the world stands, or what sets it does not get here."""
        return self.simulated and time.monotonic() - self._set > STANDS

    def use_simulated(self) -> None:
        """Decide for simulated time, unless decided: a simulator was seen."""
        self.simulated = not self._wall

    def use_wall(self) -> None:
        """Decide for wall time, unless decided: a base's data was seen without a simulator."""
        self._wall = not self.simulated

    def on_jump_back(self, callback: Callable[[int, int], None]) -> None:
        """Call `callback(old, new)` when simulated time jumps back (the simulator restarted or was reset)."""
        self._on_jump_back.append(callback)

    def set(self, stamp: int) -> None:
        """Set simulated time to a new stamp (ns) of the `clock` key."""
        old, self._now, self._set = self._now, stamp, time.monotonic()
        if self._changed.awaited:
            with self._changed:
                self._changed.look()
        if stamp < old:
            for callback in self._on_jump_back:
                callback(old, stamp)

    def wait_for_change(self, seen: int, timeout: float) -> bool:
        """Wait until simulated time differs from `seen`, for at most `timeout` host seconds; whether it does."""
        with self._changed:
            self._changed.wait_until(lambda: self._now != seen, timeout)
            return self._now != seen


class Every:
    """True once per `period` host seconds: limits the rate of warnings in a log."""

    def __init__(self, period: float, *, after: float = 0.0) -> None:
        """The first one is due `after` so many host seconds."""
        self._period, self._next = period, time.monotonic() + after

    def left(self) -> float:
        """Host seconds until it is due; 0 if it is."""
        return max(0.0, self._next - time.monotonic())

    def due(self) -> bool:
        """Return True if a period has passed since the last True."""
        now = time.monotonic()
        if now < self._next:
            return False
        self._next = now + self._period
        return True


class Rate:
    """Evenly spaced moments, like `rospy.Rate`, of any clock that counts nanoseconds. Pure: the caller passes the time.

    A missed moment is skipped. When time jumps back, the next moment is a period after the new time.
    """

    def __init__(self, period: int, now: int) -> None:
        """The first moment is a `period` (ns) after `now`."""
        self._period = max(1, period)
        self._next = now + self._period
        self._newest = now

    def left(self, now: int) -> int:
        """Nanoseconds until the next moment; 0 if it is due."""
        if now < self._newest:
            self._next = now + self._period
        self._newest = now
        return max(0, self._next - now)

    def take(self, now: int) -> None:
        """Advance to the moment after the one that is due."""
        self._next += self._period
        if self._next <= now:
            self._next = now + self._period


def moments(period: float, clock: AutoClock, on_still: Callable[[], None] = lambda: None) -> Callable[[], None]:
    """A function that waits for the next of evenly spaced moments of `clock`, which is decided.

    The first one is `period` seconds from now. `on_still()` is called each time simulated time has stood for STILL.
    """
    rate = Rate(to_ns(period), clock.steady())

    def wait() -> None:
        now = clock.steady()
        while left := rate.left(now):
            if not clock.simulated:
                time.sleep(to_seconds(left))
            elif not clock.wait_for_change(now, STILL):
                on_still()
            now = clock.steady()
        rate.take(now)

    return wait
