"""The typed bus: messages instead of bytes, and nothing on the wire that can crash a process."""

import logging
from collections.abc import Callable, Sequence
from typing import Any, Generic, NamedTuple, TypeVar

import msgspec

from zteam.bus.changes import Addressees, Change, check_instance
from zteam.bus.counters import MAX_KEYS, Counters
from zteam.bus.transport import Closeable, RawPublisher, RawSample, Transport
from zteam.errors import BusError, DecodeError
from zteam.messages import Message, decode, encode, encoding_of
from zteam.names import is_wildcard, stats_key

log = logging.getLogger("zteam.bus")

M = TypeVar("M", bound=Message)
Request = TypeVar("Request", bound=msgspec.Struct)
T = TypeVar("T")

_CDR = "application/cdr"
MAX_PAYLOAD = 64 * 1024 * 1024
"""Bytes of a message, a request or an answer; a map of 4000 x 4000 cells has 16 MB. What is larger is not decoded."""


class Publisher(Generic[M]):
    """Puts messages of one type on one key."""

    def __init__(self, raw: RawPublisher) -> None:
        self._raw = raw

    @property
    def has_subscribers(self) -> bool:
        """Whether anybody takes what is put now: lets a sender spare itself the making of a message."""
        return self._raw.has_subscribers

    def put(self, message: M) -> None:
        """Send without waiting (DROP: nothing on the bus ever blocks its sender)."""
        self._raw.put(encode(message))

    def close(self) -> None:
        """Undeclare; late subscribers of a latched key get nothing from here on."""
        self._raw.close()


class NoRequest(msgspec.Struct):
    """The request of a query that needs none."""


class Deferred(NamedTuple):
    """An answer that takes its time: what `finish()` returns, called on a thread of its own."""

    finish: Callable[[], Any]


class Bus:
    """One process's place on the bus. Callbacks run on the transport's threads and must be quick."""

    def __init__(self, transport: Transport) -> None:
        self.transport = transport
        self.counters = Counters()
        self._addressees = Addressees(self.query)

    @property
    def instance(self) -> str:
        """This session's id."""
        return self.transport.instance

    def publisher(
        self, key: str, message_type: type[M], *, latched: bool = False, to_others: bool = False
    ) -> Publisher[M]:
        """A publisher of `message_type` on `key`; `latched` keeps the last message for late subscribers.

        With `to_others`, subscribers of this very session neither get it nor make it wanted.
        """
        return Publisher(self.transport.declare_publisher(key, encoding_of(message_type), latched, to_others))

    def subscribe(
        self,
        key_expr: str,
        message_type: type[M],
        callback: Callable[[str, M], None],
        *,
        latched: bool = False,
    ) -> Closeable:
        """Call `callback(key, message)` for every message that decodes; the others are counted and dropped.

        With `latched`, the newest message of each key that was put before counts too, and an older one that
        arrives after a newer one (two writers) is passed over.
        """
        newest: dict[str, int] = {}

        def handle(sample: RawSample) -> None:
            message = self.decode(sample, message_type)
            if message is not None:
                callback(sample.key, message)

        def handle_latched(sample: RawSample) -> None:
            if 0 < sample.timestamp <= newest.get(sample.key, 0):
                return
            message = self.decode(sample, message_type)
            if message is None:
                return
            if sample.key in newest or len(newest) < MAX_KEYS:
                newest[sample.key] = sample.timestamp
            callback(sample.key, message)

        return self._subscribe(key_expr, handle_latched if latched else handle, latched, stamped=latched)

    def subscribe_raw(
        self, key_expr: str, callback: Callable[[RawSample], None], *, latched: bool = False
    ) -> Closeable:
        """Call `callback` with undecoded samples: for tools that learn the type from the encoding."""
        return self._subscribe(key_expr, callback, latched, stamped=True)

    def subscribe_payloads(
        self, key_expr: str, message_type: type[Message], callback: Callable[[str, bytes], None]
    ) -> Closeable:
        """Call `callback(key, payload)` for what should be such messages, for who reads them in a way of his own.

        A payload for which `callback` raises DecodeError is counted as dropped.
        """

        def take(sample: RawSample) -> None:
            callback(sample.key, sample.payload)

        def handle(sample: RawSample) -> None:
            self._read(sample, message_type, take)

        return self._subscribe(key_expr, handle, latched=False, stamped=False)

    def decode(self, sample: RawSample, message_type: type[M]) -> M | None:
        """The sample's message, counted; None if it is refused (the counters say why)."""
        return self._read(sample, message_type, lambda raw: decode(message_type, raw.payload))

    def _read(self, sample: RawSample, message_type: type[Message], read: Callable[[RawSample], T]) -> T | None:
        wanted = encoding_of(message_type)
        if is_wildcard(sample.key):
            self.counters.drop(sample.key, "its key is a wildcard, so it is addressed to nobody")
            return None
        if sample.encoding.startswith(_CDR + ";") and sample.encoding != wanted:
            self.counters.drop(sample.key, f"it is {sample.encoding}, not {wanted}")
            return None
        try:
            found = read(sample)
        except DecodeError as error:
            self.counters.drop(sample.key, str(error))
            return None
        self.counters.receive(sample.key)
        return found

    def _subscribe(
        self, key_expr: str, callback: Callable[[RawSample], None], latched: bool, stamped: bool
    ) -> Closeable:
        def guarded(sample: RawSample) -> None:
            if len(sample.payload) > MAX_PAYLOAD:
                self.counters.drop(sample.key, _too_large(sample.payload))
                return
            try:
                callback(sample)
            except Exception:
                # A fault in one callback must not end the subscription, and the bus is the last to see it.
                log.exception("error while handling a message on %s", sample.key)

        return self.transport.declare_subscriber(key_expr, guarded, latched, stamped)

    def query(
        self, key_expr: str, reply_type: type[T], request: msgspec.Struct | None = None, *, timeout: float = 2.0
    ) -> list[tuple[str, T]]:
        """Ask everyone who serves `key_expr`; (key, reply) pairs sorted by key, empty if nobody serves it.

        A `Change` without an instance gets that of the process that serves the key. Raises BusError with the server's
        text if the only answers are errors.
        """
        if isinstance(request, Change) and not request.instance:
            return self._addressees.query(key_expr, reply_type, request, timeout)
        payload = msgspec.json.encode(request if request is not None else NoRequest())
        good: list[tuple[str, T]] = []
        bad: list[str] = []
        for key, body, error in self.transport.get(key_expr, payload, timeout):
            if error:
                bad.append(f"{key or key_expr}: {body.decode(errors='replace')}")
                continue
            try:
                good.append((key, _decode_json(body, reply_type)))
            except DecodeError as fault:
                bad.append(f"{key}: unreadable answer: {fault}")
        if bad and not good:
            raise BusError("; ".join(bad))
        return sorted(good, key=lambda pair: pair[0])

    def ask(self, key: str, reply_type: type[T], request: msgspec.Struct | None = None, *, timeout: float = 2.0) -> T:
        """The first answer to a query on one key. Raises BusError when nobody answers."""
        answers = self.query(key, reply_type, request, timeout=timeout)
        if not answers:
            raise BusError(f"nobody answers the query {key}: see 'zteam node list' for who is alive")
        return answers[0][1]

    def serve(self, key: str, request_type: type[Request], handler: Callable[[Request], Any]) -> Closeable:
        """Answer queries on `key` with what `handler(request)` returns, as JSON.

        A request that does not decode, a `Change` that names another process or none, and any ZteamError of the handler
        go to the asker as a text. A handler that has to wait returns a `Later`.
        """

        def handle(payload: bytes) -> bytes | Callable[[], bytes]:
            try:
                request = _decode_json(payload or b"{}", request_type)
            except DecodeError as error:
                self.counters.drop(key, f"bad request: {error}")
                raise BusError(f"bad request: {error}") from None
            if isinstance(request, Change):
                check_instance(key, request, self.instance)
            answer = handler(request)
            if isinstance(answer, Deferred):
                return lambda: msgspec.json.encode(answer.finish())
            return msgspec.json.encode(answer)

        return self.transport.declare_queryable(key, handle)

    def serve_stats(self, name: str) -> Closeable:
        """Answer `<name>/stats` with this process's counters."""
        return self.serve(stats_key(name), NoRequest, lambda _: self.counters.snapshot())

    def declare_token(self, key: str) -> Closeable:
        """A presence token, gone with this process."""
        return self.transport.declare_token(key)

    def watch_tokens(self, key_exprs: Sequence[str], callback: Callable[[str, bool], None]) -> list[Closeable]:
        """Call `callback(key, alive)` for tokens that are there, come or go."""
        return [self.transport.watch_tokens(key_expr, callback) for key_expr in key_exprs]

    def watch_link(self, callback: Callable[[bool], None]) -> None:
        """Call `callback(up)` when the router is lost or back."""
        self.transport.watch_link(callback)

    def close(self) -> None:
        """End the session; a second call does nothing. What is still open when the interpreter ends is closed then."""
        self.transport.close()


def _too_large(payload: bytes) -> str:
    return f"its {len(payload)} bytes are more than {MAX_PAYLOAD}"


def _decode_json(payload: bytes, kind: type[T]) -> T:
    """A request or an answer. Raises DecodeError."""
    if len(payload) > MAX_PAYLOAD:
        raise DecodeError(_too_large(payload))
    try:
        return msgspec.json.decode(payload, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise DecodeError(str(error)) from None
    except RecursionError:
        raise DecodeError("it is nested too deeply") from None
