"""The typed bus: messages, queries and presence tokens over any transport."""

from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

import msgspec

from zteam.bus.changes import Addressees, Change
from zteam.bus.counters import Counters
from zteam.bus.queries import NoRequest, Request, query_handler, read_replies
from zteam.bus.receiving import Receiver
from zteam.bus.transport import Closeable, Declaration, RawPublisher, RawSample, Transport
from zteam.errors import BusError, UsageError
from zteam.messages import Message, encode, encoding_of
from zteam.names import stats_key

M = TypeVar("M", bound=Message)
T = TypeVar("T")


def check_message_type(key: str, message_type: Any) -> None:
    """Raise UsageError if `message_type`, which goes over `key`, is no class of messages."""
    if not (isinstance(message_type, type) and issubclass(message_type, Message)):
        shown = getattr(message_type, "__name__", None) or repr(message_type)
        raise UsageError(f"{key}: {shown} is no message type; take a class of zteam.messages, such as Twist")


class Publisher(Generic[M]):
    """Publishes messages of one type on one key."""

    def __init__(self, raw: RawPublisher, key: str, message_type: type[M]) -> None:
        self._raw = raw
        self._key = key
        self._type = message_type

    @property
    def has_subscribers(self) -> bool:
        """Whether a message that is put now has a subscriber; if not, the caller need not make the message.

        Always True for a latched publisher, whose last message late subscribers get, until it is closed.
        """
        return self._raw.has_subscribers

    def put(self, message: M) -> None:
        """Send without waiting: a message that finds no room in the queue is dropped. After `close` nothing is sent.

        Raises UsageError if it is no message of the publisher's type.
        """
        if type(message) is not self._type:
            raise UsageError(f"{self._key} carries {self._type.__name__}: put was given a {type(message).__name__}")
        self._raw.put(encode(message))

    def close(self) -> None:
        """Undeclare the publisher; from now on late subscribers of a latched key get nothing of it."""
        self._raw.close()


class Bus:
    """One session. Callbacks run on the transport's threads: they must be quick and must not ask the bus.

    After `close`, declarations and queries raise BusError; so does a key that is no key expression.
    """

    def __init__(self, transport: Transport) -> None:
        self.transport = transport
        self.counters = Counters()
        self._receiver = Receiver(self.counters)
        self._addressees = Addressees(self.query)

    @property
    def instance(self) -> str:
        """This session's id."""
        return self.transport.instance

    def publisher(
        self, key: str, message_type: type[M], *, latched: bool = False, to_others: bool = False
    ) -> Publisher[M]:
        """A publisher of `message_type` on `key`; `latched` keeps the last message for late subscribers.

        With `to_others`, subscribers of the same session get nothing from it and do not count as its subscribers.
        """
        check_message_type(key, message_type)
        raw = self.transport.declare_publisher(key, encoding_of(message_type), latched, to_others)
        return Publisher(raw, key, message_type)

    def subscribe(
        self, key_expr: str, message_type: type[M], callback: Callable[[str, M], None], *, latched: bool = False
    ) -> Closeable:
        """Call `callback(key, message)` for every message that decodes; the others are counted and dropped.

        With `latched`, also call it with the last message of each key that was put before. A message that is older
        than one handled before is then skipped, such as that of a second writer.
        """
        check_message_type(key_expr, message_type)
        make = self._receiver.latched_messages if latched else self._receiver.messages
        return self.transport.declare_subscriber(key_expr, make(message_type, callback), latched, latched)

    def subscribe_raw(
        self, key_expr: str, callback: Callable[[RawSample], None], *, latched: bool = False
    ) -> Closeable:
        """Call `callback` with undecoded samples: for tools that learn the type from the encoding."""
        return self.transport.declare_subscriber(key_expr, self._receiver.guarded(callback), latched, True)

    def subscribe_payloads(
        self, key_expr: str, message_type: type[Message], callback: Callable[[str, bytes], None]
    ) -> Closeable:
        """Call `callback(key, payload)` with undecoded messages of one type, for callers that decode them themselves.

        A payload for which `callback` raises DecodeError is counted as dropped.
        """
        return self.transport.declare_subscriber(
            key_expr, self._receiver.payloads(message_type, callback), False, False
        )

    def decode(self, sample: RawSample, message_type: type[M]) -> M | None:
        """The sample's message, counted; None if it is refused (the counters say why)."""
        return self._receiver.decode(sample, message_type)

    def query(
        self, key_expr: str, reply_type: type[T], request: msgspec.Struct | None = None, *, timeout: float = 2.0
    ) -> list[tuple[str, T]]:
        """Ask all processes that serve `key_expr`; (key, answer) pairs sorted by key, empty if none serves it.

        A `Change` without an instance gets that of the process that serves the key. Raises BusError with the server's
        text if the only answers are errors.
        """
        if isinstance(request, Change) and not request.instance:
            return self._addressees.query(key_expr, reply_type, request, timeout)
        payload = msgspec.json.encode(request if request is not None else NoRequest())
        return read_replies(key_expr, self.transport.get(key_expr, payload, timeout), reply_type)

    def ask(self, key: str, reply_type: type[T], request: msgspec.Struct | None = None, *, timeout: float = 2.0) -> T:
        """The first answer to a query on one key. Raises BusError when there is none."""
        answers = self.query(key, reply_type, request, timeout=timeout)
        if not answers:
            raise BusError(f"no process answers the query {key}: 'zteam node list' shows those that are alive")
        return answers[0][1]

    def serve(self, key: str, request_type: type[Request], handler: Callable[[Request], Any]) -> Closeable:
        """Answer queries on `key` with what `handler(request)` returns, as JSON.

        The asker gets an error text if the request does not decode, if it is a `Change` that names another process or
        none, and if the handler raises. A handler that has to wait returns a `Deferred`.
        """
        handle = query_handler(key, request_type, handler, self.instance, self.counters)
        return self.transport.declare_queryable(key, handle)

    def serve_stats(self, name: str) -> Closeable:
        """Answer `<name>/stats` with this process's counters."""
        return self.serve(stats_key(name), NoRequest, lambda _: self.counters.snapshot())

    def declare_token(self, key: str) -> Closeable:
        """A presence token, which ends with this process."""
        return self.transport.declare_token(key)

    def watch_tokens(self, key_exprs: Sequence[str], callback: Callable[[str, bool], None]) -> list[Closeable]:
        """Call `callback(key, alive)` for tokens that are there, come or go."""
        return [self.transport.watch_tokens(key_expr, callback) for key_expr in key_exprs]

    def declarations(self) -> list[Declaration] | None:
        """The publishers and subscribers of all other sessions; None if the router does not tell of them."""
        found = self.transport.declarations()
        return found and [declaration for declaration in found if declaration.session != self.instance]

    def watch_link(self, callback: Callable[[bool], None]) -> None:
        """Call `callback(up)` when the link to the router is lost or back."""
        self.transport.watch_link(callback)

    def close(self) -> None:
        """End the session; a second call does nothing. The interpreter's end closes a session that is still open."""
        self.transport.close()
