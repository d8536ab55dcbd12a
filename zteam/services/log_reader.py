"""The logs of processes on the bus: what they keep, and each new line."""

import logging
import threading
from collections.abc import Callable, Sequence

from zteam import names
from zteam.bus import Bus
from zteam.clock import monotonic
from zteam.errors import BusError
from zteam.messages import Log, ns_from_time
from zteam.services.log_lines import LogLine, LogOrder

log = logging.getLogger("zteam")

HOLD = 0.2
"""Host seconds for which a new line waits for older ones of other processes."""


def line_of(process: str, message: Log) -> LogLine:
    """The line in a message of the process's log."""
    stamp = ns_from_time(message.stamp)
    return LogLine(stamp, process, message.level, message.msg, message.file, message.function, message.line)


class LogReader:
    """Lines of the processes whose names match `patterns`, in order of time, each once.

    `on_news()` is called from a thread of the bus when lines or processes came.
    """

    def __init__(self, bus: Bus, patterns: Sequence[str], on_news: Callable[[], None], level: int = 0) -> None:
        """Lines below `level` are skipped."""
        self._bus = bus
        self._patterns = patterns
        self._on_news = on_news
        self._level = level
        self._lock = threading.Lock()
        self._order = LogOrder(HOLD)
        self._joined: set[str] = set()

    def follow(self) -> None:
        """From here on take new lines, and notice processes that join."""
        for pattern in self._patterns:
            self._bus.subscribe(names.log_key(pattern), Log, self._on_line)
            self._bus.watch_tokens([names.tokens_key(pattern)], self._on_token)

    def fetch(self) -> set[str]:
        """Take what all the processes keep; the names of those that answered."""
        return {name for pattern in self._patterns for name in self._fetch(pattern)}

    def fetch_joined(self) -> set[str]:
        """Take what the processes keep that joined since the last call; the names of those that answered."""
        with self._lock:
            joined, self._joined = self._joined, set()
        return {name for pattern in sorted(joined) for name in self._fetch(pattern)}

    def _fetch(self, pattern: str) -> set[str]:
        try:
            answers = self._bus.query(names.log_key(pattern), list[LogLine])
        except BusError as error:
            # Such as a process that is frozen.
            log.debug("%s", error)
            return set()
        for _, lines in answers:
            self._take(lines)
        return {name for key, _ in answers if (name := names.split_log_key(key))}

    def pending(self) -> bool:
        """Whether lines wait, or processes joined."""
        with self._lock:
            return bool(self._joined) or self._order.waiting

    def left(self) -> float:
        """Host seconds until a line is ready; 0 if none waits."""
        with self._lock:
            return self._order.left(monotonic())

    def ready(self, now: float | None = None) -> list[LogLine]:
        """The lines that are ready at host time `now`, by default the present."""
        with self._lock:
            return self._order.ready(monotonic() if now is None else now)

    def _take(self, lines: Sequence[LogLine]) -> None:
        with self._lock:
            self._order.take([line for line in lines if line.level >= self._level], monotonic())

    def _on_line(self, key: str, message: Log) -> None:
        process = names.split_log_key(key)
        if process is not None:
            self._take([line_of(process, message)])
            self._on_news()

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is not None and alive:
            with self._lock:
                self._joined.add(token[0])
            self._on_news()
