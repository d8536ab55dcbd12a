"""When the next tick is due: in real time, at a multiple of it, as fast as possible, paused, or in single steps.

No tick is skipped. A simulator that is late catches up. When it is more than MAX_LAG late it starts a new schedule.
"""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from zteam.clock import monotonic
from zteam.config.numbers import percentile
from zteam.errors import ZteamError
from zteam.node.process_node import ProcessNode

_WINDOW = 50
"""Ticks over which the real-time factor is measured."""
MAX_LAG = 1.0
"""Host seconds of lateness beyond which the schedule starts anew."""
_LONGEST_WAIT = threading.TIMEOUT_MAX
"""Host seconds: a condition takes no longer time-out."""


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
        self.speed = speed
        self.start_anew()

    def pause(self) -> None:
        with self._lock:
            self.paused, self.steps = True, 0

    def resume(self) -> None:
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

    def start(self, now: float) -> None:
        """A tick begins."""
        self._starts.append(now)
        # A query may change it meanwhile, on a thread of the bus.
        speed = self.speed
        if self.paused:
            with self._lock:
                self.steps = max(0, self.steps - 1)
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


class TickBoundary:
    """Between two ticks: the main loop waits here for the next one, and makes the changes that were asked for. The main
    loop calls `wait_for_tick` and `finish`; the threads of queries call the rest."""

    def __init__(self, node: ProcessNode, pacer: Pacer) -> None:
        self._node = node
        self._pacer = pacer
        self._changes: deque[tuple[Future[Any], Callable[[], Any]]] = deque()
        self._is_idle = False
        """Whether the main loop waits here."""
        self.finished = False
        """Whether the time of `--for` is over."""

    def submit(self, change: Callable[[], Any]) -> Future[Any]:
        """Have the main loop call `change()` between two ticks. The future gets its result or its ZteamError."""
        future: Future[Any] = Future()
        self._changes.append((future, change))
        self._node.wake()
        return future

    def set_pace(self, change: Callable[[], None]) -> None:
        """Change the pacer now, during the open tick, and let the main loop look at it."""
        with self._node.changed:
            change()
            self._node.changed.notify_all()

    def wait(self, ready: Callable[[], bool], timeout: float = _LONGEST_WAIT) -> bool:
        """Wait for `timeout` host seconds at most, or until the process stops; whether `ready()`."""
        with self._node.changed:
            self._node.changed.wait_until(lambda: ready() or self._node.stopping, timeout)
            return ready()

    def stands(self) -> bool:
        """Whether the world stands still: the tick at hand is over, and no further one is due."""
        return self._is_idle and self._remaining() is None

    def finish(self) -> None:
        self.finished = True
        self._pacer.steps = 0
        self._node.wake()

    def begin_anew(self) -> None:
        """The world is at its start: its first tick is sent even if it is paused, or no process would know."""
        self.finished = False
        if self._pacer.paused:
            self._pacer.step(1)

    def wait_for_tick(self) -> bool:
        """Wait until the next tick is due, and make changes meanwhile; False when the process is asked to stop."""
        while not self._node.stopping:
            while self._changes:
                future, change = self._changes.popleft()
                try:
                    future.set_result(change())
                except ZteamError as error:
                    future.set_exception(error)
            remaining = self._remaining()
            if remaining == 0.0:
                return True
            self._is_idle = True
            self._node.wake()
            longest = _LONGEST_WAIT if remaining is None else min(remaining, _LONGEST_WAIT)
            self._node.wait(lambda: bool(self._changes) or self._remaining() == 0.0, longest)
            self._is_idle = False
        return False

    def _remaining(self) -> float | None:
        return None if self.finished else self._pacer.remaining(monotonic())
