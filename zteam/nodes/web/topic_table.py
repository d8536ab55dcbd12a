"""The document `topics`: keys, types, users, and rates, without a subscription to any of them. Pure.

Each process counts what it receives. The rate of a key is how fast the largest of these counts grows; a key that
nothing receives has none.
"""

from collections.abc import Iterable, Mapping

import msgspec

from zteam import names
from zteam.bus.keys import matches
from zteam.bus.topics import type_of_key
from zteam.bus.transport import Declaration


class TopicRow(msgspec.Struct):
    """One key."""

    key: str
    type: str = ""
    hz: float | None = None
    publishers: int = 0
    subscribers: int = 0


class Counts(msgspec.Struct, frozen=True):
    """How many messages of each key each process has received, at a host time."""

    time: float
    received: Mapping[str, Mapping[str, int]]
    """By process, then by key."""


def rates(before: Counts | None, after: Counts) -> dict[str, float]:
    """Messages a second by key."""
    if before is None or after.time <= before.time:
        return {}
    found: dict[str, float] = {}
    for process, counts in after.received.items():
        earlier = before.received.get(process, {})
        for key, count in counts.items():
            rate = max(0, count - earlier.get(key, count)) / (after.time - before.time)
            found[key] = max(found.get(key, 0.0), rate)
    return found


def topic_rows(declarations: Iterable[Declaration], hz: Mapping[str, float], robots: Iterable[int]) -> list[TopicRow]:
    """One row for each key with a publisher or a subscriber; a wildcard is a key of each of these robots."""
    known, ids = list(declarations), sorted(robots)
    rows: dict[str, TopicRow] = {}
    for declaration in known:
        for key in names.keys_in(declaration.key, ids):
            rows.setdefault(key, TopicRow(key))
    wild = [declaration for declaration in known if names.is_wildcard(declaration.key)]
    for declaration in known:
        row = rows.get(declaration.key)
        if row is not None:
            _count(row, declaration)
    for key, row in rows.items():
        for declaration in wild:
            if matches(declaration.key, key):
                _count(row, declaration)
        kind = type_of_key(key)
        row.type = "" if kind is None else kind.ros_type
        row.hz = round(hz[key], 1) if key in hz else None
    return [rows[key] for key in sorted(rows)]


def _count(row: TopicRow, declaration: Declaration) -> None:
    if declaration.publishes:
        row.publishers += 1
    else:
        row.subscribers += 1
