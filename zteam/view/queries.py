"""What a view asks the team for instead of subscribing to it: the simulator's state, presence, keys and their rates,
and what the doctor finds.
"""

import threading
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import closing, suppress
from typing import Any, TypeVar

import msgspec

from zteam import names
from zteam.bus import BusOptions, Change
from zteam.bus.connection import connect
from zteam.bus.graph import KeyRow, find_rows
from zteam.bus.transport import Declaration
from zteam.clock import Every, monotonic, to_seconds, wall_ns
from zteam.errors import BusError, ZteamError, log
from zteam.messages import RobotStatus
from zteam.monitor.doctor.examination import examine
from zteam.monitor.doctor.facts import Finding
from zteam.monitor.observer import LINK, PRESENCE, TeamObserver
from zteam.node.log_client import kept_lines
from zteam.node.logs import LogLine
from zteam.node.process_node import ProcessNode
from zteam.record.client import ReplayClient, ReplayStatus
from zteam.robot.client import DESCRIBE, DescribeReply, find_lists
from zteam.simulator.client import ObstaclesReply, ShapesReply, SimStatus, find_status
from zteam.transforms import FrameInfo
from zteam.transforms.client import BundleReply, find_frames
from zteam.view.received import Received


def topic_row(row: KeyRow) -> dict[str, Any]:
    """A topic as the page's list has it; without a rate if nothing came on it during the survey."""
    hz = round(row.rate, 1 if row.count > 1 else 0) if row.count else None
    publishers, subscribers = len(row.publishers), len(row.subscribers)
    return {"key": row.key, "type": row.type, "hz": hz, "publishers": publishers, "subscribers": subscribers}


T = TypeVar("T")

ASK_PERIOD, REPLAY_PERIOD = 0.5, 0.25
"""Host seconds between two looks at the simulator while a page is open; the second one while a recording is shown."""
KEYS_PERIOD = 2.0
"""Host seconds between two looks at which keys there are."""
SURVEY_PERIOD = 5.0
"""Host seconds between two surveys of all topics. During one each topic has a subscriber more, which publishers see."""
PATIENCE = 1.0


class TeamQueries:
    """`ask` is called on a thread of its own, which may wait for answers. What it finds is replaced as a whole."""

    def __init__(self, node: ProcessNode, received: Received, on_news: Callable[[], None]) -> None:
        self._bus, self._received, self._on_news = node.bus, received, on_news
        self.team = TeamObserver(self._bus)
        self.alive, self.names = self.team.alive, self.team.process_names
        self._is_wanted = False
        self.replay: ReplayStatus | None = None
        """The recording that is played instead of a team; None without one."""
        self._replay, self._turn = ReplayClient(self._bus), threading.Lock()
        """The lock is for one change at a time: what is asked for again must not undo a jump."""
        self.sim: SimStatus | None = None
        self.shapes: ShapesReply | None = None
        self.obstacles: ObstaclesReply | None = None
        self._shapes_of: Any = None
        self.declarations: list[Declaration] = []
        """Of the other sessions."""
        self.topics: list[dict[str, Any]] | None = None
        """None before the first look."""
        self._survey_due, self._surveys = Every(SURVEY_PERIOD), False
        self.last_world = ""
        """That of the newest simulator; empty where none was here."""
        self.refused: list[str] | None = None
        """Those of the grants `goals` and `teleop` that this process lacks; None before it was asked."""
        self.frames: dict[str, FrameInfo] = {}
        """Of the aggregator: which process says where each frame is, and in which one."""
        self._keys_due, self._frames_due = Every(KEYS_PERIOD), Every(KEYS_PERIOD)
        self.lists: dict[int, bool] = {}
        """By robot that drives through a list of goals: whether the list is paused."""
        self.parameters: dict[int, DescribeReply] = {}
        """Of the robots that are inspected, those that answer."""
        self.kept_log: list[LogLine] | None = None
        """What the processes kept of their logs when a page began to show them; None before they were asked."""
        self._has_log = False
        self._opened = 0
        self._begun = 0.0
        """Host time at which the first page came."""
        for event in (LINK, PRESENCE, names.STATUS, names.TEAM_STATUS):
            self.team.on(event, lambda *_: on_news())

    def watch(self, wanted: bool) -> None:
        """Whether some page is open."""
        if wanted and not self._is_wanted:
            self._begun = monotonic()
        (self.team.observe if wanted else self.team.ignore)(names.STATUS, names.TEAM_STATUS)
        self._is_wanted, self.sim = wanted, self.sim if wanted else None
        self.replay = self.replay if wanted else None

    @property
    def period(self) -> float:
        """Host seconds between two calls of `ask`."""
        return REPLAY_PERIOD if self.replay else ASK_PERIOD

    def speaks(self, name: str) -> bool:
        """Whether a process is there, or a recording that has what it said."""
        return self.replay is not None or self.alive(name)

    def change_replay(self, act: Callable[[ReplayClient], ReplayStatus]) -> None:
        """Have the recording go on, stand or jump. Raises BusError."""
        with self._turn:
            self.replay = act(self._replay)

    @property
    def loading(self) -> bool:
        """Whether it is too early to say that there is no team: its processes may not have answered yet."""
        return self.sim is None and monotonic() < self._begun + PATIENCE

    def robots(self) -> set[int]:
        """The robots that have a process, or had one of which a status came."""
        heard = {i for i in self.team.robots.copy() if self.status_of(i) is not None}
        return heard | {i for i in map(names.robot_id_of, self.names()) if i is not None}

    def status_of(self, robot_id: int) -> RobotStatus | None:
        """A robot's newest status; None where none came while a page was open."""
        status = self.team.robot(robot_id).newest.get(names.STATUS)
        return status if isinstance(status, RobotStatus) else None

    def processes(self) -> dict[int, list[str]]:
        """By robot: the names of its processes, which are its behaviour, its navigation and its base."""
        found: dict[int, list[str]] = {}
        for name in sorted(self.names()):
            for robot_of in (names.robot_id_of, names.navigated_robot_of, names.base_robot_of):
                if (robot_id := robot_of(name)) is not None:
                    found.setdefault(robot_id, []).append(name)
        return found

    def ask(self, layers: Collection[str], docs: Collection[str], inspected: Collection[int], opened: int) -> None:
        """Ask what the pages that show these layers and documents, and inspect these robots, need; `opened` counts the
        subscriptions so far."""
        self._ask_replay()
        self._ask_simulator(obstacles="obstacles" in layers)
        self._ask_for_repeat(opened)
        self.lists = find_lists(self._bus) if "goals" in layers else {}
        answers = {i: self._ask(names.service_key(names.robot_name(i), DESCRIBE), DescribeReply) for i in inspected}
        self.parameters = {i: found[0][1] for i, found in answers.items() if found}
        if ("tf" in docs or inspected) and self._frames_due.due():
            self.frames = find_frames(self._bus, PATIENCE) or {}
        if "log" not in docs:
            self._has_log = False
        elif not self._has_log:
            self._has_log = True
            self.kept_log = [*kept_lines(self._ask(names.log_key("*"), list[LogLine]))]
        if self._keys_due.due():
            self.declarations = self._bus.declarations()
        if "topics" in docs and self._bus.options and not self._surveys and self._survey_due.due():
            self._surveys = True
            threading.Thread(target=self._survey, args=(self._bus.options,), name="survey", daemon=True).start()
        if self.refused is None and self.team.link_up:
            self.refused = list(self._find_refused())
        self._on_news()

    def _find_refused(self) -> Iterator[str]:
        for grant, topic in (("goals", names.GOAL_POSE), ("teleop", names.CMD_VEL_TELEOP)):
            try:
                self._bus.check_right(names.robot_key(0, topic))
            except BusError:
                yield grant

    def _survey(self, options: BusOptions) -> None:
        """Look at all keys for a while, on a session of its own: what this one has subscribed to stays as it is."""
        options = msgspec.structs.replace(options, connect=options.endpoint)
        try:
            with suppress(ZteamError), closing(connect(options, patience=PATIENCE)) as bus:
                self.topics = [topic_row(row) for row in find_rows(bus, "**")[0]]
        finally:
            self._surveys = False

    def _ask_replay(self) -> None:
        if not self.alive(names.REPLAY):
            self.replay = None
            return
        if self.replay is None:
            # Where it stands it has said all before.
            self._opened = -1
        with suppress(BusError):
            self.change_replay(lambda client: client.status())

    def _ask_simulator(self, *, obstacles: bool) -> None:
        sim = find_status(self._bus, PATIENCE) if self.speaks(names.SIMULATOR) else None
        self.sim = sim
        self.last_world = sim.world if sim else self.last_world if self.robots() else ""
        if sim is None:
            self.shapes = self.obstacles = self._shapes_of = None
            return
        if (version := (sim.instance, sim.robots)) != self._shapes_of:
            self.shapes = self._first("shapes", ShapesReply)
            self._shapes_of = version if self.shapes is not None else None
        if obstacles and (self.obstacles is None or any(each.movable for each in self.obstacles.obstacles)):
            self.obstacles = self._first("obstacles", ObstaclesReply)

    def _ask_for_repeat(self, opened: int) -> None:
        """Where the world stands nothing new comes: let a new subscriber have what the last tick has sent."""
        sim, missed = self.sim, opened != self._opened
        self._opened = opened
        if missed and self.replay is not None and self.replay.is_paused:
            with suppress(BusError):
                self.change_replay(lambda client: client.seek(to_seconds(client.status().now)))
        if missed and sim is not None and (sim.paused or sim.finished) and sim.tick > 0:
            # The aggregator does not send a tick's bundle twice.
            if self._received.get(names.TF) is None:
                for _, bundle in self._ask(names.service_key(names.AGGREGATOR, "newest"), BundleReply):
                    self._received.take(names.TF, bundle.content)
            self._ask(names.service_key(names.SIMULATOR, "repeat"), SimStatus, Change())

    def _first(self, service: str, kind: type[T]) -> T | None:
        answers = self._ask(names.service_key(names.SIMULATOR, service), kind)
        return answers[0][1] if answers else None

    def _ask(self, key: str, kind: type[T], request: msgspec.Struct | None = None) -> list[tuple[str, T]]:
        return self._bus.find(key, kind, request, timeout=PATIENCE)


FRESH = 30.0
"""Host seconds after which a page that opens the doctor begins another run; its button does so at any time."""
_MOST = 500
"""Findings that a page gets: a hostile team may cause any number."""


def _examination(findings: Sequence[Finding] = (), error: str = "", time: float = 0.0) -> dict[str, Any]:
    """The document `doctor`: when it was made, in seconds since the Unix epoch, the findings as `zteam doctor --json`
    prints them, or why there are none."""
    return {"time": time, "findings": findings, "error": error}


class Diagnosis:
    """Examines the team, one time after the other, on a session and a thread of its own: it listens to all keys of the
    team, and pages must not wait for it. Threads may make calls at the same time."""

    def __init__(self, options: BusOptions | None, on_news: Callable[[], None]) -> None:
        """`options` is how to reach the team; None for a bus in memory, which no other session can join."""
        self._options, self._on_news = options, on_news
        self._lock = threading.Lock()
        self._wanted = self._runs = False
        self._begun = float("-inf")
        """Host time of the newest run."""
        self._found = _examination()

    @property
    def document(self) -> bytes:
        return msgspec.json.encode({**self._found, "running": self._runs})

    def want(self, wanted: bool) -> None:
        """Whether some page shows it: it is made when the first one begins to, unless it is fresh."""
        before, self._wanted = self._wanted, wanted
        if wanted and not before and monotonic() - self._begun > FRESH:
            self.start()

    def start(self) -> None:
        """Make it anew, unless that goes on already."""
        with self._lock:
            if self._options is None:
                self._found = _examination(error="the team is in one process, which no other one can look at")
            elif not self._runs:
                self._runs, self._begun = True, monotonic()
                threading.Thread(target=self._run, args=(self._options,), name="doctor", daemon=True).start()

    def _run(self, options: BusOptions) -> None:
        try:
            self._found = _examination(examine(options)[:_MOST], time=wall_ns() / 1e9)
        except ZteamError as error:
            self._found = _examination(error=f"{error}: try 'zteam doctor' in a terminal")
        except Exception as error:
            # What it judges comes from a team, which may be hostile: the view goes on.
            log.exception("doctor")
            self._found = _examination(error=f"the examination failed: {error!r:.1000}")
        self._runs = False
        self._on_news()
