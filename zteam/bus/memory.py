"""A bus in the memory of one process: the same keys and behaviour as over Zenoh, for teams and unit tests.

Receivers decode a message, or share the sender's own, which they do not change, if it hands that over. `put` returns
when every subscriber's callback has, and a query's handler runs on the asker's thread (a deferred answer has a thread
of its own, as over Zenoh). Sessions share a `MemoryHub`.
"""

import itertools
import queue
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

from zteam.bus import transport
from zteam.bus.bus import Bus
from zteam.bus.transport import Closeable, Handle, RawSample, Reply, SampleHandler, Transport, call, check_use, matches
from zteam.clock import monotonic, monotonic_times
from zteam.messages import Message
from zteam.messages.cdr import adopt


class HubReceiver(NamedTuple):
    """What a hub delivers to."""

    owner: str
    """Of the session, as the session was told."""
    receive: Callable[[Any], object]


def deliver_now(receivers: Sequence[HubReceiver], news: Any) -> None:
    for _, receive in receivers:
        receive(news)


class _Entry(NamedTuple):
    """A subscriber, a queryable or a watcher of tokens."""

    session: str
    key_expr: str
    receiver: HubReceiver
    from_others: bool = False
    """Of a subscriber: whether it gets nothing from its own session."""


class MemoryHub:
    """What the router is to processes: all declarations of all sessions, and the latched payloads."""

    def __init__(
        self,
        deliver: Callable[[Sequence[HubReceiver], Any], None] = deliver_now,
        settle: Callable[[], object] = lambda: None,
    ) -> None:
        """`deliver(receivers, news)` calls every receiver, in whatever thread; `settle()` waits for what it has left to
        another one."""
        self.deliver, self.settle = deliver, settle
        self.lock = threading.RLock()
        self.ids = itertools.count(1)
        self.timestamps = monotonic_times()
        """Of samples."""
        self.subscribers: dict[int, _Entry] = {}
        self.queryables: dict[int, _Entry] = {}
        self.watchers: dict[int, _Entry] = {}
        self.version = 0
        """Changes with each declaration."""
        self.tokens = Counter[str]()
        """How many sessions hold each token."""
        self.latched: dict[int, RawSample] = {}

    def bus(self) -> Bus:
        return Bus(MemoryTransport(self))

    def add(self, table: dict[int, _Entry], entry: _Entry) -> Handle:
        """A declaration, which is in a table of the hub until it is closed."""
        number = next(self.ids)

        def remove() -> None:
            with self.lock:
                del table[number]
                self.version += 1

        with self.lock:
            table[number] = entry
            self.version += 1
        return Handle(remove)

    def find(
        self, table: dict[int, _Entry], key_expr: str, but: str | None = None, sender: str = ""
    ) -> list[HubReceiver]:
        """The receivers in a table for some key of `key_expr`, without those of the session `but`, and without those
        of the session `sender` that take nothing from their own.
        """
        with self.lock:
            return [
                e.receiver
                for e in table.values()
                if e.session != but and not (e.from_others and e.session == sender) and matches(e.key_expr, key_expr)
            ]

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
            told = self.find(self.watchers, key)
        self.deliver(told, (key, alive))


class MemoryTransport(Transport):
    """One session on a MemoryHub."""

    def __init__(self, hub: MemoryHub, owner: str = "", instance: str = "") -> None:
        """`owner` goes to the hub's `deliver` with each of this session's receivers.

        `instance` is this session's id; empty for one that is unique on this hub.
        """
        super().__init__(instance or f"{next(hub.ids):032x}")
        self._hub, self._owner = hub, owner

    def declare_publisher(
        self, key: str, encoding: str, latched: bool, to_others: bool = False, source: str = ""
    ) -> transport.RawPublisher:
        check_use("publish on", key, self.closed)
        passed_over, source = self.instance if to_others else "", source or self.instance
        return self._keep(MemoryPublisher(self._hub, key, encoding, latched, passed_over, source, self.instance))

    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, from_others: bool = False
    ) -> Closeable:
        check_use("subscribe to", key_expr, self.closed)
        hub, receiver, own = self._hub, HubReceiver(self._owner, handler), self.instance if from_others else None
        with hub.lock:
            subscriber = self._add(hub.subscribers, key_expr, receiver, from_others)
            history = [s for s in hub.latched.values() if latched and s.source != own and matches(key_expr, s.key)]
        for sample in sorted(history, key=lambda each: each.timestamp):
            hub.deliver([receiver], sample)
        return subscriber

    def when_caught_up(self, call: Callable[[], object]) -> None:
        # After the messages that were delivered before.
        self._hub.deliver([HubReceiver(self._owner, lambda _: call())], None)

    def _add(
        self, table: dict[int, _Entry], key_expr: str, receiver: HubReceiver, from_others: bool = False
    ) -> Closeable:
        return self._keep(self._hub.add(table, _Entry(self.instance, key_expr, receiver, from_others)))

    def declare_queryable(self, key: str, handler: transport.QueryHandler) -> Closeable:
        check_use("serve", key, self.closed)

        def receive(query: tuple[str, bytes, Callable[[Reply], object]]) -> None:
            asked, payload, send = query
            self._answers.answer(key, partial(handler, asked, payload), send)

        return self._add(self._hub.queryables, key, HubReceiver(self._owner, receive))

    def get(self, key_expr: str, payload: bytes, timeout: float, to_others: bool = False) -> list[Reply]:
        check_use("ask", key_expr, self.closed)
        end = monotonic() + timeout
        come: queue.SimpleQueue[Reply] = queue.SimpleQueue()
        asked = self._hub.find(self._hub.queryables, key_expr, self.instance if to_others else None)
        # On the asker's own thread.
        deliver_now(asked, (key_expr, payload, come.put))
        replies: list[Reply] = []
        for _ in asked:
            try:
                replies.append(come.get(timeout=max(0.0, end - monotonic())))
            except queue.Empty:
                return [*replies, transport.TIMED_OUT]
        return replies

    def settle(self) -> None:
        self._hub.settle()

    def declare_token(self, key: str) -> Closeable:
        check_use("declare the token", key, self.closed)
        self._hub.change_token(key, 1)
        return self._keep(Handle(lambda: self._hub.change_token(key, -1)))

    def watch_tokens(self, key_expr: str, handler: transport.TokenHandler) -> Closeable:
        check_use("watch", key_expr, self.closed)
        hub, receiver = self._hub, HubReceiver(self._owner, lambda news: call(handler, *news))
        with hub.lock:
            watch = self._add(hub.watchers, key_expr, receiver)
            there = [key for key, count in hub.tokens.items() if count and matches(key_expr, key)]
        for key in there:
            hub.deliver([receiver], (key, True))
        return watch


class MemoryPublisher(Handle):
    """Publishes on one key of a hub."""

    def __init__(
        self, hub: MemoryHub, key: str, encoding: str, latched: bool, passed_over: str, source: str, sender: str
    ) -> None:
        """Of the session `sender`. The session `passed_over` gets nothing. `source` is the session id that its samples
        carry.
        """
        super().__init__(self._end)
        self._hub, self._number = hub, next(hub.ids)
        self._key, self._encoding, self._latched = key, encoding, latched
        self._passed_over, self._source, self._sender = passed_over, source, sender
        self._closed = False
        self._matching: tuple[int, list[HubReceiver]] = (-1, [])
        """The hub's `version` when the subscribers were looked for, and what they take samples with."""

    def _find(self) -> list[HubReceiver]:
        hub = self._hub
        with hub.lock:
            # Set at once: another thread may look in between.
            found = hub.find(hub.subscribers, self._key, self._passed_over, self._sender)
            self._matching = _, receivers = hub.version, found
        return receivers

    @property
    def has_subscribers(self) -> bool:
        version, receivers = self._matching
        if version != self._hub.version:
            receivers = self._find()
        return (self._latched or bool(receivers)) and not self._closed

    def put(self, content: bytes | Message) -> None:
        if not isinstance(content, bytes):
            adopt(content)
        hub = self._hub
        if self._latched:
            with hub.lock:
                if self._closed:
                    return
                sample = RawSample(self._key, content, self._encoding, next(hub.timestamps), self._source)
                hub.latched[self._number] = sample
                receivers = self._find()
            hub.deliver(receivers, sample)
            return
        version, receivers = self._matching
        if version != hub.version:
            receivers = self._find()
        if receivers and not self._closed:
            hub.deliver(receivers, RawSample(self._key, content, self._encoding, next(hub.timestamps), self._source))

    def _end(self) -> None:
        with self._hub.lock:
            self._closed = True
            self._hub.latched.pop(self._number, None)
