"""Processes that take part in a team under test though the fixture has not started them, such as a node that the test
starts itself: what they log, and whether they are gone."""

import logging
from collections.abc import Callable, Iterable
from functools import partial

from zteam import names
from zteam.bus import Bus
from zteam.clock import HOST_FACTOR, monotonic
from zteam.messages import Log
from zteam.team.testing.view import ObservedTeam

RETURN = 2.5 * HOST_FACTOR
"""Host seconds for a process to be there again whose token is gone: the router may have been started again."""


class Others:
    """Those that are watched. Any number of threads may ask."""

    def __init__(self, bus: Bus, seen: ObservedTeam, on_line: Callable[[str, str], None]) -> None:
        """`on_line(name, line)` takes what they log."""
        self._bus, self._seen, self._on_line = bus, seen, on_line
        self._watched: set[str] = set()
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

    def gone(self) -> set[str]:
        """Those that were there and are not. Without the router all would be gone, so none is."""
        return {name for name in self._watched & self._seen.were_there if self._up and not self._seen.alive(name)}

    def lost(self) -> set[str]:
        """Those that are gone for good: for RETURN host seconds with the link up, in which this was called."""
        gone, now = self.gone(), monotonic()
        self._gone_since = {name: self._gone_since.get(name, now) for name in gone}
        return {name for name, since in self._gone_since.items() if now - since > RETURN}
