"""The output of `zteam topic list` and `info`: keys, what is on them, their publishers and subscribers."""

import argparse
import threading
from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import closing

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.bus.receiving import KeyCount
from zteam.bus.transport import RawSample, matches
from zteam.cli.listening import (
    NO_KEYS,
    SURVEY,
    KeyUsers,
    Waiter,
    check_key,
    find_key_users,
    kind_of,
    open_bus,
    where_to_look,
)
from zteam.cli.node import find_nodes, writer_names
from zteam.cli.options import bus_options
from zteam.cli.tables import format_table
from zteam.clock import monotonic
from zteam.errors import ZteamError
from zteam.messages.topics import type_of_key
from zteam.numbers import format_rate


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


def find_rows(bus: Bus, key_expr: str) -> tuple[list[KeyRow], KeyUsers]:
    """The keys of `key_expr` that carry data or have a publisher or a subscriber, and all users of keys."""
    users, rows = find_key_users(bus), survey(bus, key_expr)
    for key in users.known_keys(rows):
        if key not in rows and matches(key_expr, key):
            kind = type_of_key(key)
            rows[key] = KeyRow(key, kind.ros_type if kind else "")
    for key, row in rows.items():
        # A sender that tells no publisher, such as a program that is not zteam's, is heard all the same.
        row.publishers = sorted({*users.publishers(key), *users.name_sessions(row.sources, key)})
        row.subscribers = users.subscribers(key)
    return [rows[key] for key in sorted(rows)], users


def survey(bus: Bus, key_expr: str) -> dict[str, KeyRow]:
    """Listen to `key_expr` for a while: every key that carries data, latched ones included."""
    rows: dict[str, KeyRow] = {}
    times: dict[str, list[float]] = defaultdict(list)
    lock = threading.Lock()

    def take(sample: RawSample) -> None:
        kind = kind_of(sample, None)
        with lock:
            row = rows.setdefault(sample.key, KeyRow(sample.key, kind.ros_type if kind else sample.encoding))
            row.bytes = len(sample.payload)
            if sample.source not in row.sources:
                row.sources.append(sample.source)

    def take_live(sample: RawSample) -> None:
        with lock:
            times[sample.key].append(monotonic())
        take(sample)

    start, live = monotonic(), bus.subscribe_raw(key_expr, take_live)
    # It receives live samples too.
    latched = bus.subscribe_raw(key_expr, take, latched=True)
    Waiter().wait(lambda: False, SURVEY, "")
    latched.close()
    live.close()
    for key, row in rows.items():
        row.count, row.rate = len(times[key]), rate_of(times[key], monotonic() - start)
        row.latched = row.count == 0
    return rows


def rate_of(times: Sequence[float], elapsed: float) -> float:
    """Hz between messages that came at `times`; that of a single one over the `elapsed` seconds."""
    span = times[-1] - times[0] if times else 0.0
    return (len(times) - 1) / span if span > 0.0 else len(times) / elapsed


def _rate(row: KeyRow) -> str:
    if row.latched:
        return "latched"
    # One message in the time of a survey says little about a rate.
    return {0: "-", 1: "~1 Hz"}.get(row.count) or format_rate(row.rate)


def show_list(args: argparse.Namespace) -> int:
    """Print a table of all keys."""
    with closing(open_bus(bus_options(args))) as bus:
        rows, _ = find_rows(bus, "**")
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
    with closing(open_bus(bus_options(args))) as bus:
        rows, users = find_rows(bus, key)
        nodes = find_nodes(bus)
        counts = bus.query(names.stats_key("*"), dict[str, KeyCount])
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
