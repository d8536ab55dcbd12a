"""The newest message of each key, as it came: nothing is decoded before a page wants to see it."""

import threading
from collections.abc import Callable
from typing import NamedTuple

from zteam.clock import monotonic
from zteam.messages import Message


class Arrival(NamedTuple):
    """One message."""

    content: bytes | Message
    number: int
    """Grows with every message of any key."""
    time: float
    """Host time at which it came."""
    encoding: str = ""
    """Empty where the key has one type."""


class Newest:
    """Filled by threads of the bus, read by the one that makes frames."""

    def __init__(self, on_news: Callable[[], None]) -> None:
        self._on_news = on_news
        self._lock = threading.Lock()
        self._arrivals: dict[str, Arrival] = {}
        self._number = 0

    @property
    def number(self) -> int:
        """Of the newest message of all keys."""
        return self._number

    def take(self, key: str, content: bytes | Message, encoding: str = "") -> None:
        """A message came."""
        with self._lock:
            self._number += 1
            self._arrivals[key] = Arrival(content, self._number, monotonic(), encoding)
        self._on_news()

    def get(self, key: str) -> Arrival | None:
        """The newest of a key; None before the first."""
        return self._arrivals.get(key)

    def items(self) -> list[tuple[str, Arrival]]:
        """All that is kept, by key."""
        with self._lock:
            return list(self._arrivals.items())

    def drop(self, has_gone: Callable[[str], bool]) -> None:
        """Forget the keys for which `has_gone(key)`."""
        with self._lock:
            for key in [key for key in self._arrivals if has_gone(key)]:
                del self._arrivals[key]
