"""Lines of processes' logs, and their order in time. Pure."""

import logging
from collections.abc import Sequence

import msgspec

KEPT = 200
"""Lines that a process keeps for the query of its log."""
_REMEMBERED = 10 * KEPT
"""Lines of a process that are known again; a history repeats the newest KEPT of those that came before."""


class LogLine(msgspec.Struct, frozen=True):
    """One line of a process's log. `<name>/log` answers with a list of these; a process logs no two equal ones."""

    time_ns: int
    """The clock of the process's host, since the Unix epoch."""
    process: str
    level: int
    """As in Python and in ROS 2 (zteam.messages.LogLevel)."""
    text: str
    file: str = ""
    function: str = ""
    line: int = 0


def level_name(level: int) -> str:
    """`info` for 20; a level between two has the name of the lower one."""
    known = (logging.CRITICAL, logging.ERROR, logging.WARNING, logging.INFO)
    return logging.getLevelName(next((bound for bound in known if level >= bound), logging.DEBUG)).lower()


class LogOrder:
    """Puts the lines of many processes in order of time, each once. Pure: the caller passes the host's time.

    Lines of different processes arrive a little out of order, so each is held for `hold` seconds. A line that is older
    than one handed out before comes late: it is handed out next.
    """

    def __init__(self, hold: float) -> None:
        self._hold = hold
        self._waiting: list[tuple[LogLine, float]] = []
        """Each with the host time at which it must wait no longer."""
        self._known: dict[str, dict[LogLine, None]] = {}

    def take(self, lines: Sequence[LogLine], now: float) -> None:
        """Lines came at host time `now`; those that are known are skipped."""
        for line in lines:
            known = self._known.setdefault(line.process, {})
            if line not in known:
                known[line] = None
                self._waiting.append((line, now + self._hold))
                if len(known) > _REMEMBERED:
                    del known[next(iter(known))]

    @property
    def waiting(self) -> bool:
        """Whether lines wait."""
        return bool(self._waiting)

    def left(self, now: float) -> float:
        """Seconds until a line is ready; 0 if none waits."""
        return max(0.0, min((until for _, until in self._waiting), default=now) - now)

    def ready(self, now: float) -> list[LogLine]:
        """Hand out the lines that have waited long enough, and all older ones, in order of time."""
        newest = max((line.time_ns for line, until in self._waiting if until <= now), default=None)
        if newest is None:
            return []
        ready = [line for line, _ in self._waiting if line.time_ns <= newest]
        self._waiting = [entry for entry in self._waiting if entry[0].time_ns > newest]
        return sorted(ready, key=lambda line: line.time_ns)
