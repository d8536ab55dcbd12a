"""The output of `zteam topic list` and `info`: keys, what is on them, their publishers and subscribers."""

import argparse
from collections.abc import Mapping, Sequence

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.bus.receiving import KeyCount
from zteam.bus.topics import type_of_key
from zteam.bus.transport import matches
from zteam.cli.listening import NO_KEYS, KeySurvey, KeyUsers, check_key, find_key_users, open_bus, survey, where_to_look
from zteam.cli.node import find_nodes, writer_names
from zteam.cli.options import bus_options
from zteam.cli.tables import format_table
from zteam.errors import ZteamError
from zteam.numbers import format_rate


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
