"""Processes that take part in a team under test though the fixture has not started them, such as a node that the test
starts by itself: what they log, and which of them are gone."""

import logging
from collections.abc import Callable, Iterable
from functools import partial

from zteam import names
from zteam.bus import Bus
from zteam.clock import monotonic
from zteam.messages import Log
from zteam.monitor.observer import TeamObserver
from zteam.node.faults import log_fault


class Others:
    """Those that are watched."""

    def __init__(
        self,
        bus: Bus,
        seen: TeamObserver,
        take_log: Callable[[str, int, str], None],
        not_awaited: Callable[[], set[str]],
    ) -> None:
        """`take_log(name, level, text)`: a process has logged that. `not_awaited()` are the processes that may end, or
        that the fixture has started itself."""
        self._bus, self._seen, self._take_log, self._not_awaited = bus, seen, take_log, not_awaited
        self._watched: set[str] = set()
        self.expected: set[str] = set()
        """Those that the test has named."""
        self._gone_since: dict[str, float] = {}
        self._faults: dict[str, str] = {}
        """The critical lines of those that an error has ended."""

    def watch(self, processes: Iterable[str], *, expected: bool) -> None:
        """Watch these from here on, which may come later if they are `expected`."""
        if expected:
            self.expected.update(processes)
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

    def gone(self) -> dict[str, float]:
        """Those that must not end, were there and are not, and for how many host seconds. Without the router all would
        be gone, so none is."""
        gone = self._watched & self._seen.were_there - self._not_awaited() if self._seen.link_up else set[str]()
        now, gone = monotonic(), {name for name in gone if not self._seen.alive(name)}
        self._gone_since = {name: self._gone_since.get(name, now) for name in sorted(gone)}
        return {name: now - since for name, since in self._gone_since.items()}
