"""The bus of a team in one process: each node has a session of its own on one MemoryHub, which may be open to the
outside: tools find the nodes there as they find processes.

Whatever a node declares on the hub is declared outside too, by the one session that this process has there. A message
is encoded and sent once for all subscribers outside, and not at all if there is none. Messages carry the id of their
node, so their sender is known outside, and what comes back of them is told from what other processes send.
"""

import logging
import uuid
from collections.abc import Callable
from typing import TypeVar

import msgspec

from zteam.bus import Bus, MemoryHub
from zteam.bus.memory import MemoryTransport, Receiver
from zteam.bus.transport import (
    Closeable,
    QueryHandler,
    RawPublisher,
    RawSample,
    Reply,
    SampleHandler,
    TokenHandler,
    Transport,
)
from zteam.clock import monotonic, monotonic_times, wall_ns
from zteam.in_process.delivery import Delivery, answering_as
from zteam.messages import Message

log = logging.getLogger("zteam")

P = TypeVar("P", bound="_Pair")


def new_instance() -> str:
    """The id of a session that is known outside. Zenoh leaves out zeros at the front, so there is none."""
    return f"{uuid.uuid4().int | 1 << 127:032x}"


class Bridge:
    """The outside of a hub; `outside` is this process's session there, and `inside` one on the hub."""

    def __init__(self, inside: Transport, outside: Bus, delivery: Delivery) -> None:
        self._inside = inside
        self._outside = outside
        self._delivery = delivery
        self._instances: set[str] = set()
        """Sessions of the nodes."""
        self._own_tokens: set[str] = set()
        """Tokens that nodes have, or had: no other node will have one of them."""
        self._tokens: dict[str, Closeable] = {}
        """On the hub, the tokens of processes outside."""
        self._ahead = wall_ns() - next(monotonic_times())
        """Nanoseconds from the time of samples outside to that on the hub."""
        outside.watch_link(self._on_link)
        outside.watch_tokens(["**"], self._on_token)

    def open(self, session: Transport, owner: str) -> "BridgedSession":
        """The session of the node `owner`, on the hub and outside."""
        self._instances.add(session.instance)
        return BridgedSession(session, self, self._outside.transport, owner)

    def from_others(self, owner: str, handler: SampleHandler) -> SampleHandler:
        """Has `handler(sample)` called for samples of others than the nodes, which get those on the hub."""
        instances, receivers = self._instances, [Receiver(owner, handler)]

        def hear(sample: RawSample) -> None:
            if sample.source not in instances:
                news = msgspec.structs.replace(sample, timestamp=self._time_on_hub(sample.timestamp))
                self._delivery.deliver(receivers, news)

        return hear

    def _time_on_hub(self, timestamp: int) -> int:
        """The time of a sample from outside, which is newer or older than those of the hub."""
        return max(1, (timestamp * 10**9 >> 32) - self._ahead) if timestamp else 0

    def declare_token(self, key: str) -> Closeable:
        """A token outside that a node has on the hub."""
        self._own_tokens.add(key)
        return self._outside.declare_token(key)

    def _on_token(self, key: str, alive: bool) -> None:
        if key in self._own_tokens:
            return
        if alive and key not in self._tokens:
            self._tokens[key] = self._inside.declare_token(key)
        elif not alive and key in self._tokens:
            self._tokens.pop(key).close()

    def _on_link(self, up: bool) -> None:
        log.warning("router is back" if up else "router lost: no tool sees the team until it is back")


class _Pair:
    """A declaration on the hub and outside."""

    def __init__(self, inside: Closeable, outside: Closeable, forget: Callable[["_Pair"], None]) -> None:
        self._ends = inside, outside
        self._forget = forget

    def close(self) -> None:
        """Take both back."""
        self._forget(self)
        for end in self._ends:
            end.close()


class _PublisherPair(_Pair):
    """Publishes to the nodes, and to the outside if there is a subscriber."""

    def __init__(self, inside: RawPublisher, outside: RawPublisher, forget: Callable[[_Pair], None]) -> None:
        super().__init__(inside, outside, forget)
        self._inside = inside
        self._outside = outside
        self._put_inside = inside.put_message
        self._hand_over_inside = inside.hand_over

    @property
    def has_subscribers(self) -> bool:
        return self._inside.has_subscribers or self._outside.has_subscribers

    def find_subscribers(self) -> bool:
        return self._inside.find_subscribers() or self._outside.find_subscribers()

    def put(self, payload: bytes) -> None:
        if self._outside.has_subscribers:
            self._outside.put(payload)
        self._inside.put(payload)

    def put_message(self, message: Message) -> None:
        # First outside: what nodes answer to it on the hub, in this very thread, comes after it.
        if self._outside.has_subscribers:
            self._outside.put_message(message)
        self._put_inside(message)

    def hand_over(self, message: Message) -> None:
        if self._outside.has_subscribers:
            self._outside.hand_over(message)
        self._hand_over_inside(message)


class BridgedSession:
    """A session on the hub and outside, under one id."""

    def __init__(self, inside: Transport, bridge: Bridge, outside: Transport, owner: str) -> None:
        """Handlers of the node `owner` are called for what comes from outside as for what comes from the hub."""
        self._inside = inside
        self._bridge = bridge
        self._outside = outside
        self._owner = owner
        self._declared: set[_Pair] = set()
        self.instance = inside.instance

    def _keep(self, pair: P) -> P:
        self._declared.add(pair)
        return pair

    def _pair(self, inside: Closeable, outside: Closeable) -> Closeable:
        return self._keep(_Pair(inside, outside, self._declared.discard))

    def declare_publisher(
        self, key: str, encoding: str, latched: bool, to_others: bool = False, source: str = ""
    ) -> RawPublisher:
        inside = self._inside.declare_publisher(key, encoding, latched, to_others, source)
        # Outside to others alone: on the hub the nodes have it already.
        outside = self._outside.declare_publisher(key, encoding, latched, True, source or self.instance)
        return self._keep(_PublisherPair(inside, outside, self._declared.discard))

    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, stamped: bool = True
    ) -> Closeable:
        inside = self._inside.declare_subscriber(key_expr, handler, latched, stamped)
        heard = self._bridge.from_others(self._owner, handler)
        return self._pair(inside, self._outside.declare_subscriber(key_expr, heard, latched, stamped))

    def declare_queryable(self, key: str, handler: QueryHandler) -> Closeable:
        inside = self._inside.declare_queryable(key, handler)
        return self._pair(inside, self._outside.declare_queryable(key, answering_as(self._owner, handler)))

    def get(self, key_expr: str, payload: bytes, timeout: float, to_others: bool = False) -> list[Reply]:
        end = monotonic() + timeout
        replies = self._inside.get(key_expr, payload, timeout, to_others)
        left = end - monotonic()
        return [*replies, *self._outside.get(key_expr, payload, left, to_others=True)] if left > 0.0 else replies

    def declare_token(self, key: str) -> Closeable:
        inside = self._inside.declare_token(key)
        return self._pair(inside, self._bridge.declare_token(key))

    def watch_tokens(self, key_expr: str, handler: TokenHandler) -> Closeable:
        return self._inside.watch_tokens(key_expr, handler)

    def watch_link(self, handler: Callable[[bool], None]) -> None:
        """The nodes keep each other when the router is lost, so `handler` is never called."""

    def close(self) -> None:
        for pair in list(self._declared):
            pair.close()
        self._inside.close()


class NodeSessions:
    """Opens the sessions of the nodes."""

    def __init__(self, outside: Bus | None = None) -> None:
        """With `outside`, a session of this process alone, nodes and processes there find each other."""
        self.delivery = Delivery()
        self._hub = MemoryHub(self.delivery.deliver, None if outside is None else monotonic_times())
        inside = MemoryTransport(self._hub)
        self._bridge = None if outside is None else Bridge(inside, outside, self.delivery)

    def bus(self, owner: str) -> Bus:
        """A session of the node `owner`."""
        bridge = self._bridge
        if bridge is None:
            return Bus(_Session(self._hub, owner))
        return Bus(bridge.open(_Session(self._hub, owner, new_instance()), owner))

    def close(self) -> None:
        """Handle no more messages."""
        self.delivery.close()


class _Session(MemoryTransport):
    """The session of one node."""

    def declare_queryable(self, key: str, handler: QueryHandler) -> Closeable:
        return super().declare_queryable(key, answering_as(self._owner, handler))
