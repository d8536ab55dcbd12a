"""The bus of a team in one process: each node has a session of its own on one MemoryHub, which may be open to the
outside: tools find the nodes there as they find processes.

Whatever a node declares on the hub is declared outside too, by the one session that this process has there. A message
is encoded and sent once for all subscribers outside, and not at all if there is none. Messages carry the id of their
node, so their sender is known outside, and what comes back of them is told from what other processes send.
"""

import threading
import uuid
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from threading import get_ident
from typing import Any

from zteam.bus import Bus, MemoryHub
from zteam.bus.memory import HubReceiver, MemoryTransport
from zteam.bus.transport import Closeable, Handle, QueryHandler, RawPublisher, RawSample, Reply, SampleHandler
from zteam.clock import monotonic, monotonic_times, wall_ns
from zteam.errors import log
from zteam.messages import Message
from zteam.node.working import CALLS, WORK, Work, working_for


class Delivery:
    """Brings what is put on a hub to the handlers of the nodes.

    Over Zenoh a message is handled on a thread of the bus, so `put` never waits for a lock of the receiver. Here the
    nodes have threads too. If each of them called the handlers of what it puts, two threads that hold the locks of two
    nodes could wait for each other. So only one thread, the simulator's, calls handlers in `put`. What the others put
    is handled by one more thread, in the order in which it came.

    As with a router, a message reaches all its receivers before anything that one of them sends because of it: a node
    that answers a tick is not heard in that tick by a node that has not got it yet.
    """

    def __init__(self) -> None:
        self.direct = 0
        """The thread that calls handlers itself; 0 = none."""
        self._work: Work
        """Of that thread."""
        self._posted: deque[tuple[Sequence[HubReceiver], Any]] = deque()
        """What the other threads put. The first one is being handled."""
        self._following: deque[tuple[Sequence[HubReceiver], Any]] = deque()
        """What the direct thread put, and handlers that it called."""
        self._changed = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._handle_posted, name="messages", daemon=True)
        self._thread.start()

    def deliver_in_this_thread(self) -> None:
        """From now on this thread calls the handlers of what it puts."""
        self.direct = get_ident()
        self._work = WORK[self.direct]

    def deliver(self, receivers: Sequence[HubReceiver], news: Any) -> None:
        """Call the receivers, or have them called. The hub calls this in the thread that puts a message."""
        following = self._following
        if get_ident() != self.direct:
            self._post([(receivers, news)])
        elif self._posted:
            # This one may be newer than one of the same publisher that waits, and those that follow are older.
            self._post([*following, (receivers, news)])
            following.clear()
        else:
            following.append((receivers, news))
            work = self._work
            if work.call:
                # A handler has put this.
                return
            node = work.node
            try:
                while following:
                    receivers, news = following.popleft()
                    work.call = next(CALLS)
                    for work.node, receive in receivers:
                        receive(news)
            finally:
                work.node, work.call = node, 0

    def settle(self) -> None:
        """Wait until what was put so far is handled. Not for handlers."""
        if self._posted:
            settled = threading.Event()
            self._post([([HubReceiver("", lambda _: settled.set())], None)])
            settled.wait()

    def _post(self, news: list[tuple[Sequence[HubReceiver], Any]]) -> None:
        with self._changed:
            self._posted += news
            self._changed.notify()

    def _handle_posted(self) -> None:
        work = WORK[get_ident()]
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._posted or self._closed)
                if self._closed:
                    return
            receivers, news = self._posted[0]
            for work.node, receive in receivers:
                work.call = next(CALLS)
                try:
                    receive(news)
                except BaseException:
                    # As over Zenoh: it does not end the thread, which serves all nodes.
                    log.exception("error in a callback of the bus")
            work.node, work.call = "", 0
            self._posted.popleft()

    def close(self) -> None:
        """Forget what is not handled yet."""
        with self._changed:
            self._closed = True
            self._changed.notify()


def answering_as(owner: str, handler: QueryHandler) -> QueryHandler:
    """Calls `handler(asked, payload)` as the node `owner`, and what it returns if that takes its time."""
    as_owner = working_for(owner)

    def answer(asked: str, payload: bytes) -> bytes | Callable[[], bytes]:
        made = as_owner(handler)(asked, payload)
        return as_owner(made) if callable(made) else made

    return answer


class _PublisherPair(Handle):
    """Publishes to the nodes, and to the outside if there is a subscriber."""

    def __init__(self, inside: RawPublisher, outside: RawPublisher) -> None:
        super().__init__(inside.close, outside.close)
        self._inside, self._outside = inside, outside

    @property
    def has_subscribers(self) -> bool:
        return self._inside.has_subscribers or self._outside.has_subscribers

    def put(self, content: bytes | Message) -> None:
        # First outside: what nodes answer to it on the hub, in this very thread, comes after it.
        if self._outside.has_subscribers:
            self._outside.put(content)
        self._inside.put(content)


class _Session(MemoryTransport):
    def declare_queryable(self, key: str, handler: QueryHandler) -> Closeable:
        return super().declare_queryable(key, answering_as(self._owner, handler))


class _BridgedSession(_Session):
    """The session of one node on the hub and outside, under one id."""

    def __init__(self, hub: MemoryHub, owner: str, sessions: "NodeSessions", outside: Bus) -> None:
        # Zenoh leaves out zeros at the front of an id, so there is none.
        super().__init__(hub, owner, f"{uuid.uuid4().int | 1 << 127:032x}")
        self._sessions, self._outside_bus, self._outside = sessions, outside, outside.transport
        sessions.instances.add(self.instance)

    def _pair(self, inside: Closeable, outside: Closeable) -> Closeable:
        return self._keep(Handle(inside.close, outside.close))

    def declare_publisher(
        self, key: str, encoding: str, latched: bool, to_others: bool = False, source: str = ""
    ) -> RawPublisher:
        inside = super().declare_publisher(key, encoding, latched, to_others, source)
        # Outside to others alone: on the hub the nodes have it already.
        outside = self._outside.declare_publisher(key, encoding, latched, True, source or self.instance)
        return self._keep(_PublisherPair(inside, outside))

    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, from_others: bool = False
    ) -> Closeable:
        inside = super().declare_subscriber(key_expr, handler, latched, from_others)
        sessions, receivers = self._sessions, [HubReceiver(self._owner, handler)]

        def hear(sample: RawSample) -> None:
            # What nodes send comes on the hub.
            if (source := sample.source) not in sessions.instances:
                time, delay = sessions.time_on_hub(sample.timestamp), sample.delay
                news = RawSample(sample.key, sample.content, sample.encoding, time, source, delay)
                sessions.delivery.deliver(receivers, news)

        return self._pair(inside, self._outside.declare_subscriber(key_expr, hear, latched))

    def when_caught_up(self, call: Callable[[], object]) -> None:
        self._outside.when_caught_up(partial(super().when_caught_up, call))

    def declare_queryable(self, key: str, handler: QueryHandler) -> Closeable:
        inside = super().declare_queryable(key, handler)
        return self._pair(inside, self._outside.declare_queryable(key, answering_as(self._owner, handler)))

    def get(self, key_expr: str, payload: bytes, timeout: float, to_others: bool = False) -> list[Reply]:
        end = monotonic() + timeout
        replies = super().get(key_expr, payload, timeout, to_others)
        left = end - monotonic()
        return [*replies, *self._outside.get(key_expr, payload, left, to_others=True)] if left > 0.0 else replies

    def declare_token(self, key: str) -> Closeable:
        self._sessions.own_tokens.add(key)
        return self._pair(super().declare_token(key), self._outside_bus.declare_token(key))


class NodeSessions:
    """Opens the sessions of the nodes."""

    def __init__(self, outside: Bus | None = None) -> None:
        """With `outside`, a session of this process alone, nodes and processes there find each other."""
        self.delivery = Delivery()
        self._hub = MemoryHub(self.delivery.deliver, self.delivery.settle)
        self._inside, self._outside = MemoryTransport(self._hub), outside
        self.instances: set[str] = set()
        """Sessions of the nodes that are open to the outside."""
        self.own_tokens: set[str] = set()
        """Tokens that nodes have, or had: no other node will have one of them."""
        self._tokens: dict[str, Closeable] = {}
        """On the hub, the tokens of processes outside."""
        self._ahead = wall_ns() - next(monotonic_times())
        """Nanoseconds from the time of samples outside to that on the hub."""
        if outside is not None:
            outside.watch_link(self._on_link)
            outside.watch_tokens(["**"], self._on_token)

    def bus(self, owner: str) -> Bus:
        outside = self._outside
        return Bus(_Session(self._hub, owner) if outside is None else _BridgedSession(self._hub, owner, self, outside))

    def close(self) -> None:
        """Handle no more messages."""
        self.delivery.close()

    def time_on_hub(self, timestamp: int) -> int:
        """The time of a sample from outside, which is newer or older than those of the hub."""
        return max(1, (timestamp * 10**9 >> 32) - self._ahead) if timestamp else 0

    def _on_token(self, key: str, alive: bool) -> None:
        if key in self.own_tokens:
            return
        if alive and key not in self._tokens:
            self._tokens[key] = self._inside.declare_token(key)
        elif not alive and key in self._tokens:
            self._tokens.pop(key).close()

    def _on_link(self, up: bool) -> None:
        log.warning("router is back" if up else "router lost: no tool sees the team until it is back")
