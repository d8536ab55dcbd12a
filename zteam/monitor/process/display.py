"""What a user sees of a watched team: its events, and the table with the robots' poses, live on a terminal."""

import logging
import math
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from zteam import names
from zteam.clock import Every, monotonic
from zteam.errors import ZteamError
from zteam.geometry import Pose2
from zteam.monitor.process.members import EventLimit
from zteam.monitor.process.start_gate import Gate
from zteam.monitor.process.table import JsonLines, LiveTable, make_rows, team_notes
from zteam.monitor.process.table import Lines as Lines
from zteam.monitor.process.watch import TeamWatch
from zteam.node.launcher import Restarted
from zteam.node.live_line import LiveLine, has_live_line
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import MonitorOptions
from zteam.transforms.client import Lookup, TransformClient

log = logging.getLogger("zteam")

PERIOD = 1.0
"""Host seconds between two questions."""


class Poses:
    """The robots' newest poses in `map`; a thread of its own asks, so that nothing else waits for the answers."""

    def __init__(self, node: ProcessNode, robots: Callable[[], list[int]]) -> None:
        """`robots()` are the ids to ask for."""
        self._bus = node.bus
        self._client = TransformClient(node.bus)
        self._robots = robots
        self._stop = threading.Event()
        self.newest: dict[int, Pose2] = {}
        """By id; a robot whose pose is not known has none. Replaced as a whole."""
        self.restarts: dict[str, Restarted] = {}
        """The processes that the launcher has started again, by name. Replaced as a whole."""
        node.stop.on_request(self._stop.set)
        threading.Thread(target=self._run, name="poses", daemon=True).start()

    def _run(self) -> None:
        while not self._stop.is_set():
            frames = {i: names.robot_frame(i, names.BASE_FOOTPRINT) for i in self._robots()}
            self.newest = self._client.find_poses({i: Lookup(names.MAP_FRAME, frame) for i, frame in frames.items()})
            answers = self._bus.find(names.service_key(names.LAUNCHER, names.RESTARTS), dict[str, Restarted])
            self.restarts = answers[0][1] if answers else {}
            self._stop.wait(PERIOD)


_event_log = logging.getLogger("zteam.monitor.events")
"""Events in the log on the bus. The monitor shows them itself, so this logger has no output."""
_event_log.propagate = False
_event_log.addHandler(logging.NullHandler())

_TROUBLE = frozenset({"fault", "lost", "silent"})
"""Kinds of events that are warnings."""

LEAVE_AFTER = 5.0
"""`--exit-on-go` waits this long at most for every robot to obey."""
_LIVE_PERIOD = 0.5
"""Host seconds between two drawings of the live table."""
_STATUSES = 1.5
"""Host seconds after which every robot has said its status; before that a table would be empty."""


@contextmanager
def showing(options: MonitorOptions) -> Iterator[Lines]:
    """The output that the options and standard output call for."""
    if options.json:
        yield JsonLines()
    elif options.exit_on_go or not has_live_line(sys.stdout):
        yield Lines()
    else:
        with LiveLine(sys.stdout, keeps=True) as live:
            yield LiveTable(live)


class TeamDisplay:
    """Shows a watched team on an output. The main loop calls it, without `node.changed`."""

    def __init__(self, node: ProcessNode, team: Gate, watch: TeamWatch, options: MonitorOptions, output: Lines) -> None:
        self._node = node
        self._team = team
        self._watch = watch
        self._options = options
        self._output = output
        self._limit = EventLimit()
        self._leave_at: float | None = None
        self._give_up_at = math.inf if options.go_timeout is None else monotonic() + options.go_timeout
        self._nag = Every(5.0)
        self._nag.due()
        self._nagged = ""
        """What the log said last that GO waits for."""
        self._table = Every(_LIVE_PERIOD if output.is_live else options.table or 0.0)
        self._table_from = monotonic() + (0.0 if output.is_live else _STATUSES)
        self._poses = Poses(node, self._robots) if output.is_live or options.table is not None else None
        """None if no table is shown."""

    def _robots(self) -> list[int]:
        with self._node.changed:
            return sorted(i for i, member in self._team.members.items() if member.alive)

    def run(self, decide: Callable[[], None] = lambda: None, has_work: Callable[[], bool] = lambda: False) -> None:
        """Watch and show the team until the process is asked to stop, or with `exit_on_go` until it has left.

        Each round calls `decide()`; the next one begins at once where there are events or `has_work()` is true.
        Raises ZteamError that says what GO waits for after `go_timeout`.
        """
        try:
            while not self._node.stopping:
                self._watch.look()
                decide()
                if self._update():
                    return
                self._node.wait(lambda: self._team.has_events or has_work(), 0.2)
        finally:
            if self._output.is_live:
                self._print_table()

    def _print_table(self) -> None:
        asked = self._poses
        poses, restarts = (asked.newest, asked.restarts) if asked else ({}, {})
        with self._node.changed:
            rows = make_rows(self._team, poses, restarts, monotonic())
            notes = team_notes(self._team, restarts, self._watch.notes())
        # Without the lock: a terminal can be slow, and what is logged under it may wait for the terminal.
        self._output.print_table(rows, notes)

    def _update(self) -> bool:
        """Show what is new. True if the process may leave: GO is out, with `exit_on_go`."""
        with self._node.changed:
            events = self._team.take_events()
            gone, running = self._team.gone, self._team.all_running()
            waiting_for = self._team.waiting_for()
            limited = [self._limit.admit(e, e.robot is None or self._team.counts(e.robot), monotonic()) for e in events]
        for event in filter(None, limited):
            _event_log.log(logging.WARNING if event.kind in _TROUBLE else logging.INFO, "%s", event.sentence)
            self._output.show(event)
        if self._poses and monotonic() >= self._table_from and self._table.due():
            self._print_table()
        if not gone and monotonic() >= self._give_up_at:
            raise ZteamError(f"no GO within {self._options.go_timeout:g} s: waiting for {waiting_for}")
        if gone and self._options.exit_on_go:
            self._leave_at = self._leave_at or monotonic() + LEAVE_AFTER
            return running or monotonic() > self._leave_at
        if not gone and self._poses is None and waiting_for != self._nagged and self._nag.due():
            self._nagged = waiting_for
            log.warning("waiting for %s", waiting_for)
        return False
