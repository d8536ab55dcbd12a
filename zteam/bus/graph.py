"""The graph of a team: its processes, the publishers and subscribers of each key, and the rates of messages."""

import difflib
import threading
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import closing
from itertools import chain

import msgspec

from zteam import names
from zteam.bus.bus import MOST_SESSIONS, Bus, SessionInfo, SessionRequest
from zteam.bus.presence import ProcessInfo, find_processes
from zteam.bus.transport import Declaration, RawSample, matches
from zteam.clock import monotonic, pause
from zteam.messages import Message, type_of_encoding
from zteam.messages.topics import type_of_key

SURVEY = 1.2
"""Seconds of a survey of the bus: longer than a tick and than the period of a robot's status."""
_SETTLE = 0.3
"""Host seconds for all tokens to come: a session that was just opened may have none yet."""
_LIMIT = 0.5
"""Host seconds for processes and sessions to tell their names; one that hangs is shown by its session."""


def find_nodes(bus: Bus) -> list[ProcessInfo]:
    """Every process that answers or has a presence token; one that does not answer has pid 0."""
    # By name too: one process may hold several, as a navigation of several robots does. `zteam tf static` holds a
    # token for the aggregator alone.
    held = {token for token in find_tokens(bus, names.tokens_key("*")) if token[1] != names.STATIC_CALLER}
    infos = {(info.name, info.instance): info for info in find_processes(bus)}
    silent = [ProcessInfo(name, "does not answer", 0, 0, i) for _, name, i in held if (name, i) not in infos]
    # On a crowded machine an answer is there before its process's token.
    return sorted([*infos.values(), *silent], key=lambda info: (info.name, info.instance))


def find_tokens(bus: Bus, key_expr: str) -> set[tuple[str, str, str]]:
    """(namespace, name, session) of each presence token."""
    alive = dict[str, bool]()
    watches = bus.watch_tokens([key_expr], alive.__setitem__)
    pause(_SETTLE)
    for watch in watches:
        watch.close()
    tokens = (names.split_namespaced_token_key(key) for key, is_alive in list(alive.items()) if is_alive)
    return {token for token in tokens if token is not None}


class Graph:
    """The publishers and subscribers of sessions of zteam, and the processes that these sessions are."""

    def __init__(self, declarations: Sequence[Declaration], processes: Sequence[ProcessInfo] = ()) -> None:
        """`processes` are those of zteam; one may be there with several names."""
        self.declarations, self.processes = declarations, processes
        self._users: dict[tuple[str, bool], set[str]] = defaultdict(set)
        """Sessions by key, and whether they publish."""
        for each in declarations:
            self._users[each.key, each.publishes].add(each.session)
        self._wild = [user for user in self._users if names.is_wildcard(user[0])]

    def sessions(self, key_expr: str, *, publishes: bool) -> set[str]:
        """The sessions that publish on keys of `key_expr`, or that subscribe to them."""
        users: Iterable[tuple[str, bool]] = self._users
        if not names.is_wildcard(key_expr):
            users = {(key_expr, publishes), *self._wild}
        found = [user for user in users if user[1] == publishes and matches(user[0], key_expr)]
        return set().union(*(self._users.get(user, ()) for user in found))

    def publishers(self, key_expr: str) -> list[str]:
        """The processes that publish on keys of `key_expr`, by name."""
        return sorted(self.name_sessions(self.sessions(key_expr, publishes=True), key_expr))

    def subscribers(self, key_expr: str) -> list[str]:
        """The processes that subscribe to keys of `key_expr`, by name."""
        return sorted(self.name_sessions(self.sessions(key_expr, publishes=False), key_expr))

    def name_sessions(
        self, sessions: Iterable[str], key: str = "", places: Mapping[str, str] | None = None
    ) -> list[str]:
        """The users of a key by name, in the words of `places` where a session is among them.

        A process with several names is shown by that of the robot of `key`, a session of no process of zteam by its id.
        """
        target, known = names.split_robot_key(key), dict[str, str]()
        fitting = () if target is None else (names.robot_name(target[0]), names.navigation_name(target[0]))
        for info in self.processes:
            if info.name in fitting or info.instance not in known:
                known[info.instance] = info.name
        known |= places or {}
        return [known.get(each) or f"session {each}" if each else "unknown (no time stamp)" for each in sessions]

    def known_keys(self, robots: Iterable[int] = ()) -> list[str]:
        """Every key with a publisher or a subscriber. A wildcard is a key of each robot here and of these `robots`."""
        ids = sorted({*self.robots(), *robots})
        return sorted({key for expr in {key for key, _ in self._users} for key in names.keys_in(expr, ids)})

    def robots(self) -> set[int]:
        return robots_of(key for key, _ in self._users)


def robots_of(keys: Iterable[str]) -> set[int]:
    return {target[0] for target in map(names.split_robot_key, keys) if target is not None}


def find_graph(bus: Bus) -> Graph:
    """All sessions but the tool's own, as they are now."""
    declarations = bus.declarations()
    return Graph(declarations, find_processes(bus, timeout=_LIMIT))


class Survey:
    """What comes on the keys of `key_expr` until it is closed, latched messages included."""

    def __init__(self, bus: Bus, key_expr: str) -> None:
        self.newest: dict[str, dict[str, RawSample]] = defaultdict(dict)
        """By key and session: the newest sample, the sessions in order of their first ones."""
        self.times: dict[tuple[str, str], list[float]] = defaultdict(list)
        """By session and key: the host times of live messages."""
        self.sizes = Counter[str]()
        """By session: bytes of live messages."""
        self.changed = threading.Condition()
        self.seconds = 0.0
        """Host time from begin to end; 0 before."""
        self._begin = monotonic()
        # The second one receives live samples too.
        self._subscriptions = (
            bus.subscribe_raw(key_expr, self._receive_live),
            bus.subscribe_raw(key_expr, self._receive, latched=True),
        )

    def _receive(self, sample: RawSample) -> None:
        with self.changed:
            # A sample may still be on its way when it is closed.
            if not self.seconds:
                self.newest[sample.key][sample.source] = sample
                self.changed.notify_all()

    def _receive_live(self, sample: RawSample) -> None:
        with self.changed:
            if not self.seconds:
                self.times[sample.source, sample.key].append(monotonic())
                self.sizes[sample.source] += len(sample.payload)
        self._receive(sample)

    def close(self) -> None:
        """Take no further message."""
        with self.changed:
            self.seconds = monotonic() - self._begin
        for each in self._subscriptions:
            each.close()


class KeyRow(msgspec.Struct):
    """A key, the messages received on it during a survey, and its users."""

    key: str
    type: str
    """ROS name, else the encoding, else empty."""
    count: int = 0
    bytes: int = 0
    latched: bool = False
    """Whether its message was published before the survey began."""
    sources: list[str] = []
    """Sessions that published on it, in order of their first message; empty for a session that sends no time stamp."""
    rate: float = 0.0
    """Hz during the survey."""
    publishers: list[str] = []
    """Names of processes, also of those that publish nothing now."""
    subscribers: list[str] = []
    """Names of processes; programs that are not zteam's are missing."""


def find_rows(bus: Bus, key_expr: str) -> tuple[list[KeyRow], Graph]:
    """The keys of `key_expr` that carry data or have a publisher or a subscriber, and all users of keys."""
    graph = find_graph(bus)
    with closing(Survey(bus, key_expr)) as survey:
        pause(SURVEY)
    keys = {key for key in graph.known_keys(robots_of(survey.newest)) if matches(key_expr, key)}
    return [_row(key, graph, survey) for key in sorted(keys | survey.newest.keys())], graph


def _row(key: str, graph: Graph, survey: Survey) -> KeyRow:
    heard = survey.newest.get(key, {})
    times = sorted(chain.from_iterable(survey.times.get((source, key), ()) for source in heard))
    due = type_of_key(key)
    row = KeyRow(key, due.ros_type if due else "", len(times), latched=bool(heard) and not times, sources=[*heard])
    if heard:
        sample = max(heard.values(), key=lambda sample: sample.timestamp)
        kind = kind_of(sample)
        row.type, row.bytes = kind.ros_type if kind else sample.encoding, len(sample.payload)
        row.rate = rate_of(times, survey.seconds)
    # Samples also come from sessions that declare no publisher, such as programs without zteam.
    row.publishers = sorted({*graph.publishers(key), *graph.name_sessions(row.sources, key)})
    row.subscribers = graph.subscribers(key)
    return row


def rate_of(times: Sequence[float], elapsed: float) -> float:
    """Hz between messages that came at `times`; that of a single one over the `elapsed` seconds."""
    span = times[-1] - times[0] if times else 0.0
    return (len(times) - 1) / span if span > 0.0 else len(times) / elapsed


def kind_of(sample: RawSample) -> type[Message] | None:
    """The type of a payload: that of its encoding, else that of its key."""
    return type_of_encoding(sample.encoding) or type_of_key(sample.key)


def near_keys(key: str, known: Collection[str]) -> str:
    """`: did you mean X or Y?`: the keys, or frames, that may be meant by `key`, the nearest first; else nothing.

    They end or begin with `key`, are spelt like it, or have a longer last part, as `robot_0/base_scan` for `scan`.
    """
    ordered = sorted(known)
    near = (
        [other for other in ordered if other.endswith(f"/{key}")]
        or [other for other in ordered if other.startswith(f"{key}/")]
        or difflib.get_close_matches(key, ordered, n=3, cutoff=0.8)
        or [other for other in ordered if other.endswith(f"_{key}")]
    )
    return f": did you mean {' or '.join(near[:3])}?" if near else ""


def unpublished(graph: Graph, keys: Iterable[str], heard: Collection[str] = ()) -> dict[str, str] | None:
    """`: did you mean X?` or nothing, by each of these keys, wildcards too, that nothing publishes. None while no
    robot's data is published. `heard` are the keys on which messages were received."""
    published = {key for key in graph.known_keys() if graph.publishers(key)} | {*heard}
    robots = robots_of(published)
    if not robots:
        return None
    missing = [key for key in sorted(keys) if not any(matches(key, other) for other in published)]
    return {key: near_keys(next(iter(names.keys_in(key, robots)), key), published) for key in missing}


def describe_sessions(bus: Bus, sessions: Sequence[str]) -> dict[str, str]:
    """`name (process PID on HOST)` of each session that answers."""
    return {session: str(info) for session, info in _ask(bus, sessions, "").items()}


def _ask(bus: Bus, sessions: Sequence[str], key: str) -> dict[str, SessionInfo]:
    """What the sessions answer that do; `key` is the one of which they say whether they publish on it."""
    found = {}
    for session in sessions[:MOST_SESSIONS]:
        for _, info in bus.find(names.session_info_key(session), SessionInfo, SessionRequest(key), timeout=_LIMIT):
            found[session] = info
    return found


def name_publishers(bus: Bus, key: str, sessions: Sequence[str]) -> list[str]:
    """What people read for each of these sessions, which publish on `key`, in this order."""
    answers = _ask(bus, sessions, key)
    # A sender chooses its time stamps, and with them the session that they name: that one has no part in it.
    forged = {each for each, info in answers.items() if not info.publishes}
    texts = [str(answers.get(each) or f"session {each}") for each in sessions if each not in forged]
    return [*texts, "a sender with forged time stamps"] if forged else texts
