"""The newest lines of all processes' logs, in order of time. Pure: the caller passes the host's time."""

import itertools
import threading
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

from zteam.clock import NS_PER_S
from zteam.nodes.web.team_document import printable
from zteam.services.logs import HOLD, LogLine, LogOrder, level_name

KEPT = 1000


class Line(NamedTuple):
    """As the page gets it."""

    time: float
    """Seconds since the Unix epoch."""
    process: str
    level: str
    text: str


class LogTail:
    """Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._order = LogOrder(HOLD)
        self._numbers = itertools.count(1)
        self._lines: deque[tuple[int, Line]] = deque(maxlen=KEPT)

    def take(self, lines: Iterable[LogLine], now: float) -> None:
        """Lines came."""
        with self._lock:
            self._order.take(list(lines), now)

    def since(self, number: int, now: float) -> tuple[int, list[Line]]:
        """The lines after the one with this number, and the number of the last one."""
        with self._lock:
            for line in self._order.ready(now):
                shown = Line(line.time_ns / NS_PER_S, line.process, level_name(line.level), printable(line.text))
                self._lines.append((next(self._numbers), shown))
            found = [(n, line) for n, line in self._lines if n > number]
        return (found[-1][0] if found else number), [line for _, line in found]
