"""What a user sees of a watched team: its events, and the table of its robots, as lines of text or JSON, live on a
terminal.
"""

import logging
import math
import sys
import textwrap
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import msgspec

from zteam import names
from zteam.clock import Every, monotonic
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import ZteamError, log, printable, short
from zteam.geometry import Pose2
from zteam.messages import RobotDriver, RobotState
from zteam.monitor.process.start_gate import SILENT_AFTER, Event, EventLimit, Gate, KnownRobot
from zteam.monitor.process.watch import TeamWatch
from zteam.node.launcher import Restarted, restarts_text
from zteam.node.live_line import LiveLine, has_live_line
from zteam.node.output import painted, print_block, print_json
from zteam.node.process_node import ProcessNode
from zteam.node.process_options import MonitorOptions
from zteam.node.stopping import STOPPED
from zteam.transforms.client import Lookup, TransformClient

_PIPE_WIDTH = 80
"""Characters of a line of the table where there is no terminal."""
_HEAD = ("robot", "state", "behaviour", "x", "y", "yaw", "m/s", "age")
_LEFT = 3
"""Columns of text; the others are numbers."""
_BEHAVIOR_WIDTH = 20
_GAP = 2
_COLORS: Mapping[str, int | str] = {
    "ready": 36, "running": 32, "stopped": 33, "fault": 31, "lost": "1;31", "silent": 31, "boot": 37, "absent": 2,
}  # fmt: skip
"""Of ECMA-48, by the state."""
_EVENTS: Mapping[str, int | str] = {"go": "1;32", "lost": "1;31", "fault": 31, "silent": 31, "link": 33, "process": 31}
"""Colours of ECMA-48, by the kind of event; others have none."""


class Row(msgspec.Struct):
    robot: str
    state: str
    """A state of its own (`RobotState`), or `lost`, `silent`, `absent`, which the monitor sees."""
    behavior: str = ""
    pose: Pose2 | None = None
    """Metres and radians in `map`."""
    speed: float | None = None
    """Of its newest command, m/s."""
    age: float | None = None
    """Host seconds since its newest status."""
    reason: str = ""
    """Why it stands, or is not there."""
    restarts: int = 0
    """How often its process was started again."""
    is_stopped: bool = False
    """Whether `zteam stop` holds it."""


def make_rows(team: Gate, poses: Mapping[int, Pose2], restarts: Mapping[str, Restarted], now: float) -> list[Row]:
    """The robots at host time `now`; `restarts` by the process's name. The caller holds the team's lock."""
    rows = []
    for robot_id, member in sorted(team.members.items()):
        name, status = names.robot_name(robot_id), member.status
        drives, quiet = status is not None and status.state == RobotState.RUNNING, now - member.moved
        lack = f"no data for {quiet:.0f} s" if drives and quiet > SILENT_AFTER and not team.ticks(now) else ""
        row = Row(name, _state(member), pose=poses.get(robot_id), reason=_reason(member, lack))
        row.restarts = restarts[name].count if name in restarts else 0
        if status is not None:
            row.behavior = short(_behavior(status.behavior, status.followed, status.driver))
            row.age = now - member.heard
            # Without data its speed is an old one.
            row.speed = None if lack or member.silent else status.speed
            row.is_stopped = _is_held(member) and not member.silent
        rows.append(row)
    return rows


def _is_held(member: KnownRobot) -> bool:
    return member.alive and member.status is not None and member.status.is_stopped


def _reason(member: KnownRobot, lack: str) -> str:
    """Why it stands, or is not there; `lack` says that it gets no data."""
    status = member.status
    if status is None or member.silent:
        return member.why_not_ready
    if _is_held(member):
        return STOPPED
    if status.state == RobotState.READY:
        # What GO waits for stands below the table.
        return ""
    # A robot of an older version says only in its text why it does not drive.
    reason = status.reason or ("" if status.state == RobotState.RUNNING else status.text)
    return lack or short((member.absence or reason) if reason else "")


def _state(member: KnownRobot) -> str:
    if member.was_lost:
        return "stopped" if member.stopped else "lost"
    if member.silent:
        return "silent"
    return "absent" if member.status is None else RobotState.TEXT[min(member.status.state, RobotState.FAULT)]


def _behavior(behavior: str, leader: int, driver: str) -> str:
    text = behavior if leader < 0 else f"{behavior} {names.robot_name(leader)}"
    return text if driver in (RobotDriver.BEHAVIOR, RobotDriver.NONE, "") else f"{driver} ({text})"


def format_table(rows: Sequence[Row], notes: Sequence[str], width: int) -> list[tuple[str, str]]:
    """The table in lines of at most `width` characters, each with the state in it; `notes` stand below it."""
    cells = [_HEAD, *(_cells(row) for row in rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    form = (" " * _GAP).join(f"{{:{'<' if column < _LEFT else '>'}{size}}}" for column, size in enumerate(widths))
    head, *texts = (form.format(*line).rstrip() for line in cells)
    lines = [(head, "")]
    for row, text in zip(rows, texts, strict=True):
        whole = f"{text}{' ' * _GAP}{row.reason}" if row.reason else text
        fits = len(whole) <= width
        lines.append((whole if fits else text, row.state))
        lines += [(part, "") for part in _wrap("" if fits else row.reason, width, " " * (widths[0] + _GAP))]
    return lines + [(part, "") for note in notes for part in _wrap(short(note, 10_000), width, "")]


def _cells(row: Row) -> tuple[str, ...]:
    pose = ("-", "-", "-") if row.pose is None else tuple(f"{value:.2f}" for value in row.pose)
    behavior = row.behavior if len(row.behavior) <= _BEHAVIOR_WIDTH else row.behavior[: _BEHAVIOR_WIDTH - 1] + "…"
    speed = "-" if row.speed is None else f"{row.speed:.2f}"
    return row.robot, row.state, behavior or "-", *pose, speed, "-" if row.age is None else f"{row.age:.1f} s"


def _wrap(text: str, width: int, indent: str) -> list[str]:
    return textwrap.wrap(text, max(width, len(indent) + 20), initial_indent=indent, subsequent_indent=indent)


def team_notes(team: Gate, restarts: Mapping[str, Restarted], problems: Sequence[str]) -> list[str]:
    """The lines below the table: GO, or what it waits for, processes started again, robots that are stopped, and what
    else is wrong."""
    told = [restarts_text(restarts)] if restarts else []
    held = [i for i, member in team.members.items() if _is_held(member)]
    told += [f"robot{'s' * (len(held) > 1)} {format_robot_ids(held)}: {STOPPED}"] if held else []
    return ["GO is out" if team.gone else f"waiting for {team.waiting_for(reasons=False)}", *told, *problems]


class Lines:
    """Where events and tables go: lines of text, on standard output unless `write` has another place for them."""

    is_live = False
    """Whether the table is always in sight; otherwise it is shown when the options ask for it."""

    def __init__(self, write: Callable[[str], None] = print_block) -> None:
        self._write = write

    def show(self, event: Event) -> None:
        self._write(printable(event.sentence))

    def print_table(self, rows: Sequence[Row], notes: Sequence[str]) -> None:
        self._write("\n".join(text for text, _ in format_table(rows, notes, _PIPE_WIDTH)))


class JsonLines(Lines):
    """One JSON object a line."""

    def show(self, event: Event) -> None:
        """Print {"event", "robot" (or null), "text"}."""
        print_json({"event": event.kind, "robot": event.robot, "text": event.text})

    def print_table(self, rows: Sequence[Row], notes: Sequence[str]) -> None:
        """Print {"event": "table", "robots": [one object a robot], "text": what stands below the table}."""
        print_json({"event": "table", "robot": None, "text": "; ".join(notes), "robots": rows})


class LiveTable(Lines):
    """Events as lines of a terminal, and below them the table as it was when it was drawn last."""

    is_live = True

    def __init__(self, live: LiveLine) -> None:
        super().__init__(live.print)
        self._live = live

    def show(self, event: Event) -> None:
        color = _EVENTS.get(event.kind, 0)
        self._write(painted(event.sentence, color) if self._live.has_color else event.sentence)

    def print_table(self, rows: Sequence[Row], notes: Sequence[str]) -> None:
        lines = format_table(rows, notes, self._live.size().columns)

        def paint(number: int, text: str) -> str:
            if not number:
                return painted(text, 1)
            _, state = lines[number]
            begin, shown, end = text.partition(state) if state else (text, "", "")
            return f"{begin}{painted(shown, _COLORS.get(state, 0)) if shown else ''}{end}"

        self._live.show("\n".join(text for text, _ in lines), paint)


PERIOD = 1.0
"""Host seconds between two questions."""


class Poses:
    """The robots' newest poses in `map`; a thread of its own asks, so that nothing else waits for the answers."""

    def __init__(self, node: ProcessNode, robots: Callable[[], list[int]]) -> None:
        """`robots()` are the ids to ask for."""
        self._bus, self._client, self._robots = node.bus, TransformClient(node.bus), robots
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
        self._node, self._team, self._watch, self._options, self._output = node, team, watch, options, output
        self._limit = EventLimit()
        self._leave_at: float | None = None
        self._give_up_at = math.inf if options.go_timeout is None else monotonic() + options.go_timeout
        self._nag = Every(5.0, after=5.0)
        self._nagged = ""
        """What the log said last that GO waits for."""
        self._table = Every(_LIVE_PERIOD) if output.is_live else Every(options.table or 0.0, after=_STATUSES)
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
                self._node.wait(lambda: bool(self._team.events) or has_work(), 0.2)
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
        if self._poses and self._table.due():
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
