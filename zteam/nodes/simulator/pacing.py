"""When the next tick is due: real time, a factor of it, as fast as possible, paused, or so many single steps.

No tick is ever skipped. A simulator that falls behind its schedule says so, and starts the schedule anew when it is
more than MAX_LAG late, instead of rushing to catch up.
"""

import threading
from collections import deque

from zteam.numbers import percentile

_WINDOW = 50
"""Ticks over which the real-time factor is measured."""
MAX_LAG = 1.0
"""Host seconds."""


class Pacer:
    """Told the host's time, in seconds, by the main loop; the pace is changed from other threads."""

    def __init__(self, interval: int, speed: float | None = 1.0, *, paused: bool = False) -> None:
        self._interval = interval / 1e9
        self.speed = speed
        """Simulated seconds a second of the host; None = as fast as possible."""
        self.paused = paused
        self._lock = threading.Lock()
        self.steps = 0
        """Ticks still to go while paused."""
        self._due: float | None = None
        self._starts: deque[float] = deque(maxlen=_WINDOW)
        self._lateness: deque[float] = deque(maxlen=10_000)
        """Host seconds that ticks began after they were due, the newest ones."""

    def set_speed(self, speed: float | None) -> None:
        """Change the speed from now on."""
        self.speed = speed
        self.start_anew()

    def pause(self) -> None:
        """Stand still after the tick at hand."""
        with self._lock:
            self.paused, self.steps = True, 0

    def resume(self) -> None:
        """Go on."""
        with self._lock:
            self.paused, self.steps = False, 0
        self.start_anew()

    def step(self, ticks: int) -> None:
        """Go on for so many ticks, as fast as possible, and stand still then."""
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
        """A tick begins; one that does not count is none of the steps, such as the first."""
        self._starts.append(now)
        if self.paused:
            with self._lock:
                self.steps = max(0, self.steps - counts)
            self._due = None
        elif self.speed is not None:
            due = self._due
            if due is not None:
                self._lateness.append(now - due)
            if due is None or now - due > MAX_LAG:
                due = now
            self._due = due + self._interval / self.speed

    @property
    def factor(self) -> float:
        """Simulated seconds a second of the host over the last ticks; 1 until that is known."""
        if len(self._starts) < 2:
            return 1.0
        elapsed = self._starts[-1] - self._starts[0]
        return self._interval * (len(self._starts) - 1) / elapsed if elapsed > 0 else 1.0

    def start_anew(self) -> None:
        """The schedule begins with the next tick, and so does what is measured: the world was held on purpose."""
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
        """Whether the world is slower than it was asked to be."""
        known = len(self._starts) > 1
        return known and not self.paused and self.speed is not None and self.factor < 0.95 * self.speed
