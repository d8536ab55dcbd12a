"""What a user sees of a watched team: events as lines or JSON, and the table, live on a terminal."""

import logging
import math
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol

import msgspec

from zteam import names
from zteam.clock import Every, monotonic
from zteam.errors import ZteamError
from zteam.nodes.monitor.members import Event
from zteam.nodes.monitor.poses import Poses
from zteam.nodes.monitor.table import Line, Row, format_table, make_rows, team_notes
from zteam.nodes.monitor.team import Team
from zteam.nodes.monitor.team_watch import TeamWatch
from zteam.process_options import MonitorOptions
from zteam.runtime.process_node import ProcessNode

log = logging.getLogger("zteam")
_event_log = logging.getLogger("zteam.monitor.events")
"""Events in the log on the bus. The monitor shows them itself, so this logger has no output."""
_event_log.propagate = False
_event_log.addHandler(logging.NullHandler())

_TROUBLE = frozenset({"fault", "lost", "silent"})
"""Kinds of events that are warnings."""

LEAVE_AFTER = 5.0
"""`--exit-on-go` waits this long at most for every robot to obey."""
_PIPE_WIDTH = 80
"""Characters of a line of the table where there is no terminal."""
_LIVE_PERIOD = 0.5
"""Host seconds between two drawings of the live table."""
_STATUSES = 1.5
"""Host seconds after which every robot has said its status; before that a table would be empty."""

Contents = Callable[[], tuple[list[Row], list[str]]]
"""The rows of the table and the notes below it, as they are now."""


def sentence(event: Event) -> str:
    """An event as a line for a user."""
    subject = "" if event.robot is None else f"{names.robot_name(event.robot)} "
    return f"{subject}{event.text}"


class Output(Protocol):
    """Where events and tables go."""

    is_live: bool
    """Whether the table is always in sight; otherwise it is shown when the options ask for it."""

    def show(self, event: Event) -> None:
        """Show an event."""
        ...

    def watch(self, contents: Contents) -> None:
        """From now on these are the contents of the table."""
        ...

    def print_table(self) -> None:
        """Show the table as it is now."""
        ...


def _print(text: str) -> None:
    print(text, flush=True)  # noqa: T201


class Lines:
    """Lines of text, on standard output unless `write` has another place for them."""

    is_live = False
    _contents: Contents

    def __init__(self, write: Callable[[str], None] = _print) -> None:
        self._write = write

    def show(self, event: Event) -> None:
        """Print one line for a user."""
        self._write(sentence(event))

    def watch(self, contents: Contents) -> None:
        """From now on these are the contents of the table."""
        self._contents = contents

    def print_table(self) -> None:
        """Print the table."""
        lines: list[Line] = format_table(*self._contents(), _PIPE_WIDTH)
        self._write("\n".join(line.text for line in lines))


class JsonLines(Lines):
    """One JSON object a line."""

    def show(self, event: Event) -> None:
        """Print {"event", "robot" (or null), "text"}."""
        line = {"event": event.kind, "robot": event.robot, "text": event.text}
        self._write(msgspec.json.encode(line).decode())

    def print_table(self) -> None:
        """Print {"event": "table", "robots": [one object a robot], "text": what stands below the table}."""
        rows, notes = self._contents()
        line = {"event": "table", "robot": None, "text": "; ".join(notes), "robots": rows}
        self._write(msgspec.json.encode(line).decode())


Showing = Callable[[MonitorOptions], AbstractContextManager[Output]]


@contextmanager
def showing(options: MonitorOptions) -> Iterator[Output]:
    """The output that the options and standard output call for."""
    if options.json:
        yield JsonLines()
    elif not sys.stdout.isatty() or os.environ.get("TERM", "dumb") == "dumb" or options.exit_on_go:
        yield Lines()
    else:
        from zteam.nodes.monitor.live_table import LiveTable

        with LiveTable() as table:
            yield table


class Display:
    """Shows a watched team on an output. The main loop calls it, without `node.changed`."""

    def __init__(
        self, node: ProcessNode, team: Team, watch: TeamWatch, options: MonitorOptions, output: Output
    ) -> None:
        self._node = node
        self._team = team
        self._watch = watch
        self._options = options
        self._output = output
        self._leave_at: float | None = None
        self._give_up_at = math.inf if options.go_timeout is None else monotonic() + options.go_timeout
        self._nag = Every(5.0)
        self._nag.due()
        self._poses: Poses | None = None
        self._table = Every(_LIVE_PERIOD if output.is_live else options.table or 0.0)
        self._table_from = monotonic() + _STATUSES
        if options.table is not None or output.is_live:
            self._poses = Poses(node, self._robots)
        output.watch(self._contents)

    def _robots(self) -> list[int]:
        with self._node.changed:
            return sorted(i for i, member in self._team.members.by_id.items() if member.alive)

    def _contents(self) -> tuple[list[Row], list[str]]:
        asked = self._poses
        poses, restarts = (asked.newest, asked.restarts) if asked else ({}, {})
        with self._node.changed:
            rows = make_rows(self._team, poses, restarts, monotonic())
            return rows, team_notes(self._team, restarts, self._watch.notes())

    def _is_table_due(self) -> bool:
        if self._output.is_live:
            return self._table.due()
        return self._options.table is not None and monotonic() >= self._table_from and self._table.due()

    def update(self) -> bool:
        """Show what is new. True if the process may leave: GO is out, with `exit_on_go`.

        Raises ZteamError that says what GO waits for after `go_timeout`.
        """
        with self._node.changed:
            events = self._team.members.take_events()
            gone, running = self._team.gone, self._team.all_running()
            waiting_for = self._team.waiting_for()
        for event in events:
            # Without the lock: a terminal can be slow.
            _event_log.log(logging.WARNING if event.kind in _TROUBLE else logging.INFO, "%s", sentence(event))
            self._output.show(event)
        if self._is_table_due():
            self._output.print_table()
        if not gone and monotonic() >= self._give_up_at:
            raise ZteamError(f"no GO within {self._options.go_timeout:g} s: waiting for {waiting_for}")
        if gone and self._options.exit_on_go:
            self._leave_at = self._leave_at or monotonic() + LEAVE_AFTER
            return running or monotonic() > self._leave_at
        if not gone and not self._output.is_live and self._nag.due():
            log.warning("waiting for %s", waiting_for)
        return False
