"""Every message of some topics, for a while: lines of logs, samples of plots, markers."""

import itertools
import threading
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from zteam.clock import monotonic
from zteam.messages import Message

KEPT = 2000
"""Messages of one topic."""
KEPT_BYTES = 16_000_000
"""Of one topic; the newest message is kept whatever its size."""


class Event(NamedTuple):
    """One message."""

    number: int
    key: str
    content: bytes | Message
    encoding: str
    time: float
    """Host time at which it came."""


def _size(content: bytes | Message) -> int:
    """Bytes of a message; the messages of a topic are of about one size."""
    return len(content) if isinstance(content, bytes) else 0


class History:
    """Filled by threads of the bus, read by the one that makes frames."""

    def __init__(self, on_news: Callable[[], None]) -> None:
        self._on_news = on_news
        self._lock = threading.Lock()
        self._numbers = itertools.count(1)
        self._events: dict[str, deque[Event]] = {}

    def take(self, topic: str, key: str, content: bytes | Message, encoding: str = "") -> None:
        """A message came on `key`, by the subscription to `topic`."""
        with self._lock:
            event = Event(next(self._numbers), key, content, encoding, monotonic())
            events = self._events.setdefault(topic, deque(maxlen=KEPT))
            events.append(event)
            while len(events) > 1 and len(events) * _size(content) > KEPT_BYTES:
                events.popleft()
        self._on_news()

    def since(self, topic: str, number: int) -> list[Event]:
        """The messages of a topic after the one with this number, oldest first."""
        with self._lock:
            events = self._events.get(topic, ())
            newer = list(itertools.takewhile(lambda event: event.number > number, reversed(events)))
        return newer[::-1]

    def forget(self, topic: str) -> None:
        """The subscription is closed."""
        with self._lock:
            self._events.pop(topic, None)
