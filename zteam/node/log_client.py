"""The logs of processes on the bus: what they keep, and each new line."""

import logging
import math
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence

import msgspec

from zteam import names
from zteam.bus import Bus, NoRequest
from zteam.clock import monotonic
from zteam.messages import Log, ns_from_time, time_from_ns
from zteam.node.logs import KEEPER, KEPT, LogLine

HOLD = 0.2
"""Host seconds for which a new line waits for older ones of other processes."""
_LINES = list[LogLine]
_MOST_ASKED = 16
"""Processes that have joined and are asked one by one: any program may hold tokens, of any names."""
_REMEMBERED = 10 * KEPT
"""Lines of a process that are known again; a history repeats the newest KEPT of those that came before."""
_PROCESSES = 1000
"""Processes whose lines are known again."""


def kept_lines(answers: Iterable[tuple[str, Sequence[LogLine]]]) -> Iterator[LogLine]:
    """The lines in the answers to queries of logs. A line is of the process whose key it came on, whatever it says."""
    for key, lines in answers:
        process = names.process_of(key, names.LOG)
        if process is not None:
            yield from (msgspec.structs.replace(line, process=process) for line in lines)


def level_name(level: int) -> str:
    """`info` for 20; a level between two has the name of the lower one."""
    return logging.getLevelName(max(logging.DEBUG, min(level // 10 * 10, logging.CRITICAL))).lower()


class LogOrder:
    """Puts the lines of many processes in order of time, each once. The caller passes the host's time. Thread-safe.

    Lines of different processes arrive a little out of order, so each is held for `hold` seconds. A line that is older
    than one handed out before comes late: it is handed out next.
    """

    def __init__(self, hold: float) -> None:
        self._hold = hold
        self._lock = threading.Lock()
        self._waiting: list[tuple[LogLine, float]] = []
        """Each with the host time at which it must wait no longer."""
        self._known: dict[str, dict[LogLine, None]] = {}

    def take(self, lines: Sequence[LogLine], now: float) -> None:
        """Lines came at host time `now`; those that are known are skipped."""
        with self._lock:
            for line in map(LogLine.cut, lines):
                known = self._known.setdefault(line.process, {})
                if line not in known:
                    known[line] = None
                    self._waiting.append((line, now + self._hold))
                if len(known) > _REMEMBERED:
                    del known[next(iter(known))]
                if len(self._known) > _PROCESSES:
                    del self._known[next(iter(self._known))]

    @property
    def waiting(self) -> bool:
        return bool(self._waiting)

    def left(self, now: float) -> float:
        """Seconds until a line is ready; 0 if none waits."""
        return max(0.0, min((until for _, until in self._waiting), default=now) - now)

    def ready(self, now: float) -> list[LogLine]:
        """Hand out the lines that have waited long enough, and all older ones, in order of time."""
        with self._lock:
            newest = max((line.time_ns for line, until in self._waiting if until <= now), default=-math.inf)
            ready = [line for line, _ in self._waiting if line.time_ns <= newest]
            self._waiting = [entry for entry in self._waiting if entry[0].time_ns > newest]
        return sorted(ready, key=lambda line: line.time_ns)


class LogPublisher:
    """The log of this process on the bus: `<name>/log` carries new lines, and the query of that key the newest ones."""

    def __init__(self, bus: Bus, name: str) -> None:
        self._name = name
        self._publisher = bus.publisher(names.log_key(name), Log)
        self._sent = float("inf")
        """Stamp (ns) of the first line that was sent; 0 once those before it were sent, too."""
        self._server = bus.serve(names.log_key(name), NoRequest, lambda _: KEEPER.kept(name))
        self._forget = KEEPER.pass_to(self._send)

    def close(self) -> None:
        """Publish and answer nothing more; also after the end of the session."""
        self._forget()
        self._server.close()
        self._publisher.close()

    def catch_up(self) -> None:
        """Send the lines from before the first one that was sent, to the subscribers that are there; once.

        A process that ends soon after its start may be gone before a reader asks it.
        """
        before, self._sent = self._sent, 0
        for line in KEEPER.kept(self._name):
            if line.time_ns < before:
                self._send(line)

    def _send(self, line: LogLine) -> None:
        if line.process in ("", self._name) and self._publisher.has_subscribers:
            self._sent = min(self._sent, line.time_ns)
            self._publisher.put(message_of(self._name, line))


def message_of(process: str, line: LogLine) -> Log:
    """The message of a line; its stamp is the host's time."""
    return Log(time_from_ns(line.time_ns), line.level, process, line.text, line.file, line.function, line.line)


def line_of(process: str, message: Log) -> LogLine:
    """The line in a message of the process's log."""
    stamp = ns_from_time(message.stamp)
    return LogLine(stamp, process, message.level, message.msg, message.file, message.function, message.line)


class LogReader(LogOrder):
    """Lines of the processes whose names match `patterns`, in order of time, each once.

    `on_news()` is called from a thread of the bus when lines or processes came.
    """

    def __init__(self, bus: Bus, patterns: Sequence[str], on_news: Callable[[], None], level: int = 0) -> None:
        """Lines below `level` are skipped."""
        super().__init__(HOLD)
        self._bus, self._patterns, self._on_news, self._level = bus, patterns, on_news, level
        self._joined: set[str] = set()
        """Processes that have joined since the last question."""

    def follow(self) -> None:
        """From here on take new lines, and notice processes that join."""
        for pattern in self._patterns:
            self._bus.subscribe(names.log_key(pattern), Log, self._on_line)
            self._bus.watch_tokens([names.tokens_key(pattern)], self._on_token)

    def fetch(self) -> set[str]:
        """Take what all the processes keep; the names of those that answered."""
        self._joined.clear()
        return self._ask(self._patterns)

    def fetch_joined(self) -> set[str]:
        """Take what the processes keep that have joined since the last call; the names of those that answered."""
        joined, self._joined = self._joined, set()
        return self._ask(sorted(joined) if len(joined) <= _MOST_ASKED else self._patterns)

    def _ask(self, patterns: Iterable[str]) -> set[str]:
        answers = [answer for pattern in patterns for answer in self._bus.find(names.log_key(pattern), _LINES)]
        self._take(kept_lines(answers))
        return {name for key, _ in answers if (name := names.process_of(key, names.LOG))}

    def pending(self) -> bool:
        """Whether lines wait, or processes joined."""
        return bool(self._joined) or self.waiting

    def _take(self, lines: Iterable[LogLine]) -> None:
        self.take([line for line in lines if line.level >= self._level], monotonic())

    def _on_line(self, key: str, message: Log) -> None:
        process = names.process_of(key, names.LOG)
        if process is not None:
            self._take([line_of(process, message)])
            self._on_news()

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if alive and token is not None:
            self._joined.add(token[0])
            self._on_news()
