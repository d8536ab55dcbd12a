"""The typed bus: messages, queries and presence tokens over any transport."""

import logging
import os
import socket
import sys
import threading
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Generic, NamedTuple, TypeVar

import msgspec

from zteam.bus.options import BusOptions
from zteam.bus.receiving import Receiver
from zteam.bus.rights import RightCheck, Use
from zteam.bus.transport import (
    TIMED_OUT,
    Closeable,
    Declaration,
    Finish,
    Handle,
    Held,
    RawPublisher,
    RawSample,
    Reply,
    SampleHandler,
    Transport,
    check_use,
    decode_json,
    matches,
)
from zteam.errors import BusError, DecodeError, QueryError, QueryTimeoutError, UsageError
from zteam.messages import Message, encode, encoding_of
from zteam.messages.message import REGISTERED, check_message_type, definition_of
from zteam.messages.topics import is_in_ticks, is_own
from zteam.names import ANSWERS, PUBLISHES, declarations_key, session_info_key, split_token_key, stats_key

M = TypeVar("M", bound=Message)
T = TypeVar("T")
Request = TypeVar("Request", bound=msgspec.Struct)
log = logging.getLogger("zteam.bus")

LATCHED = "?latched"
"""Behind a key expression in `Bus.reads`, as the parameters of a selector stand in Zenoh."""
MOST_SESSIONS = 16
"""Sessions that are asked: a sender can invent them."""
_Text = Annotated[str, msgspec.Meta(max_length=255)]
_DECLARATIONS_TIMEOUT = 1.0
"""Host seconds that other sessions have to tell their declarations; those of a frozen process are missing."""


class NoRequest(msgspec.Struct):
    """The request of a query that needs none."""


class Change(msgspec.Struct, kw_only=True):
    """A request that changes something; the base of all such requests.

    A query on a wildcard, such as `**`, reaches every query of every process: it changes nothing.
    """

    wildcard: ClassVar[str] = ""
    """The only wildcard that may ask for it; empty for none."""


class Deferred(NamedTuple):
    """An answer that takes its time: `finish()` returns it and is called on a thread of its own."""

    finish: Callable[[], Any]


class SessionRequest(msgspec.Struct):
    """Asks a session which process it is, and whether it publishes on a key."""

    key: _Text = ""
    type: _Text = ""
    """The ROS name of a message type."""


class SessionInfo(msgspec.Struct):
    """Answer to `@session/<instance>/info`: which process this is, tools included, as it says."""

    name: _Text
    """That of the process on the bus, or the command of a tool."""
    host: _Text
    pid: Annotated[int, msgspec.Meta(ge=0, le=2**32 - 1)]
    publishes: bool = False
    """Whether it publishes on the key that it was asked for."""
    definition: str = ""
    """Of the type that it was asked for, as in `ros2msg` schemas; empty where it does not know that type."""

    def __str__(self) -> str:
        return f"{self.name} (process {self.pid} on {self.host})"


def _read_replies(key_expr: str, replies: Iterable[Reply], reply_type: type[T]) -> list[tuple[str, T]]:
    """(key, answer) pairs sorted by key. Raises QueryError if there are errors and no answer."""
    good: list[tuple[str, T]] = []
    bad: list[tuple[str, str]] = []
    error: type[QueryError] = QueryTimeoutError
    for reply in replies:
        if reply is not TIMED_OUT:
            error = QueryError
        if reply.error:
            bad.append((reply.key or key_expr, reply.payload.decode(errors="replace")))
            continue
        try:
            good.append((reply.key, decode_json(reply.payload, reply_type)))
        except DecodeError as fault:
            bad.append((reply.key, f"unreadable answer: {fault}"))
    if bad and not good:
        raise error("; ".join(map(": ".join, bad)), "; ".join(why for _, why in bad))
    return sorted(good, key=lambda pair: pair[0])


def _is_screened(key_expr: str) -> bool:
    """Whether it is asked which session has sent what comes. Raises BusError for what is no key expression."""
    check_use("subscribe to", key_expr, False)
    return not is_own(key_expr)


def _command() -> str:
    """That of this process, such as `zteam teleop`."""
    path = Path(sys.argv[0])
    if path.name == "zteam" or path.parts[-2:] == ("zteam", "__main__.py"):
        return " ".join(["zteam", *sys.argv[1:2]])
    return "python" if path.name in ("", "-c") else path.name


class _Reader(NamedTuple):
    """A subscription."""

    key_expr: str
    latched: bool
    handler: SampleHandler


class SentCount:
    """How many messages were sent. It has no lock: in a tick, one thread publishes."""

    sent = 0


class Publisher(Held[RawPublisher], Generic[M]):
    """Publishes messages of one type on one key, from its opening on."""

    def __init__(
        self,
        key: str,
        message_type: type[M],
        latched: bool,
        declare: Callable[[], RawPublisher],
        forget: Callable[[], object],
        count: "SentCount",
    ) -> None:
        """`declare()` opens it on the transport; `forget()` is called when it is closed; `count` is of its messages."""

        def open_raw() -> RawPublisher:
            raw = declare()
            if latched and self._kept is not None:
                raw.put(self._kept)
            return raw

        super().__init__(open_raw)
        self._forget = forget
        self._key = key
        self._type = message_type
        self._latched = latched
        self._count = count
        self._kept: bytes | M | None = None
        """The last message from before its opening."""

    @property
    def has_subscribers(self) -> bool:
        """Whether a message that is put now has a subscriber; if not, the caller need not make the message.

        Always True for a latched publisher, whose last message late subscribers get, until it is closed.
        """
        raw = self._handle
        return self._latched and not self._closed if raw is None else raw.has_subscribers

    def put(self, message: M) -> None:
        """Send without waiting: a message that finds no room in the queue is dropped. After `close` nothing is sent.

        Raises UsageError if it is no message of the publisher's type.
        """
        if type(message) is not self._type:
            raise UsageError(f"{self._key} carries {self._type.__name__}: put was given a {type(message).__name__}")
        self.put_owned(encode(message))

    def put_owned(self, message: M | bytes) -> None:
        """As `put`, in less time, for a message that was made to be sent: neither it nor what it holds will be changed.

        In memory its receivers get this very message, so its numbers are plain and finite ones; only float32 fields are
        still narrowed, and arrays become read-only. An array that is read-only already has the type of its field.
        """
        if self._handle is None:
            with self._lock:
                # Unless it has been opened meanwhile.
                if self._handle is None:
                    self._kept = message
                    return
        self._count.sent += 1
        self._handle.put(message)

    def close(self) -> None:
        """Undeclare the publisher; from now on late subscribers of a latched key get nothing of it."""
        self._forget()
        super().close()


class Bus:
    """One session. Callbacks run on the transport's threads: they must be quick and must not ask the bus.

    After `close`, declarations and queries raise BusError; so does a key that is no key expression.
    """

    def __init__(
        self, transport: Transport, rights: RightCheck | None = None, options: BusOptions | None = None
    ) -> None:
        """With `rights` where the router may have an access control."""
        self.transport, self.instance = transport, transport.instance
        self.options = options
        """How it is connected, for another process that is to join the same team; None in memory."""
        self._rights = rights
        self.counters = Receiver()
        self._waiting: list[Callable[[], None]] | None = None
        """What opens the publishers and queries that are held."""
        self._lock = threading.Lock()
        self._declared: dict[object, Declaration] = {}
        self._readers: dict[object, _Reader] = {}
        self.in_ticks, self._beside = SentCount(), SentCount()
        """Of what belongs to ticks in lock-step (`is_in_ticks`), and of the rest."""
        self.reads_version = 0
        """Changes with what `reads` returns."""
        self.name = ""
        """Of the process on the bus; empty for a tool without one."""
        self.serve(declarations_key(self.instance), NoRequest, lambda _: self._own_declarations(), at_once=True)
        self.serve(session_info_key(self.instance), SessionRequest, self._tell_process, at_once=True)
        if rights is not None:
            self.watch_link(lambda up: rights.check_again(self._publishing() if up else ()))

    def hold(self) -> None:
        """From now on publishers and queries wait for `release`: others see nothing of a process without its name.

        Messages are dropped; of a latched publisher the release sends the last.
        """
        self._waiting = []

    def release(self) -> None:
        """Open what waits, in the order in which it came."""
        with self._lock:
            waiting, self._waiting = self._waiting, None
        for open_now in waiting or ():
            open_now()

    def open(self, declared: Held[Any]) -> None:
        """Open it now, or at the release."""
        with self._lock:
            if self._waiting is not None:
                self._waiting.append(declared.open)
                return
        declared.open()

    def publisher(
        self, key: str, message_type: type[M], *, latched: bool = False, to_others: bool = False
    ) -> Publisher[M]:
        """A publisher of `message_type` on `key`; `latched` keeps the last message for late subscribers.

        With `to_others`, subscribers of the same session get nothing from it and do not count as its subscribers.
        """
        check_message_type(key, message_type)
        check_use("publish on", key, False)

        def declare() -> RawPublisher:
            self._check_later(Use(key, PUBLISHES))
            return self.transport.declare_publisher(key, encoding_of(message_type), latched, to_others)

        count = self.in_ticks if is_in_ticks(key) else self._beside
        publisher = Publisher(key, message_type, latched, declare, self._list(key, True), count)
        self.open(publisher)
        return publisher

    def _subscribe(
        self,
        key_expr: str,
        handler: SampleHandler,
        latched: bool = False,
        *,
        screened: bool = True,
        from_others: bool = False,
    ) -> Closeable:
        screened = screened and _is_screened(key_expr)
        # What the simulator takes for others is theirs: it is no reader for people.
        forget, place = (lambda: None) if from_others else self._list(key_expr, False), object()
        if screened:
            self._readers[place] = _Reader(key_expr, latched, handler)
            self.reads_version += 1
        subscriber = self.transport.declare_subscriber(key_expr, handler, latched, from_others)
        return Handle(forget, lambda: self._readers.pop(place, None), subscriber.close)

    def reads(self) -> list[str]:
        """The key expressions that are subscribed to, sorted; with `?latched` behind those of latched subscriptions."""
        readers = list(self._readers.values())
        return sorted({each.key_expr + LATCHED * each.latched for each in readers})

    def hand_in(self, sample: RawSample) -> None:
        """Handle a sample that has come in another way than over a subscription, as all subscribers to its key."""
        for reader in list(self._readers.values()):
            if matches(reader.key_expr, sample.key):
                reader.handler(sample)

    def _list(self, key: str, publishes: bool) -> Callable[[], object]:
        """List what is about to be opened, so before others notice it; the call that takes it off the list again."""
        place = object()
        self._declared[place] = Declaration(key, self.instance, publishes)
        return lambda: self._declared.pop(place, None)

    def subscribe(
        self,
        key_expr: str,
        message_type: type[M],
        callback: Callable[[str, M], None],
        *,
        latched: bool = False,
        problem: Callable[[RawSample], str] | None = None,
    ) -> Closeable:
        """Call `callback(key, message)` for every message that decodes; the others are counted and dropped.

        With `latched`, also call it with the last message of each key that was put before, if it has several writers
        with the newest one of theirs. `problem(sample)` says why a sample is dropped, and is empty for those that are
        not.
        """
        check_message_type(key_expr, message_type)
        screened = _is_screened(key_expr)
        handler = self.counters.messages(message_type, callback, latched=latched, problem=problem, screened=screened)
        return self._subscribe(key_expr, handler, latched)

    def subscribe_from(
        self,
        key_expr: str,
        message_type: type[M],
        callback: Callable[[str, M, str], None],
        problem: Callable[[RawSample], str] | None = None,
        *,
        latched: bool = False,
        screened: bool = True,
    ) -> Closeable:
        """As `subscribe`, but call `callback(key, message, source)` with the id of the session that sent it.

        Unless `screened`, whatever comes counts (`Receiver.sessions`), and it is none of what the process `reads`. So
        it is with keys of which lock-step's own processes are the writers (`is_own`): to ask for the sender takes time.
        """
        check_message_type(key_expr, message_type)
        screened = screened and _is_screened(key_expr)
        handler = self.counters.messages(
            message_type, callback, latched=latched, with_source=True, problem=problem, screened=screened
        )
        return self._subscribe(key_expr, handler, latched, screened=screened)

    def subscribe_raw(
        self,
        key_expr: str,
        callback: Callable[[RawSample], None],
        *,
        latched: bool = False,
        only: type[Message] | None = None,
        from_others: bool = False,
        screened: bool = True,
    ) -> Closeable:
        """Call `callback` with undecoded samples: for tools that learn the type from the encoding.

        With `only`, those of other types are dropped; with `from_others`, those of this session do not come. `screened`
        is that of `subscribe_from`.
        """
        handler = self.counters.samples(callback, only, latched=latched, screened=screened)
        return self._subscribe(key_expr, handler, latched, screened=screened, from_others=from_others)

    def query(
        self, key_expr: str, reply_type: type[T], request: msgspec.Struct | None = None, *, timeout: float = 2.0
    ) -> list[tuple[str, T]]:
        """Ask all processes that serve `key_expr`; (key, answer) pairs sorted by key, empty if none serves it.

        Raises BusError with the server's text if the only answers are errors.
        """
        payload = msgspec.json.encode(request if request is not None else NoRequest())
        answers = _read_replies(key_expr, self.transport.get(key_expr, payload, timeout), reply_type)
        if not answers and isinstance(request, Change) and self._rights is not None:
            raise BusError(f"no answer: no process serves {key_expr}, or this process's certificate may not ask for it")
        return answers

    def find(
        self, key_expr: str, reply_type: type[T], request: msgspec.Struct | None = None, *, timeout: float = 2.0
    ) -> list[tuple[str, T]]:
        """As `query`, but empty also if the only answers are errors, such as that of a process that is frozen."""
        try:
            return self.query(key_expr, reply_type, request, timeout=timeout)
        except BusError as error:
            log.debug("%s", error)
            return []

    def ask(self, key: str, reply_type: type[T], request: msgspec.Struct | None = None, *, timeout: float = 2.0) -> T:
        """The first answer to a query on one key. Raises BusError when there is none."""
        answers = self.query(key, reply_type, request, timeout=timeout)
        if not answers:
            raise BusError(f"no process answers the query {key}: 'zteam node list' shows those that are alive")
        return answers[0][1]

    def serve(
        self, key: str, request_type: type[Request], handler: Callable[[Request], Any], *, at_once: bool = False
    ) -> Held[Closeable]:
        """Answer queries on `key` with what `handler(request)` returns, as JSON; `at_once` also while others wait.

        The asker gets an error text if the request does not decode, if it is a `Change` asked for by a wildcard, and if
        the handler raises. A handler that has to wait returns a `Deferred`.
        """

        def handle(asked: str, payload: bytes) -> bytes | Finish:
            if issubclass(request_type, Change) and asked not in (key, request_type.wildcard):
                raise BusError(f"{key} changes something: ask for it by this key, not by the wildcard {asked}")
            try:
                request = decode_json(payload or b"{}", request_type)
            except DecodeError as error:
                self.counters.drop(key, f"bad request: {error}")
                raise BusError(f"bad request: {error}") from None
            answer = handler(request)
            if isinstance(answer, Deferred):
                return lambda: msgspec.json.encode(answer.finish())
            return msgspec.json.encode(answer)

        def declare() -> Closeable:
            # A claim on a name answers at once, and is refused where another process holds the name.
            if not at_once:
                self._check_later(Use(key, ANSWERS))
            return self.transport.declare_queryable(key, handle)

        served = Held(declare)
        served.open() if at_once else self.open(served)
        return served

    def serve_stats(self, name: str) -> Closeable:
        """Answer `<name>/stats` with this process's counters."""
        return self.serve(stats_key(name), NoRequest, lambda _: self.counters.snapshot())

    def declare_token(self, key: str) -> Closeable:
        """A presence token, which ends with this process."""
        if not self.name and (token := split_token_key(key)) is not None:
            self.name = token[0]
        return self.transport.declare_token(key)

    def is_hidden(self, token: str) -> bool:
        """Whether the router's access control keeps a token of this process from all others."""
        return self._rights is not None and self._rights.is_hidden(token)

    def check_right(self, *keys: str) -> None:
        """Raise BusError if the router's access control drops what this process publishes on one of the keys.

        For what people command: with certificates it opens a session. Of every other publisher, and of queries that are
        served, the log says so a moment after they are opened.
        """
        if self._rights is not None:
            self._rights.check([Use(key, PUBLISHES) for key in keys])

    def _check_later(self, use: Use) -> None:
        if self._rights is not None:
            self._rights.check_later(use)

    def _publishing(self) -> list[Use]:
        return [Use(each.key, PUBLISHES) for each in list(self._declared.values()) if each.publishes]

    def _tell_process(self, request: SessionRequest) -> SessionInfo:
        publishes = any(each.key == request.key and each.publishes for each in list(self._declared.values()))
        name, kind = self.name or _command(), REGISTERED.get(request.type)
        definition = "" if kind is None else definition_of(kind)
        return SessionInfo(name[:255], socket.gethostname()[:255], os.getpid(), publishes, definition)

    def _own_declarations(self) -> list[Declaration]:
        found, rights = list(self._declared.values()), self._rights
        if rights is None:
            return found
        return [each._replace(dropped=each.publishes and rights.refuses(Use(each.key, PUBLISHES))) for each in found]

    def watch_tokens(self, key_exprs: Sequence[str], callback: Callable[[str, bool], None]) -> list[Closeable]:
        """Call `callback(key, alive)` for tokens that are there, come or go."""
        return [self.transport.watch_tokens(key_expr, callback) for key_expr in key_exprs]

    def declarations(self) -> list[Declaration]:
        """The publishers and subscribers of all other sessions of zteam: each tells its own.

        Those of other programs are missing. The router knows them, but zteam never asks it: a router that answers such
        a query of its admin space, such as `@/*/router/publisher/**`, takes the lock of its tables a second time. If a
        session opens in between, the router stands still for ever, and with it the whole team
        (https://github.com/eclipse-zenoh/zenoh/pull/2619). Its own record, `@/*/router`, needs no such lock.
        """
        asked = declarations_key("*")
        replies = self.transport.get(asked, b"", _DECLARATIONS_TIMEOUT, to_others=True)
        try:
            answers = _read_replies(asked, replies, list[Declaration])
        except BusError:
            # There are other sessions, but no readable answer has come in time.
            return []
        return [declaration for _, told in answers for declaration in told]

    def watch_link(self, callback: Callable[[bool], None]) -> None:
        """Call `callback(up)` when the link to the router is lost or back."""
        self.transport.watch_link(callback)

    def close(self) -> None:
        """End the session; a second call does nothing. The interpreter's end closes a session that is still open."""
        self.transport.close()
