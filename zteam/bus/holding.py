"""What a session declares before its process holds a name: no other session sees any of it before the release."""

import threading
from collections.abc import Callable

from zteam.bus.keys import check_use
from zteam.bus.transport import Closeable, RawPublisher
from zteam.messages import Message, encode


class Holding:
    """Declares publishers and queries at once, or at the `release` after a `begin`."""

    def __init__(self) -> None:
        self.active = False
        """Whether declarations wait for the release."""
        self.releases = 0
        self._waiting: list[Callable[[], None]] = []
        self._lock = threading.Lock()

    def begin(self) -> None:
        """From now on declarations wait. Messages are dropped; of a latched publisher the release sends the last."""
        self.active = True

    def release(self) -> None:
        """Declare what waits, in the order in which it came."""
        with self._lock:
            waiting, self._waiting, self.active = self._waiting, [], False
        for declare in waiting:
            declare()
        self.releases += 1

    def publisher(self, key: str, latched: bool, declare: Callable[[], RawPublisher]) -> RawPublisher:
        """What `declare()` opens, now or later. Raises BusError for a `key` that is no key expression."""
        if self.active:
            check_use("publish on", key, False)
        held = _HeldPublisher(declare, latched)
        return held if self._waits(held.release) else declare()

    def declaration(self, declare: Callable[[], Closeable], at_once: bool) -> Closeable:
        """What `declare()` opens, now or later."""
        held = _Held(declare)
        return held if not at_once and self._waits(held.release) else declare()

    def _waits(self, declare: Callable[[], None]) -> bool:
        """Whether `declare` is kept for the release."""
        with self._lock:
            if self.active:
                self._waiting.append(declare)
            return self.active


class _Held:
    """A declaration that waits, unless it was closed before."""

    def __init__(self, declare: Callable[[], Closeable]) -> None:
        self._declare = declare
        self._lock = threading.Lock()
        self._handle: Closeable | None = None
        self._closed = False

    def release(self) -> None:
        """Declare it."""
        with self._lock:
            if not self._closed:
                self._handle = self._declare()

    def close(self) -> None:
        with self._lock:
            self._closed = True
            if self._handle is not None:
                self._handle.close()


class _HeldPublisher:
    """A publisher that waits. From its release on it passes all on."""

    def __init__(self, declare: Callable[[], RawPublisher], latched: bool) -> None:
        self._declare, self._latched = declare, latched
        self._lock = threading.Lock()
        self._raw: RawPublisher | None = None
        self._kept: bytes | None = None
        self._closed = False

    @property
    def has_subscribers(self) -> bool:
        return self._latched and not self._closed if self._raw is None else self._raw.has_subscribers

    def find_subscribers(self) -> bool:
        return self._latched and not self._closed if self._raw is None else self._raw.find_subscribers()

    def put(self, payload: bytes) -> None:
        with self._lock:
            if self._raw is None:
                self._kept = payload
                return
        self._raw.put(payload)

    def put_message(self, message: Message) -> None:
        raw = self._raw
        # A release in between: `put` looks again.
        self.put(encode(message)) if raw is None else raw.put_message(message)

    def hand_over(self, message: Message) -> None:
        raw = self._raw
        self.put(encode(message)) if raw is None else raw.hand_over(message)

    def release(self) -> None:
        """Open it, and send what was kept."""
        with self._lock:
            if self._closed:
                return
            raw = self._declare()
            if self._latched and self._kept is not None:
                raw.put(self._kept)
            self._raw = raw

    def close(self) -> None:
        with self._lock:
            self._closed = True
            if self._raw is not None:
                self._raw.close()
