"""Which processes of a team are started again after a failure, how often, and when."""

import logging
import threading
from collections.abc import Callable, Iterable
from typing import NamedTuple

from zteam import names
from zteam.bus import Bus, NoRequest
from zteam.clock import monotonic
from zteam.launch.process import exit_text

log = logging.getLogger("zteam")

DELAYS = (1.0, 2.0, 4.0, 8.0, 8.0)
"""Host seconds before each restart in a row; after as many it is given up."""
STEADY = 60.0
"""A process that ran for so many host seconds has recovered: its next failure is the first in a row."""


class Again(NamedTuple):
    """What happens after a failure."""

    delay: float | None = None
    """Host seconds until the process is started again; None = never."""
    in_row: int = 0
    """How many failures in a row it has had with this one; 0 for a process that is never started again."""


class Backoff:
    """The failures in a row of one process. Pure."""

    def __init__(self) -> None:
        self._in_row = 0

    def take_failure(self, ran_for: float) -> Again:
        """The process failed after `ran_for` host seconds; without a delay it is given up."""
        self._in_row = 1 if ran_for >= STEADY else self._in_row + 1
        return Again(DELAYS[self._in_row - 1] if self._in_row <= len(DELAYS) else None, self._in_row)


class Restarts:
    """Starts processes again, each after its delay, until `end`."""

    def __init__(self, start: Callable[[str], None], allowed: Iterable[str] = ()) -> None:
        """`start(name)` is called on a thread of its own, never after `cancel` or `end`."""
        self._start = start
        self._lock = threading.Lock()
        self._allowed = {name: Backoff() for name in allowed}
        self._begun: dict[str, float] = {}
        self._timers: dict[str, threading.Timer] = {}  # noqa: TID251
        self._ended = False
        self.counts: dict[str, int] = {}
        """How often each process was started again."""

    def allow(self, name: str) -> None:
        """Start this process again when it has failed."""
        self._allowed.setdefault(name, Backoff())

    def note_start(self, name: str) -> None:
        """The process starts now."""
        self._begun[name] = monotonic()

    def take_failure(self, name: str) -> Again:
        """The process has failed: whether and when it is started again."""
        with self._lock:
            backoff = self._allowed.get(name)
            if backoff is None or self._ended:
                return Again()
            again = backoff.take_failure(monotonic() - self._begun.get(name, 0.0))
            if again.delay is not None:
                # Host time: a restart is due at host time, while the launcher waits for the end of the run.
                timer = self._timers[name] = threading.Timer(again.delay, self._again, (name,))  # noqa: TID251
                timer.name, timer.daemon = f"restart {name}", True
                timer.start()
        return again

    def _again(self, name: str) -> None:
        with self._lock:
            if self._timers.pop(name, None) is None:
                return
            self.counts[name] = self.counts.get(name, 0) + 1
            # With the lock: `cancel` returns when what it cancels cannot start any more.
            self._start(name)

    def cancel(self, processes: Iterable[str]) -> None:
        """Do not start these again."""
        with self._lock:
            for name in processes:
                self._allowed.pop(name, None)
                timer = self._timers.pop(name, None)
                if timer is not None:
                    timer.cancel()

    def end(self) -> None:
        """Start nothing any more."""
        with self._lock:
            self._ended = True
        self.cancel([*self._allowed])


def serve_restarts(bus: Bus, counts: Callable[[], dict[str, int]]) -> None:
    """Let the monitor ask how often each process was started again, by name."""
    bus.serve(names.service_key(names.LAUNCHER, names.RESTARTS), NoRequest, lambda _: counts())


def log_failure(name: str, code: int | None, again: Again) -> None:
    """Say that a process has failed, and whether and when it is started again."""
    told = f"{name} ended: {exit_text(code)}"
    if again.delay is not None:
        log.warning("%s; it is started again in %g s (%d of %d)", told, again.delay, again.in_row, len(DELAYS))
    elif again.in_row:
        log.error("%s; it is not started again: it has failed %d times in a row", told, again.in_row)
    else:
        log.error("%s; it is not started again", told)
