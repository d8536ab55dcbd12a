"""What a process received and dropped, per key: how many messages, and when and why the last one was dropped."""

import logging
import threading
from typing import NamedTuple

import msgspec

from zteam.clock import Every, monotonic

log = logging.getLogger("zteam.bus")

MAX_KEYS = 4096
"""A sender can invent keys; beyond this many they are counted together."""
OTHER = "(other keys)"
_MAX_REASON = 300
"""Characters; a reason may repeat what a sender wrote."""


class KeyCount(msgspec.Struct):
    """Messages on one key."""

    received: int = 0
    dropped: int = 0
    last_drop_age: float | None = None
    """Host seconds since the last message was dropped, when this was told; None if none was."""
    last_drop_reason: str = ""
    """Why it was dropped."""


class _Drop(NamedTuple):
    time: float
    """Host time."""
    reason: str


class Counters:
    """Thread-safe counts; a drop is warned about at most once a second for each key."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts: dict[str, KeyCount] = {}
        self._last: dict[str, _Drop] = {}
        self._warn: dict[str, Every] = {}

    def receive(self, key: str) -> None:
        """One good message came."""
        with self._lock:
            self._count(key).received += 1

    def drop(self, key: str, why: str) -> None:
        """One message was refused; say why."""
        with self._lock:
            count = self._count(key)
            count.dropped += 1
            shown = key if key in self._counts else OTHER
            self._last[shown] = _Drop(monotonic(), why[:_MAX_REASON])
            due = self._warn.setdefault(shown, Every(1.0)).due()
            dropped = count.dropped
        if due:
            log.warning("dropped a message on %s: %s (%d so far)", key, why, dropped)

    def snapshot(self) -> dict[str, KeyCount]:
        """A copy, sorted by key; the ages of the last drops are those of this moment."""
        with self._lock:
            return {key: self._told(key, count) for key, count in sorted(self._counts.items())}

    def _told(self, key: str, count: KeyCount) -> KeyCount:
        last = self._last.get(key)
        if last is None:
            return KeyCount(count.received, count.dropped)
        return KeyCount(count.received, count.dropped, round(monotonic() - last.time, 3), last.reason)

    def _count(self, key: str) -> KeyCount:
        count = self._counts.get(key)
        if count is None:
            if len(self._counts) >= MAX_KEYS:
                key = OTHER
            count = self._counts.setdefault(key, KeyCount())
        return count
