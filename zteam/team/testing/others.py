"""Processes that take part in a team under test though the fixture has not started them, such as a node that the test
starts by itself: what they log, and how they are gone."""

import logging
import os
import signal
from collections.abc import Callable, Iterable
from functools import partial
from typing import NamedTuple

from zteam import names
from zteam.bus import Bus
from zteam.bus.presence import find_processes
from zteam.clock import HOST_FACTOR, monotonic
from zteam.messages import Log
from zteam.team.launch.process import exit_text
from zteam.team.testing.view import ObservedTeam

RETURN = 2.5 * HOST_FACTOR
"""Host seconds for a process to be there again whose token is gone: the test may start it again."""
_LAST_LINES = 0.5
"""Host seconds for the last lines of a process that has ended."""
_INFO_LIMIT = 1.0
"""Host seconds for a process to say which one it is."""
_BY_TEST = frozenset({0, -signal.SIGTERM, -signal.SIGINT, -signal.SIGKILL})
"""Exit codes of a process that the test may have ended."""


class Gone(NamedTuple):
    """A process whose name was held and is not any more."""

    name: str
    settled: bool
    """Whether its last lines have come, and whether it stays away."""
    code: int | None
    """The exit code of a child of this process that was not waited for."""
    known: bool
    """Whether it was a child of this process that was waited for: the test knows of its end."""

    def is_failure(self, at_end: bool) -> bool:
        """Whether its end, without an error in its log, is none that the test has asked for.

        The end of a test may just have ended what the test had started.
        """
        return self.settled and not self.known and not (at_end and self.code in _BY_TEST)

    def __str__(self) -> str:
        return f"{self.name} {'is gone' if self.code is None else f'ended ({exit_text(self.code)})'}"


class Others:
    """Those that are watched."""

    def __init__(self, bus: Bus, seen: ObservedTeam, on_line: Callable[[str, str], None]) -> None:
        """`on_line(name, line)` takes what they log."""
        self._bus, self._seen, self._on_line = bus, seen, on_line
        self._watched: set[str] = set()
        self._children: dict[str, int | None] = {}
        """Process ids of those that are there, where they are children of this process."""
        self._gone_since: dict[str, float] = {}
        self._up = True
        bus.watch_link(self._on_link)

    def watch(self, processes: Iterable[str]) -> None:
        """Watch these from here on, which may come later."""
        for name in set(processes) - self._watched:
            self._watched.add(name)
            self._bus.subscribe(names.log_key(name), Log, partial(self._take, name))

    def _take(self, name: str, _key: str, message: Log) -> None:
        level = "" if message.level == logging.INFO else f"{logging.getLevelName(message.level).lower()}: "
        self._on_line(name, f"{level}{message.msg}")

    def _on_link(self, up: bool) -> None:
        self._up = up

    def missing(self) -> set[str]:
        """Those that were never there."""
        return self._watched - self._seen.were_there

    def gone(self) -> list[Gone]:
        """Those that were there and are not. Without the router all would be gone, so none is."""
        if not self._watched or not self._up:
            self._gone_since.clear()
            return []
        found, now = list[Gone](), monotonic()
        for name in sorted(self._watched & self._seen.were_there):
            if not self._seen.alive(name):
                found.append(self._judge(name, now - self._gone_since.setdefault(name, now)))
            elif self._gone_since.pop(name, None) is not None or name not in self._children:
                self._children[name] = self._find_child(name)
        return found

    def _judge(self, name: str, since: float) -> Gone:
        pid = self._children.get(name)
        if pid is None:
            return Gone(name, since > RETURN, None, known=False)
        try:
            ended = os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
        except ChildProcessError:
            return Gone(name, since > _LAST_LINES, None, known=True)
        if ended is None:
            # It has given its name back, and may be about to end.
            return Gone(name, since > RETURN, None, known=False)
        code = ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status
        return Gone(name, since > _LAST_LINES, code, known=False)

    def _find_child(self, name: str) -> int | None:
        """The process id if it is a child of this process."""
        for info in find_processes(self._bus, name, timeout=_INFO_LIMIT):
            try:
                if hasattr(os, "waitid"):
                    os.waitid(os.P_PID, info.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT)
                    return info.pid
            except ChildProcessError:
                continue
        return None
