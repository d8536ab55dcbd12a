"""Which processes publish and subscribe to which key, and the keys near a mistyped one."""

import argparse
import difflib
from collections.abc import Collection, Iterable, Mapping, Sequence

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.bus.counters import KeyCount
from zteam.bus.keys import matches
from zteam.bus.presence import ProcessInfo, holder_text, names_of_sessions
from zteam.bus.topics import type_of_key
from zteam.bus.transport import Declaration
from zteam.cli.listening import KeySurvey, check_key, open_bus, survey
from zteam.cli.node import find_nodes, writer_names
from zteam.cli.options import bus_options
from zteam.cli.tables import format_table
from zteam.errors import BusError, ZteamError
from zteam.numbers import format_rate

_PATIENCE = 0.5
"""Host seconds for processes to tell their names; one that hangs is shown by its session."""


class KeyUsers:
    """The publishers and subscribers of all sessions of zteam but the tool's own, by the names of their processes."""

    def __init__(self, declarations: Sequence[Declaration], processes: Sequence[ProcessInfo]) -> None:
        """`processes` are those of zteam; one may be there with several names."""
        self._declarations = declarations
        self._processes = processes

    def publishers(self, key_expr: str) -> list[str]:
        """The processes that publish on keys of `key_expr`."""
        return self._names(key_expr, publishes=True)

    def subscribers(self, key_expr: str) -> list[str]:
        """The processes that subscribe to keys of `key_expr`."""
        return self._names(key_expr, publishes=False)

    def _names(self, key_expr: str, *, publishes: bool) -> list[str]:
        sessions = {d.session for d in self._declarations if d.publishes == publishes and matches(d.key, key_expr)}
        return self.name_sessions(sessions, key_expr)

    def name_sessions(self, sessions: Iterable[str], key: str) -> list[str]:
        """The users of a key by name, sorted; one that is no process of zteam by its session's id."""
        known = names_of_sessions(self._processes, key)
        return sorted(holder_text(known.get(session), session) for session in sessions)

    def known_keys(self, heard: Iterable[str] = ()) -> list[str]:
        """Every key with a publisher or a subscriber. A wildcard is a key of each robot here and in `heard`."""
        robots = self.robots(heard)
        return sorted({key for d in self._declarations for key in names.keys_in(d.key, robots)})

    def robots(self, heard: Iterable[str] = ()) -> list[int]:
        """The ids of the robots that have a key of their own, declared or `heard`."""
        keys = (*(declaration.key for declaration in self._declarations), *heard)
        return sorted({target[0] for target in map(names.split_robot_key, keys) if target is not None})


def find_key_users(bus: Bus) -> KeyUsers:
    """The users of all keys now."""
    declarations = bus.declarations()
    try:
        infos = bus.query(names.info_key("*"), ProcessInfo, timeout=_PATIENCE)
    except BusError:
        infos = []
    return KeyUsers(declarations, [info for _, info in infos])


NO_KEYS = "no key has a publisher or a subscriber (is a simulator running? see 'zteam doctor')"


def near_keys(key: str, known: Collection[str]) -> str:
    """`: did you mean X or Y?`: the keys, or frames, that may be meant by `key`, the nearest first; else nothing.

    They end or begin with `key`, are spelt like it, or have a longer last part, as `robot_0/base_scan` for `scan`.
    """
    ordered = sorted(known)
    near = (
        [other for other in ordered if other.endswith(f"/{key}")]
        or [other for other in ordered if other.startswith(f"{key}/")]
        or _most_alike(key, ordered)
        or [other for other in ordered if other.endswith(f"_{key}")]
    )
    return f": did you mean {' or '.join(near[:3])}?" if near else ""


def _most_alike(key: str, known: Sequence[str]) -> list[str]:
    near = difflib.get_close_matches(key, known, n=3, cutoff=0.8)
    return sorted(near, key=lambda other: (-difflib.SequenceMatcher(None, other, key).ratio(), other))


def where_to_look(key: str, known: Collection[str]) -> str:
    """The end of a sentence about a `key` without users: the `known` keys that may be meant, else what to do."""
    return near_keys(key, known) or (": see 'zteam topic list'" if known else f": {NO_KEYS}")


class KeyRow(KeySurvey):
    """A key, the messages received on it, and its users."""

    publishers: list[str] = msgspec.field(default_factory=list)
    """Names of processes, also of those that publish nothing now."""
    subscribers: list[str] = msgspec.field(default_factory=list)
    """Names of processes; programs that are not zteam's are missing."""


def find_rows(bus: Bus, key_expr: str) -> tuple[list[KeyRow], KeyUsers]:
    """The keys of `key_expr` that carry data or have a publisher or a subscriber, and all users of keys."""
    users = find_key_users(bus)
    heard = {entry.key: entry for entry in survey(bus, key_expr)}
    keys = heard.keys() | {key for key in users.known_keys(heard) if matches(key_expr, key)}
    return [_row(heard.get(key) or _silent(key), users) for key in sorted(keys)], users


def _silent(key: str) -> KeySurvey:
    kind = type_of_key(key)
    return KeySurvey(key, kind.ros_type if kind else "")


def _row(entry: KeySurvey, users: KeyUsers) -> KeyRow:
    row = KeyRow(**msgspec.structs.asdict(entry))
    # A sender that tells no publisher, such as a program that is not zteam's, is heard all the same.
    row.publishers = sorted({*users.publishers(entry.key), *users.name_sessions(entry.sources, entry.key)})
    row.subscribers = users.subscribers(entry.key)
    return row


def _rate(row: KeyRow) -> str:
    if row.latched:
        return "latched"
    # One message in the time of a survey says little about a rate.
    return {0: "-", 1: "~1 Hz"}.get(row.count) or format_rate(row.rate)


def show_list(args: argparse.Namespace) -> int:
    """Print a table of all keys."""
    bus = open_bus(bus_options(args))
    try:
        rows, _ = find_rows(bus, "**")
    finally:
        bus.close()
    if args.json:
        print(msgspec.json.encode(rows).decode())
        return 0
    if not rows:
        print(NO_KEYS)
        return 0
    print(format_table(("key", "type", "rate", "pubs", "subs"), list(map(_cells, rows)), numbers_from=2))
    return 0


def _cells(row: KeyRow) -> tuple[str, ...]:
    return row.key, row.type or "?", _rate(row), str(len(row.publishers)), str(len(row.subscribers))


def show_info(args: argparse.Namespace) -> int:
    """Print everything known about the keys of a key expression."""
    key = check_key(args.key)
    bus = open_bus(bus_options(args))
    try:
        rows, users = find_rows(bus, key)
        nodes = find_nodes(bus)
        counts = bus.query(names.stats_key("*"), dict[str, KeyCount])
    finally:
        bus.close()
    if not rows:
        raise ZteamError(f"nothing publishes {key} or subscribes to it{where_to_look(key, users.known_keys())}")
    for row in rows:
        stats = {key.removesuffix("/stats"): per_key[row.key] for key, per_key in counts if row.key in per_key}
        heard = writer_names(nodes, row.sources, row.key)
        info = {
            "key": row.key,
            "type": row.type,
            "rate": round(row.rate, 2),
            "latched": row.latched,
            "bytes": row.bytes,
            "writers": heard,
            "receivers": stats,
            "publishers": row.publishers,
            "subscribers": row.subscribers,
        }
        print(msgspec.json.encode(info).decode() if args.json else _format_info(row, heard, stats))
    return 0


def _format_info(row: KeyRow, heard: Sequence[str], stats: Mapping[str, KeyCount]) -> str:
    from zteam.diagnosis.checks import format_refusals

    received = {name: f"{name}: {count.received} received, {format_refusals(count)}" for name, count in stats.items()}
    silent = [f"{name} (nothing heard of it)" for name in row.publishers if name not in heard]
    subscribers = [received.get(name, name) for name in row.subscribers or received]
    lines = [
        row.key,
        f"  type      {row.type or '?'}",
        f"  rate      {_rate(row)}" + (f", {row.bytes} bytes" if row.count or row.latched else ""),
        *(f"  writer    {name}" for name in [*heard, *silent] or ["none"]),
        *(f"  receiver  {text}" for text in subscribers or ["none"]),
    ]
    return "\n".join(lines)
