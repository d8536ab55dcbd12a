"""A bus in the memory of one process: the same keys and behaviour as over Zenoh, for teams and unit tests.

Receivers decode a message, or share the sender's own, which they do not change, if it hands that over. `put` returns
when every subscriber's callback has, and a query's handler runs on the asker's thread (a deferred answer has a thread
of its own, as over Zenoh). Sessions share a `MemoryHub`.
"""

import itertools
import queue
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeVar

from zteam.bus.bus import Bus
from zteam.bus.transport import (
    TIMED_OUT,
    Answers,
    Closeable,
    Handle,
    QueryHandler,
    RawPublisher,
    RawSample,
    Reply,
    SampleHandler,
    TokenHandler,
    Transport,
    call,
    check_use,
    matches,
)
from zteam.clock import monotonic
from zteam.messages import Message
from zteam.messages.cdr import adopt


class HubReceiver(NamedTuple):
    """What a hub delivers to."""

    owner: str
    """Of the session, as the session was told."""
    receive: Callable[[Any], object]


T = TypeVar("T")
Deliver = Callable[[Sequence[HubReceiver], Any], None]


def deliver_now(receivers: Sequence[HubReceiver], news: Any) -> None:
    for _, receive in receivers:
        receive(news)


class _Subscriber(NamedTuple):
    session: str
    key_expr: str
    receiver: HubReceiver


class _Queryable(NamedTuple):
    session: str
    key: str
    handler: QueryHandler
    answers: Answers


class MemoryHub:
    """What the router is to processes: all declarations of all sessions, and the latched payloads."""

    def __init__(self, deliver: Deliver = deliver_now, timestamps: Iterator[int] | None = None) -> None:
        """`deliver(receivers, news)` calls every receiver, in whatever thread.

        `timestamps` are those of samples, if they meet samples of another bus.
        """
        self.deliver = deliver
        self.lock = threading.RLock()
        self._ids = itertools.count(1)
        self.timestamps = timestamps or itertools.count(1)
        self.subscribers: dict[int, _Subscriber] = {}
        self.version = 0
        """Changes with each declaration."""
        self.queryables: dict[int, _Queryable] = {}
        self.tokens = Counter[str]()
        """How many sessions hold each token."""
        self.watchers: dict[int, tuple[str, str, TokenHandler]] = {}
        """Owner, key expression and handler."""
        self.latched: dict[int, RawSample] = {}

    def bus(self) -> Bus:
        """A new session on this hub."""
        return Bus(MemoryTransport(self))

    def new_id(self) -> int:
        """A number for a declaration or a session."""
        return next(self._ids)

    def add(self, table: dict[int, T], entry: T) -> Handle:
        """A declaration, which is in a table of the hub until it is closed."""
        number = self.new_id()

        def remove() -> None:
            with self.lock:
                del table[number]
                self.version += 1

        with self.lock:
            table[number] = entry
            self.version += 1
        return Handle(remove)

    def change_token(self, key: str, by: int) -> None:
        """Count a token up or down, and tell the watchers when it comes or goes."""
        with self.lock:
            before = self.tokens[key]
            self.tokens[key] += by
            alive = self.tokens[key] > 0
            if not alive:
                # Each session has a key of its own.
                del self.tokens[key]
            if alive == (before > 0):
                return
            told = [
                HubReceiver(owner, partial(call, handler, key))
                for owner, expr, handler in self.watchers.values()
                if matches(expr, key)
            ]
        self.deliver(told, alive)


class MemoryTransport(Transport):
    """One session on a MemoryHub."""

    def __init__(self, hub: MemoryHub, owner: str = "", instance: str = "") -> None:
        """`owner` goes to the hub's `deliver` with each of this session's receivers.

        `instance` is this session's id; empty for one that is unique on this hub.
        """
        super().__init__(instance or f"{hub.new_id():032x}")
        self._hub, self._owner = hub, owner

    def declare_publisher(
        self, key: str, encoding: str, latched: bool, to_others: bool = False, source: str = ""
    ) -> RawPublisher:
        check_use("publish on", key, self.closed)
        passed_over, source = self.instance if to_others else "", source or self.instance
        return self._keep(MemoryPublisher(self._hub, key, encoding, latched, passed_over, source))

    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, stamped: bool = True
    ) -> Closeable:
        check_use("subscribe to", key_expr, self.closed)
        hub, receiver = self._hub, HubReceiver(self._owner, handler)
        with hub.lock:
            subscriber = hub.add(hub.subscribers, _Subscriber(self.instance, key_expr, receiver))
            history = [s for s in hub.latched.values() if latched and matches(key_expr, s.key)]
        for sample in sorted(history, key=lambda each: each.timestamp):
            hub.deliver([receiver], sample)
        return self._keep(subscriber)

    def declare_queryable(self, key: str, handler: QueryHandler) -> Closeable:
        check_use("serve", key, self.closed)
        queryable = _Queryable(self.instance, key, handler, self._answers)
        return self._keep(self._hub.add(self._hub.queryables, queryable))

    def get(self, key_expr: str, payload: bytes, timeout: float, to_others: bool = False) -> list[Reply]:
        check_use("ask", key_expr, self.closed)
        end = monotonic() + timeout
        come: queue.SimpleQueue[Reply] = queue.SimpleQueue()
        passed_over = self.instance if to_others else None
        served = list(self._hub.queryables.values())
        asked = [q for q in served if q.session != passed_over and matches(key_expr, q.key)]
        for queryable in asked:
            queryable.answers.answer(queryable.key, partial(queryable.handler, key_expr, payload), come.put)
        replies: list[Reply] = []
        for _ in asked:
            try:
                replies.append(come.get(timeout=max(0.0, end - monotonic())))
            except queue.Empty:
                return [*replies, TIMED_OUT]
        return replies

    def declare_token(self, key: str) -> Closeable:
        check_use("declare the token", key, self.closed)
        self._hub.change_token(key, 1)
        return self._keep(Handle(lambda: self._hub.change_token(key, -1)))

    def watch_tokens(self, key_expr: str, handler: TokenHandler) -> Closeable:
        check_use("watch", key_expr, self.closed)
        hub = self._hub
        with hub.lock:
            watch = hub.add(hub.watchers, (self._owner, key_expr, handler))
            there = [key for key, count in hub.tokens.items() if count and matches(key_expr, key)]
        for key in there:
            hub.deliver([HubReceiver(self._owner, partial(call, handler, key))], True)
        return self._keep(watch)


class MemoryPublisher(Handle):
    """Publishes on one key of a hub."""

    def __init__(self, hub: MemoryHub, key: str, encoding: str, latched: bool, passed_over: str, source: str) -> None:
        """The session `passed_over` gets nothing. `source` is the session id that its samples carry."""
        super().__init__(self._end)
        self._hub, self._number = hub, hub.new_id()
        self._key, self._encoding, self._latched = key, encoding, latched
        self._passed_over, self._source = passed_over, source
        self._closed = False
        self._matching: tuple[int, list[HubReceiver]] = (-1, [])
        """The hub's `version` when the subscribers were looked for, and what they take samples with."""

    def _receivers(self) -> list[HubReceiver]:
        version, receivers = self._matching
        hub, but = self._hub, self._passed_over
        if version != hub.version:
            with hub.lock:
                found = [s for s in hub.subscribers.values() if s.session != but and matches(s.key_expr, self._key)]
                # Set at once: another thread may look in between.
                self._matching = _, receivers = hub.version, [subscriber.receiver for subscriber in found]
        return receivers

    @property
    def has_subscribers(self) -> bool:
        return (self._latched or bool(self._receivers())) and not self._closed

    def put(self, content: bytes | Message) -> None:
        hub = self._hub
        if not isinstance(content, bytes):
            content = adopt(content)
        if not self._latched:
            if not self._closed and (receivers := self._receivers()):
                hub.deliver(receivers, self._sample(content))
            return
        with hub.lock:
            if self._closed:
                return
            hub.latched[self._number] = sample = self._sample(content)
            receivers = self._receivers()
        hub.deliver(receivers, sample)

    def _sample(self, content: bytes | Message) -> RawSample:
        return RawSample(self._key, content, self._encoding, next(self._hub.timestamps), self._source)

    def _end(self) -> None:
        with self._hub.lock:
            self._closed = True
            self._hub.latched.pop(self._number, None)
