"""What the typed bus needs of whatever carries its bytes: Zenoh, or memory in unit tests."""

from collections.abc import Callable
from typing import NamedTuple, Protocol


class RawSample(NamedTuple):
    """One payload as it came."""

    key: str
    payload: bytes
    encoding: str
    """`application/cdr;sensor_msgs/msg/LaserScan`; empty where the sender named none."""
    timestamp: int = 0
    """NTP64 time from the session that stamped it first, normally the sender's; 0 where there is none."""
    source: str = ""
    """Id of the session that stamped it; empty where there is none. A sender without time-stamping shows as the
    router."""


class Reply(NamedTuple):
    """One answer to a query; `error` tells that `payload` is the error's text."""

    key: str
    payload: bytes
    error: bool


class Declaration(NamedTuple):
    """A publisher or a subscriber of some session."""

    key: str
    """A key expression."""
    session: str
    publishes: bool


class Closeable(Protocol):
    """A declaration on the bus that can be taken back."""

    def close(self) -> None:
        """Take it back; a second call does nothing."""
        ...


class RawPublisher(Closeable, Protocol):
    """Puts payloads on one key."""

    @property
    def has_subscribers(self) -> bool:
        """Whether a payload put now has a subscriber; always True for a latched publisher, False once closed."""
        ...

    def put(self, payload: bytes) -> None:
        """Send without waiting: a payload that finds no room is dropped."""
        ...


SampleHandler = Callable[[RawSample], None]
QueryHandler = Callable[[bytes], bytes | Callable[[], bytes]]
"""Answers a query's payload at once, or with a call that may take its time."""
TokenHandler = Callable[[str, bool], None]


AskDeclarations = Callable[[], list[Declaration] | None]


class Transport(Protocol):
    """Sessions, in the words of Zenoh. Handlers are called from the transport's threads and must be quick.

    After `close`, declarations and `get` raise BusError; so does a key that is no key expression.
    """

    @property
    def instance(self) -> str:
        """This session's id, unique among all sessions."""
        ...

    def declare_publisher(self, key: str, encoding: str, latched: bool, to_others: bool = False) -> RawPublisher:
        """A publisher; a latched one keeps its last payload for late subscribers.

        With `to_others` it does not reach subscribers of its own session.
        """
        ...

    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, stamped: bool = True
    ) -> Closeable:
        """A subscriber; a latched one also gets what was put before it came.

        Without `stamped`, samples have neither time nor source: reading those takes as long as the rest.
        """
        ...

    def declare_queryable(self, key: str, handler: QueryHandler) -> Closeable:
        """Answer queries on `key`; what `handler` raises goes to the asker as an error text.

        An answer that takes its time is made on a thread of its own.
        """
        ...

    def get(self, key_expr: str, payload: bytes, timeout: float) -> list[Reply]:
        """Ask and wait for all answers, `timeout` seconds at most; then an error reply says `Timeout`."""
        ...

    def declare_token(self, key: str) -> Closeable:
        """A token that lives as long as this session."""
        ...

    def watch_tokens(self, key_expr: str, handler: TokenHandler) -> Closeable:
        """Call `handler(key, alive)` for tokens that are there, come or go."""
        ...

    def declarations(self) -> list[Declaration] | None:
        """The publishers and subscribers of all sessions; None if the router does not tell of them."""
        ...

    def watch_link(self, handler: Callable[[bool], None]) -> None:
        """Call `handler(up)` when the link to the router is lost or back."""
        ...

    def close(self) -> None:
        """Undeclare everything and end the session; a second call does nothing."""
        ...
