"""Counts of what a process received and dropped, per key."""

import logging
import threading

import msgspec

from zteam.clock import Every

log = logging.getLogger("zteam.bus")

MAX_KEYS = 4096
"""A sender can invent keys; beyond this many they are counted together."""
OTHER = "(other keys)"


class KeyCount(msgspec.Struct):
    """Messages on one key."""

    received: int = 0
    dropped: int = 0


class Counters:
    """Thread-safe counts; a drop is warned about at most once a second for each key."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts: dict[str, KeyCount] = {}
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
            due = self._warn.setdefault(shown, Every(1.0)).due()
            dropped = count.dropped
        if due:
            log.warning("dropped a message on %s: %s (%d so far)", key, why, dropped)

    def snapshot(self) -> dict[str, KeyCount]:
        """A copy, sorted by key."""
        with self._lock:
            return {k: KeyCount(c.received, c.dropped) for k, c in sorted(self._counts.items())}

    def _count(self, key: str) -> KeyCount:
        count = self._counts.get(key)
        if count is None:
            if len(self._counts) >= MAX_KEYS:
                key = OTHER
            count = self._counts.setdefault(key, KeyCount())
        return count
