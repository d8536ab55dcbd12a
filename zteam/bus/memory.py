"""A bus in memory with the same interface, for unit tests and notebooks: same bytes, same keys, no processes.

Delivery is synchronous: `put` returns when every subscriber's callback has. Sessions share a `MemoryHub`.
"""

import itertools
import threading
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import zenoh

from zteam.bus.bus import Bus
from zteam.bus.transport import Closeable, QueryHandler, RawPublisher, RawSample, Reply, SampleHandler, TokenHandler


def _matches(key_expr: str, key: str) -> bool:
    return bool(zenoh.KeyExpr(key_expr).intersects(zenoh.KeyExpr(key)))


class _Handle:
    def __init__(self, close: Callable[[], None]) -> None:
        self._close: Callable[[], None] | None = close

    def close(self) -> None:
        if self._close:
            close, self._close = self._close, None
            close()


class _Publisher(_Handle):
    has_subscribers = True

    def __init__(self, close: Callable[[], None], put: Callable[[bytes], None]) -> None:
        super().__init__(close)
        self.put = put


class _Subscriber:
    def __init__(self, session: str, key_expr: str, handler: SampleHandler) -> None:
        self.session = session
        self.handler = handler
        # A key expression is compared with every key that is put, so each pair is compared once.
        self.matches = lru_cache(maxsize=1024)(lambda key: _matches(key_expr, key))


class MemoryHub:
    """What the router is to processes: everything that was declared, and the latched payloads."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self._ids = itertools.count(1)
        self.timestamps = itertools.count(1)
        self.subscribers: dict[int, _Subscriber] = {}
        self.queryables: dict[int, tuple[str, QueryHandler]] = {}
        self.tokens: dict[int, str] = {}
        self.watchers: dict[int, tuple[str, TokenHandler]] = {}
        self.latched: dict[int, RawSample] = {}

    def bus(self) -> Bus:
        """A new session on this hub."""
        return Bus(MemoryTransport(self))

    def new_id(self) -> int:
        """A number for a declaration or a session."""
        return next(self._ids)


class MemoryTransport:
    """One session on a MemoryHub."""

    def __init__(self, hub: MemoryHub) -> None:
        self._hub = hub
        self.instance = f"{hub.new_id():032x}"
        self._open: list[Closeable] = []

    def declare_publisher(self, key: str, encoding: str, latched: bool, to_others: bool = False) -> RawPublisher:
        hub, number = self._hub, self._hub.new_id()

        def put(payload: bytes) -> None:
            sample = RawSample(key, bytes(payload), encoding, next(hub.timestamps), self.instance)
            with hub.lock:
                if latched:
                    hub.latched[number] = sample
                handlers = [
                    s.handler
                    for s in hub.subscribers.values()
                    if not (to_others and s.session == self.instance) and s.matches(key)
                ]
            for handler in handlers:
                handler(sample)

        publisher = _Publisher(lambda: hub.latched.pop(number, None) and None, put)
        self._open.append(publisher)
        return publisher

    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, stamped: bool = True
    ) -> Closeable:
        hub, number = self._hub, self._hub.new_id()
        with hub.lock:
            hub.subscribers[number] = _Subscriber(self.instance, key_expr, handler)
            history = [s for s in hub.latched.values() if latched and _matches(key_expr, s.key)]
        for sample in history:
            handler(sample)
        return self._handle(hub.subscribers, number)

    def declare_queryable(self, key: str, handler: QueryHandler) -> Closeable:
        number = self._hub.new_id()
        self._hub.queryables[number] = (key, handler)
        return self._handle(self._hub.queryables, number)

    def get(self, key_expr: str, payload: bytes, timeout: float) -> list[Reply]:
        replies = []
        for key, handler in list(self._hub.queryables.values()):
            if _matches(key_expr, key):
                try:
                    answer = handler(payload)
                    replies.append(Reply(key, answer() if callable(answer) else answer, False))
                except Exception as error:
                    replies.append(Reply(key, str(error).encode(), True))
        return replies

    def declare_token(self, key: str) -> Closeable:
        hub, number = self._hub, self._hub.new_id()
        hub.tokens[number] = key
        self._tell(key, True)

        def drop() -> None:
            if hub.tokens.pop(number, None) is not None:
                self._tell(key, False)

        handle = _Handle(drop)
        self._open.append(handle)
        return handle

    def watch_tokens(self, key_expr: str, handler: TokenHandler) -> Closeable:
        hub, number = self._hub, self._hub.new_id()
        hub.watchers[number] = (key_expr, handler)
        for key in list(hub.tokens.values()):
            if _matches(key_expr, key):
                handler(key, True)
        return self._handle(hub.watchers, number)

    def watch_link(self, handler: Callable[[bool], None]) -> None:
        """Memory has no link to lose."""

    def close(self) -> None:
        for handle in self._open:
            handle.close()

    def _tell(self, key: str, alive: bool) -> None:
        for expr, handler in list(self._hub.watchers.values()):
            if _matches(expr, key):
                handler(key, alive)

    def _handle(self, table: dict[int, Any], number: int) -> Closeable:
        handle = _Handle(lambda: table.pop(number, None) and None)
        self._open.append(handle)
        return handle
