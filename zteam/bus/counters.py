"""What a process received and dropped, per key: how many messages, and when and why the last one was dropped."""

import logging
import threading
from typing import NamedTuple

import msgspec

from zteam.clock import monotonic
from zteam.names import all_robots_key, split_robot_key

log = logging.getLogger("zteam.bus")

MAX_KEYS = 4096
"""A sender can invent keys; beyond this many they are counted together."""
OTHER = "(other keys)"
_MAX_REASON = 300
"""Characters; a reason may repeat what a sender wrote."""
_FIRST_PAUSE, _LONGEST_PAUSE = 1.0, 60.0
"""Host seconds between two warnings about a key: a cause that stays must not fill the log."""


class KeyCount(msgspec.Struct):
    """Messages on one key."""

    received: int = 0
    dropped: int = 0
    last_drop_age: float | None = None
    """Host seconds since the last message was dropped, when this was told; None if none was."""
    last_drop_reason: str = ""
    """Why it was dropped."""


class _Drop(NamedTuple):
    """The last dropped message of a key, and the last warning about one. Times are the host's."""

    time: float
    reason: str
    warned: float
    pause: float
    """Seconds from that warning to the next; twice as long after each."""


def _next_drop(last: _Drop | None, now: float, reason: str) -> _Drop:
    """What follows `last`; it is warned about if `warned` is `now`."""
    if last is None or now - last.time >= _LONGEST_PAUSE:
        return _Drop(now, reason, now, _FIRST_PAUSE)
    if reason != last.reason and now - last.warned >= _FIRST_PAUSE:
        return _Drop(now, reason, now, _FIRST_PAUSE)
    if now - last.warned >= last.pause:
        return _Drop(now, reason, now, min(2.0 * last.pause, _LONGEST_PAUSE))
    return last._replace(time=now, reason=reason)


class Counters:
    """Thread-safe counts. Drops of a key are warned about at most once a second, and ever less often for one reason.

    Robots of which every message was dropped count as one key.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts: dict[str, KeyCount] = {}
        self._last: dict[str, _Drop] = {}

    def receive(self, key: str) -> None:
        """One good message came."""
        with self._lock:
            count = self._counts.get(key) or self._count(key)
            count.received += 1

    def count_of(self, key: str) -> KeyCount:
        """The count of a key, for a receiver that counts its good messages up itself.

        It does so without the lock, which would take most of the time. An addition is not interrupted by other threads.
        """
        with self._lock:
            return self._count(key)

    def drop(self, key: str, why: str) -> None:
        """One message was refused; say why."""
        with self._lock:
            count = self._count(key)
            count.dropped += 1
            shown = key if key in self._counts else OTHER
            now = monotonic()
            last = self._last[shown] = _next_drop(self._last.get(shown), now, why[:_MAX_REASON])
            target = split_robot_key(key)
            if target is not None and count.received <= count.dropped:
                # No message of this robot was good: a sender can invent robots, so they share the warnings of a topic.
                topic = all_robots_key(target[1])
                last = self._last[topic] = _next_drop(self._last.get(topic), now, why[:_MAX_REASON])
            dropped = count.dropped
        if last.warned == now:
            log.warning("dropped a message on %s: %s (%d so far)", key, why, dropped)

    def snapshot(self) -> dict[str, KeyCount]:
        """A copy, sorted by key; the ages of the last drops are those of this moment."""
        with self._lock:
            counts = sorted((key, count) for key, count in self._counts.items() if count.received or count.dropped)
            return {key: self._told(key, count) for key, count in counts}

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
