"""The one place that knows time: the host's clocks, and simulated time from the bus.

Simulated and wall time are integer nanoseconds. `monotonic` is for measuring and for time-outs towards the outside
world (a router that does not answer); nothing a robot decides may depend on it.
"""

import threading
import time
from collections.abc import Callable
from typing import Protocol

NS_PER_S = 1_000_000_000
STILL = 2.0
"""Host seconds without news of simulated time after which a user may like to hear what is waited for."""


def monotonic() -> float:
    """Seconds on the host's monotonic clock."""
    return time.monotonic()


def process_time() -> float:
    """Processor seconds of this process: for benchmarks, where other load must count little."""
    return time.process_time()


def wall_ns() -> int:
    """Nanoseconds since the Unix epoch on the host's clock."""
    return time.time_ns()


def pause(seconds: float) -> None:
    """Sleep on the host's clock: only between attempts at something outside that tells nobody when it is ready."""
    time.sleep(seconds)


def local_time_text(moment: int | None = None) -> str:
    """The host's local time of day, now or at `moment` (ns since the Unix epoch), for log lines: HH:MM:SS."""
    return time.strftime("%H:%M:%S", time.localtime(None if moment is None else moment / NS_PER_S))


def to_ns(seconds: float) -> int:
    """Seconds as integer nanoseconds."""
    return round(seconds * NS_PER_S)


def to_seconds(nanoseconds: int) -> float:
    """Integer nanoseconds as seconds."""
    return nanoseconds / NS_PER_S


def wait_until(condition: threading.Condition, ready: Callable[[], bool], timeout: float) -> bool:
    """Wait on `condition` until `ready()` or for `timeout` seconds of the host's clock; the caller holds the lock."""
    return condition.wait_for(ready, timeout)


class Clock(Protocol):
    """What time it is for a process: 0 until that is known."""

    def now(self) -> int:
        """Nanoseconds; 0 = not known yet."""
        ...


class WallClock:
    """The host's time, for robots without a simulator."""

    def now(self) -> int:
        """Nanoseconds since the Unix epoch."""
        return time.time_ns()


class SimClock:
    """Time as the simulator says it: stands still between ticks and when the simulator is gone."""

    def __init__(self) -> None:
        self._now = 0
        self._changed = threading.Condition()
        self._jumped: list[Callable[[int, int], None]] = []

    def now(self) -> int:
        """The newest stamp heard; 0 before the first."""
        return self._now

    def on_jump_back(self, callback: Callable[[int, int], None]) -> None:
        """Call `callback(old, new)` when time jumps back (the simulator restarted or was reset)."""
        self._jumped.append(callback)

    def set(self, stamp: int) -> None:
        """Take a new stamp from the `clock` key."""
        with self._changed:
            old, self._now = self._now, stamp
            self._changed.notify_all()
        if stamp < old:
            for callback in self._jumped:
                callback(old, stamp)

    def wait_for_change(self, seen: int, timeout: float) -> bool:
        """Wait until it is another time than `seen`, for `timeout` host seconds; whether it is."""
        with self._changed:
            return self._changed.wait_for(lambda: self._now != seen, timeout)


class AutoClock:
    """Undecided until the first evidence, then simulated or wall time for good (DESIGN section 5).

    Evidence of simulated time is a simulator's presence or a `clock` message; of wall time, a base's data without
    either. A simulator that goes away stops time: it never turns into wall time.
    """

    def __init__(self) -> None:
        self.sim = SimClock()
        self._wall: WallClock | None = None
        self._simulated = False

    @property
    def decided(self) -> bool:
        """Whether it is known which time this is."""
        return self._simulated or self._wall is not None

    @property
    def simulated(self) -> bool:
        """Whether this is simulated time."""
        return self._simulated

    def now(self) -> int:
        """Nanoseconds; 0 while undecided or before the simulator's first tick."""
        return self._wall.now() if self._wall else self.sim.now()

    def steady(self) -> int:
        """Nanoseconds to space moments by: simulated, or the host's monotonic ones, which nobody sets."""
        return self.sim.now() if self._simulated else time.monotonic_ns()

    def use_simulated(self) -> None:
        """A simulator was seen."""
        if self._wall is None:
            self._simulated = True

    def use_wall(self) -> None:
        """A base's data was seen without a simulator."""
        if not self._simulated and self._wall is None:
            self._wall = WallClock()


class Every:
    """True once per `period` seconds of the host's clock: for warnings that must not flood a log."""

    def __init__(self, period: float) -> None:
        self._period = period
        self._next = float("-inf")

    def due(self) -> bool:
        """Whether a period has passed since the last True."""
        now = time.monotonic()
        if now < self._next:
            return False
        self._next = now + self._period
        return True


class Rate:
    """Evenly spaced moments of any clock that counts nanoseconds, as `rospy.Rate` has them. Pure: it is told the time.

    A moment that was missed is not made up for. When time jumps back, the next moment counts from the new time.
    """

    def __init__(self, period: int, now: int) -> None:
        """The first moment comes a `period` (ns) after `now`."""
        self._period = max(1, period)
        self._next = now + self._period
        self._newest = now

    def left(self, now: int) -> int:
        """Nanoseconds until the next moment; 0 when it has come."""
        if now < self._newest:
            self._next = now + self._period
        self._newest = now
        return max(0, self._next - now)

    def take(self, now: int) -> None:
        """Go on to the moment after the one that has come."""
        self._next += self._period
        if self._next <= now:
            self._next = now + self._period


class Ticker:
    """Waits for evenly spaced moments of simulated time, or of the host's: for tools that do something at a rate."""

    def __init__(self, period: float, clock: AutoClock) -> None:
        """The first moment comes `period` seconds from now. `clock` is decided."""
        self._clock = clock
        self._rate = Rate(to_ns(period), clock.steady())

    def wait(self, on_still: Callable[[], None] = lambda: None) -> None:
        """Until the next moment; `on_still()` is called when simulated time has stood still for STILL."""
        now = self._clock.steady()
        while left := self._rate.left(now):
            if not self._clock.simulated:
                time.sleep(to_seconds(left))
            elif not self._clock.sim.wait_for_change(now, STILL):
                on_still()
            now = self._clock.steady()
        self._rate.take(now)
