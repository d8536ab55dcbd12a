"""When the next tick is due: in real time, at a multiple of it, as fast as possible, paused, or in single steps.

No tick is skipped. A simulator that is late catches up. When it is more than MAX_LAG late it starts a new schedule.
"""

import threading
from collections import deque

from zteam.numbers import percentile

_WINDOW = 50
"""Ticks over which the real-time factor is measured."""
MAX_LAG = 1.0
"""Host seconds of lateness beyond which the schedule starts anew."""


class Pacer:
    """The main loop tells it the host's time in seconds; other threads change the pace."""

    def __init__(self, interval: int, speed: float | None = 1.0, *, paused: bool = False) -> None:
        self._interval = interval / 1e9
        self.speed = speed
        """Simulated seconds a second of the host; None = as fast as possible."""
        self.paused = paused
        self._lock = threading.Lock()
        self.steps = 0
        """Ticks that are still to be taken while paused."""
        self._due: float | None = None
        self._starts: deque[float] = deque(maxlen=_WINDOW)
        self._lateness: deque[float] = deque(maxlen=10_000)
        """Host seconds between the due time and the start of the newest ticks."""

    def set_speed(self, speed: float | None) -> None:
        """Change the speed from now on."""
        self.speed = speed
        self.start_anew()

    def pause(self) -> None:
        """Stand still after the open tick."""
        with self._lock:
            self.paused, self.steps = True, 0

    def resume(self) -> None:
        """Run on at the given speed."""
        with self._lock:
            self.paused, self.steps = False, 0
        self.start_anew()

    def step(self, ticks: int) -> None:
        """Take so many more ticks, as fast as possible, and then stand still."""
        with self._lock:
            self.paused = True
            self.steps += ticks

    def remaining(self, now: float) -> float | None:
        """Seconds until the next tick is due; None while the world stands still."""
        if self.paused:
            return 0.0 if self.steps else None
        if self.speed is None or self._due is None:
            return 0.0
        return max(0.0, self._due - now)

    def start(self, now: float, *, counts: bool = True) -> None:
        """A tick begins. If it does not count, it takes no step: so does the first tick, which is sent in any case."""
        self._starts.append(now)
        # A query may change it meanwhile, on a thread of the bus.
        speed = self.speed
        if self.paused:
            with self._lock:
                self.steps = max(0, self.steps - counts)
            self._due = None
        elif speed is not None:
            due = self._due
            if due is not None:
                self._lateness.append(now - due)
            if due is None or now - due > MAX_LAG:
                due = now
            self._due = due + self._interval / speed

    @property
    def factor(self) -> float:
        """Simulated seconds a second of the host over the last ticks; 1 until that is known."""
        if len(self._starts) < 2:
            return 1.0
        elapsed = self._starts[-1] - self._starts[0]
        return self._interval * (len(self._starts) - 1) / elapsed if elapsed > 0 else 1.0

    def start_anew(self) -> None:
        """Start schedule and measurements with the next tick: the world stood still on purpose until now."""
        self._due = None
        self._starts.clear()
        self._lateness.clear()

    @property
    def lateness_p99_ms(self) -> float | None:
        """Milliseconds that ticks began after they were due, 99th percentile; None without a schedule."""
        seconds = percentile(self._lateness, 0.99)
        return None if seconds is None else 1e3 * seconds

    @property
    def behind(self) -> bool:
        """Whether the world runs more than 5 % slower than its speed."""
        known = len(self._starts) > 1
        return known and not self.paused and self.speed is not None and self.factor < 0.95 * self.speed
