"""What the threads of this process work at, and what keeps them from it: steps that last too long, pauses, freezes.

A step keeps its thread, and in lock-step also the bus's thread and the world. So one thread of the process looks at the
steps that are under way, and at whether the process itself was frozen (`clock.Freezes`): then no other process is
blamed for what it missed.
"""

import threading
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from threading import get_ident
from typing import TypeVar

import msgspec

from zteam.clock import FREEZE_WATCH, FREEZES, Every, monotonic, pause
from zteam.errors import log

T = TypeVar("T")

LONG = 1.0
"""Host seconds for which a single step is too long. Those before the end of a freeze do not count."""
SLOW_STEPS = 3
"""So many steps in a row that outlast their interval are the fault of their code; fewer may be the machine's."""
_TELL_EVERY = 60.0
PAUSE = 0.5
"""Seconds without a step from which on there was a pause: of its time and, out of lock-step, of the host too."""
_INTERVALS = 3.0
"""The same in intervals of steps, where these are long."""


class Work(msgspec.Struct):
    """What one thread does. Only that thread changes it."""

    node: str = ""
    """The node that it works for, where a process has several; empty for code of no node."""
    call: int = 0
    """The number of the call under way that others wait for, such as a step; 0 between two calls."""


WORK: defaultdict[int, Work] = defaultdict(Work)
"""By thread. A later thread may get the number of one that has ended, and its idle Work."""
CALLS = count(1)
"""Numbers of calls: each call has its own."""


@contextmanager
def working_for(node: str) -> Iterator[None]:
    """Within, this thread works for `node`."""
    work = WORK[get_ident()]
    before, work.node = work.node, node
    try:
        yield
    finally:
        work.node = before


class Pauses:
    """Whether there was a pause before a step. A robot that made no progress meanwhile is not stuck."""

    def __init__(self) -> None:
        self._time, self._host = 0, 0.0
        """Of the last step, in ns and in host time; 0 before."""

    def take(self, now: int, interval: float, *, in_lockstep: bool) -> bool:
        """A step begins at time `now` (ns), one comes every `interval` seconds: whether there was a pause before it."""
        before, self._time = self._time, now
        host, self._host = self._host, 0.0 if in_lockstep else monotonic()
        if not 0 < before < now - 1e9 * max(PAUSE, _INTERVALS * interval):
            return False
        # Time that runs at many times the host's has gaps of its own.
        return in_lockstep or self._host - host > PAUSE or FREEZES.look() > host


_under_way: set["StepWatch"] = set()


class StepWatch:
    """Names the steps of one behaviour or node in the log that are too slow, or do not return."""

    def __init__(self, step: str, rhythm: str, way_out: str) -> None:
        """The log names `step`, its interval after `rhythm`, such as `a scan comes every`, and the `way_out`."""
        self._step, self._rhythm, self._way_out = step, rhythm, way_out
        self.node = WORK[get_ident()].node
        """Where this process has several: whose steps they are."""
        self._began = self._interval = 0.0
        """When the newest step began (host time), and its interval."""
        self._late = 0
        """How many steps in a row outlasted their interval."""
        self._slow, self._hangs = Every(_TELL_EVERY), Every(_TELL_EVERY)

    def run(self, step: Callable[[], T], interval: float, *, paced: bool) -> T:
        """What `step()` returns. The next step is due after `interval` seconds, 0 where that is not known; where it is
        `paced` by a clock, this step is too slow if it misses the next one.
        """
        work = WORK[get_ident()]
        outer_call, work.call = work.call, next(CALLS)
        self._began, self._interval = monotonic(), interval
        _under_way.add(self)
        try:
            return step()
        finally:
            _under_way.discard(self)
            work.call = outer_call
            seconds = monotonic() - self._began
            self._late = self._late + 1 if paced and 0.0 < interval < seconds else 0
            if seconds >= LONG or self._late >= SLOW_STEPS:
                self._warn("takes", seconds, self._slow, is_slow=self._late >= SLOW_STEPS)

    def look(self) -> None:
        """A step is under way. Called by the thread that looks."""
        with working_for(self.node):
            self._warn("has not returned for", monotonic() - self._began, self._hangs)

    @property
    def is_long(self) -> bool:
        """Whether the newest step has lasted too long by now."""
        return monotonic() - self._began >= LONG and monotonic() - FREEZES.look() >= LONG

    def _warn(self, verb: str, seconds: float, may_tell: Every, *, is_slow: bool = False) -> None:
        if (is_slow or (seconds >= LONG and self.is_long)) and may_tell.due():
            rhythm = f", {self._rhythm} {self._interval:g} s" if self._interval else ""
            log.warning("%s %s %.1f s%s; %s", self._step, verb, seconds, rhythm, self._way_out)


def hanging() -> list[StepWatch]:
    """Those whose step is under way and takes too long."""
    return [watch for watch in list(_under_way) if watch.is_long]


_lock = threading.Lock()
_thread: threading.Thread | None = None


def watch_process() -> None:
    """Watch this process from now on: its steps, and whether it is frozen."""
    global _thread
    with _lock:
        # A forked child has none of its parent's threads.
        if _thread is None or not _thread.is_alive():
            FREEZES.begin()
            _thread = threading.Thread(target=_look, name="watch", daemon=True)
            _thread.start()


def _look() -> None:
    while True:
        pause(FREEZE_WATCH)
        if seconds := FREEZES.take():
            log.warning(
                "was frozen for %.1f s (SIGSTOP, docker pause, a suspended or overloaded machine): "
                "what it missed says nothing about the other processes",
                seconds,
            )
        for watch in list(_under_way):
            watch.look()
