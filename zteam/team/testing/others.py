"""Processes that take part in a team under test though the fixture has not started them, such as a node that the test
starts by itself: what they log, and how they are gone."""

import logging
import os
import signal
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from typing import NamedTuple

from zteam import names
from zteam.bus import Bus
from zteam.bus.presence import find_processes
from zteam.clock import HOST_FACTOR, monotonic
from zteam.messages import Log
from zteam.monitor.observer import TeamObserver
from zteam.node.faults import log_fault
from zteam.team.launch.process import exit_text

RETURN = 2.5 * HOST_FACTOR
"""Host seconds for a process to be there again whose token is gone: the test may start it again."""
_LAST_LINES = 0.5
"""Host seconds for the last lines of a process that has ended."""
_INFO_LIMIT = 1.0
"""Host seconds for a process to say which one it is."""
_LOOK = os.WEXITED | os.WNOHANG | os.WNOWAIT if hasattr(os, "waitid") else 0
"""Whether a child has ended, which stays to be waited for; 0 where the system cannot tell."""
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
    """Whether it was a child of this process that was waited for, so that the test knows of its end; or is not known to
    be none, and not expected: a program without zteam does not say which process it is."""

    def is_failure(self, at_end: bool) -> bool:
        """Whether its end, without an error in its log, is none that the test has asked for.

        The end of a test may just have ended what the test had started.
        """
        return self.settled and not self.known and not (at_end and self.code in _BY_TEST)

    def __str__(self) -> str:
        return f"{self.name} {'is gone' if self.code is None else f'ended ({exit_text(self.code)})'}"


class Others:
    """Those that are watched."""

    def __init__(
        self,
        bus: Bus,
        seen: TeamObserver,
        take_log: Callable[[str, int, str], None],
        not_awaited: Callable[[], set[str]],
        own_pids: Callable[[], set[int]],
    ) -> None:
        """`take_log(name, level, text)`: a process has logged that. `not_awaited()` are the processes that may end, or
        that the fixture has started itself; `own_pids()` are those of the children of this process that it has started.
        """
        self._bus, self._seen = bus, seen
        self._take_log, self._not_awaited, self._own_pids = take_log, not_awaited, own_pids
        self._watched: set[str] = set()
        self._expected: set[str] = set()
        self._children: dict[str, int | None] = {}
        """Process ids of those that are there, where they are children of this process; 0 = it is none, None = it does
        not say."""
        self._gone_since: dict[str, float] = {}
        self._child = _find_ended_child(), monotonic()
        """The first child of this process that has ended and was not waited for, and since when; (0, 0) for none."""
        self._left = self._child[0]
        """That of a test before."""
        self._faults: dict[str, str] = {}
        """The critical lines of those that an error has ended."""

    def watch(self, processes: Iterable[str], *, expected: bool) -> None:
        """Watch these from here on, which may come later if they are `expected`."""
        if expected:
            self._expected.update(processes)
        for name in set(processes) - self._watched - self._not_awaited():
            self._watched.add(name)
            self._bus.subscribe(names.log_key(name), Log, partial(self._take, name))

    def _take(self, name: str, _key: str, message: Log) -> None:
        if message.level >= logging.CRITICAL and message.function == log_fault.__name__:
            self._faults[name] = message.msg
        self._take_log(name, message.level, message.msg)

    def fault(self, name: str) -> str:
        """The error that ended one, as it has logged it; empty if there is none."""
        return self._faults.get(name, "").partition("\n")[2]

    def missing(self) -> list[str]:
        """Those that must not end and were never there."""
        return sorted(self._watched - self._seen.were_there - self._not_awaited())

    def ended_child(self) -> str:
        """How a child of this process failed; empty if none did. Which name it would have held is not known."""
        found, now = _find_ended_child(), monotonic()
        if found != self._child[0]:
            self._child = found, now
        (pid, code), since = self._child
        # Those of the fixture are waited for at once.
        is_news = code and found != self._left and pid not in self._own_pids() and now - since > _LAST_LINES
        return f"process {pid}, which the test has started, ended ({exit_text(code)})" if is_news else ""

    def gone(self) -> list[Gone]:
        """Those that must not end, were there and are not. Without the router all would be gone, so none is."""
        if not self._watched or not self._seen.link_up:
            self._gone_since.clear()
            return []
        found, now = list[Gone](), monotonic()
        for name in sorted((self._watched & self._seen.were_there) - self._not_awaited()):
            if not self._seen.alive(name):
                found.append(self._judge(name, now - self._gone_since.setdefault(name, now)))
            elif self._gone_since.pop(name, None) is not None or name not in self._children:
                self._children[name] = self._find_child(name)
        return found

    def _judge(self, name: str, since: float) -> Gone:
        pid = self._children.get(name)
        if not pid:
            may_be_gone = pid is None and name not in self._expected
            return Gone(name, may_be_gone or since > RETURN, None, known=may_be_gone)
        try:
            ended = os.waitid(os.P_PID, pid, _LOOK)
        except ChildProcessError:
            return Gone(name, since > _LAST_LINES, None, known=True)
        if ended is None:
            # It has given its name back, and may be about to end.
            return Gone(name, since > RETURN, None, known=False)
        return Gone(name, since > _LAST_LINES, _exit_code(ended), known=False)

    def _find_child(self, name: str) -> int | None:
        """As `_children` has it."""
        found = None
        for info in find_processes(self._bus, name, timeout=_INFO_LIMIT):
            found = 0
            with suppress(ChildProcessError):
                if _LOOK:
                    os.waitid(os.P_PID, info.pid, _LOOK)
                    return info.pid
        return found


def _exit_code(ended: os.waitid_result) -> int:
    return ended.si_status if ended.si_code == os.CLD_EXITED else -ended.si_status


def _find_ended_child() -> tuple[int, int]:
    """Process id and exit code of a child of this process that was not waited for; (0, 0) if there is none."""
    try:
        ended = os.waitid(os.P_ALL, 0, _LOOK) if _LOOK else None
    except ChildProcessError:
        return 0, 0
    return (0, 0) if ended is None else (ended.si_pid, _exit_code(ended))
