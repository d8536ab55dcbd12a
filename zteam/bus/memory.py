"""A bus in memory for unit tests and notebooks: the same bytes, keys and behaviour as over Zenoh, without processes.

`put` returns when every subscriber's callback has, and a query's handler runs on the asker's thread (a deferred answer
has a thread of its own, as over Zenoh). Sessions share a `MemoryHub`.
"""

import itertools
import logging
import threading
from collections import Counter
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

from zteam.bus.answering import DeferredAnswers, error_reply, make_answer
from zteam.bus.bus import Bus
from zteam.bus.keys import check_use, matches
from zteam.bus.transport import (
    Closeable,
    Declaration,
    QueryHandler,
    RawPublisher,
    RawSample,
    Reply,
    SampleHandler,
    TokenHandler,
)
from zteam.clock import monotonic, wait_until

log = logging.getLogger("zteam.bus")


class _Handle:
    """A declaration; closing it twice does nothing."""

    def __init__(self, close: Callable[[], None]) -> None:
        self._close: Callable[[], None] | None = close

    def close(self) -> None:
        close, self._close = self._close, None
        if close is not None:
            close()


class _Subscriber:
    def __init__(self, session: str, key_expr: str, handler: SampleHandler) -> None:
        self.session = session
        self.key_expr = key_expr
        self.handler = handler
        # A key expression is compared with every key that is put, so each pair is compared once.
        self.matches = lru_cache(maxsize=1024)(lambda key: matches(key_expr, key))


class _Queryable:
    def __init__(self, key: str, handler: QueryHandler, deferred: DeferredAnswers) -> None:
        self.key = key
        self.handler = handler
        self.deferred = deferred


class MemoryHub:
    """What the router is to processes: all declarations of all sessions, and the latched payloads."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self._ids = itertools.count(1)
        self.timestamps = itertools.count(1)
        self.subscribers: dict[int, _Subscriber] = {}
        self.queryables: dict[int, _Queryable] = {}
        self.tokens = Counter[str]()
        """How many sessions hold each token."""
        self.watchers: dict[int, tuple[str, TokenHandler]] = {}
        self.latched: dict[int, RawSample] = {}
        self.publishers: dict[int, Declaration] = {}

    def bus(self) -> Bus:
        """A new session on this hub."""
        return Bus(MemoryTransport(self))

    def new_id(self) -> int:
        """A number for a declaration or a session."""
        return next(self._ids)

    def matching(self, key: str, but_session: str | None) -> list[_Subscriber]:
        """The subscribers of a key, without those of one session."""
        with self.lock:
            return [s for s in self.subscribers.values() if s.session != but_session and s.matches(key)]

    def declarations(self) -> list[Declaration]:
        """The publishers and subscribers of all sessions."""
        with self.lock:
            subscribers = [Declaration(s.key_expr, s.session, False) for s in self.subscribers.values()]
            return [*self.publishers.values(), *subscribers]

    def change_token(self, key: str, by: int) -> None:
        """Count a token up or down, and tell the watchers when it comes or goes."""
        with self.lock:
            before = self.tokens[key]
            self.tokens[key] += by
            alive = self.tokens[key] > 0
            if alive == (before > 0):
                return
            told = [handler for expr, handler in self.watchers.values() if matches(expr, key)]
        for handler in told:
            _tell(handler, key, alive)


def _tell(handler: TokenHandler, key: str, alive: bool) -> None:
    try:
        handler(key, alive)
    except Exception:
        # As over Zenoh: the fault of a watcher is not that of the session with the token.
        log.exception("error in a callback of the bus")


class _Publisher:
    """Puts payloads on one key of a hub."""

    def __init__(self, hub: MemoryHub, session: str, key: str, encoding: str, latched: bool, to_others: bool) -> None:
        self._hub = hub
        self._number = hub.new_id()
        self._session = session
        self._key = key
        self._encoding = encoding
        self._latched = latched
        self._passed_over = session if to_others else None
        self._closed = False
        hub.publishers[self._number] = Declaration(key, session, True)

    @property
    def has_subscribers(self) -> bool:
        if self._closed:
            return False
        return self._latched or bool(self._hub.matching(self._key, self._passed_over))

    def put(self, payload: bytes) -> None:
        hub = self._hub
        with hub.lock:
            if self._closed:
                return
            sample = RawSample(self._key, bytes(payload), self._encoding, next(hub.timestamps), self._session)
            if self._latched:
                hub.latched[self._number] = sample
            subscribers = hub.matching(self._key, self._passed_over)
        for subscriber in subscribers:
            subscriber.handler(sample)

    def close(self) -> None:
        with self._hub.lock:
            self._closed = True
            self._hub.latched.pop(self._number, None)
            self._hub.publishers.pop(self._number, None)


class MemoryTransport:
    """One session on a MemoryHub."""

    def __init__(self, hub: MemoryHub) -> None:
        self._hub = hub
        self.instance = f"{hub.new_id():032x}"
        self._open: list[Closeable] = []
        self._deferred = DeferredAnswers()
        self._closed = False

    def declare_publisher(self, key: str, encoding: str, latched: bool, to_others: bool = False) -> RawPublisher:
        check_use("publish on", key, self._closed)
        publisher = _Publisher(self._hub, self.instance, key, encoding, latched, to_others)
        self._open.append(publisher)
        return publisher

    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, stamped: bool = True
    ) -> Closeable:
        check_use("subscribe to", key_expr, self._closed)
        hub, number = self._hub, self._hub.new_id()
        with hub.lock:
            hub.subscribers[number] = _Subscriber(self.instance, key_expr, handler)
            history = [s for s in hub.latched.values() if latched and matches(key_expr, s.key)]
        for sample in history:
            handler(sample)
        return self._handle(hub.subscribers, number)

    def declare_queryable(self, key: str, handler: QueryHandler) -> Closeable:
        check_use("serve", key, self._closed)
        number = self._hub.new_id()
        self._hub.queryables[number] = _Queryable(key, handler, self._deferred)
        return self._handle(self._hub.queryables, number)

    def get(self, key_expr: str, payload: bytes, timeout: float) -> list[Reply]:
        check_use("ask", key_expr, self._closed)
        end = monotonic() + timeout
        replies: list[Reply] = []
        changed = threading.Condition()

        def take(reply: Reply) -> None:
            with changed:
                replies.append(reply)
                changed.notify_all()

        asked = [q for q in list(self._hub.queryables.values()) if matches(key_expr, q.key)]
        for queryable in asked:
            answer = make_answer(queryable.key, partial(queryable.handler, payload))
            if isinstance(answer, Reply):
                take(answer)
            else:
                queryable.deferred.start(queryable.key, answer, take)
        with changed:
            if not wait_until(changed, lambda: len(replies) == len(asked), max(0.0, end - monotonic())):
                return [*replies, error_reply("Timeout")]
            return replies

    def declarations(self) -> list[Declaration] | None:
        return self._hub.declarations()

    def declare_token(self, key: str) -> Closeable:
        check_use("declare the token", key, self._closed)
        self._hub.change_token(key, 1)
        handle = _Handle(lambda: self._hub.change_token(key, -1))
        self._open.append(handle)
        return handle

    def watch_tokens(self, key_expr: str, handler: TokenHandler) -> Closeable:
        check_use("watch", key_expr, self._closed)
        hub, number = self._hub, self._hub.new_id()
        with hub.lock:
            hub.watchers[number] = (key_expr, handler)
            there = [key for key, count in hub.tokens.items() if count and matches(key_expr, key)]
        for key in there:
            _tell(handler, key, True)
        return self._handle(hub.watchers, number)

    def watch_link(self, handler: Callable[[bool], None]) -> None:
        """The link to a hub is never lost, so `handler` is never called."""

    def close(self) -> None:
        self._closed = True
        opened, self._open = self._open, []
        for handle in opened:
            handle.close()

    def _handle(self, table: dict[int, Any], number: int) -> Closeable:
        def remove() -> None:
            table.pop(number, None)

        handle = _Handle(remove)
        self._open.append(handle)
        return handle
