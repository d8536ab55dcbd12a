"""The Zenoh transport: one session, everything declared on it, and an orderly end.

Zenoh calls for messages on its own thread, for all else on a thread of Python's.
"""

import atexit
import ctypes
import logging
import queue
import sys
import threading
from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

import zenoh
import zenoh.ext

from zteam.bus import transport
from zteam.bus.latched import LatchedSubscription, LatchedSubscriptions, Writer
from zteam.bus.options import ROUTER_ANSWER
from zteam.bus.sockets import LinkCount, limit_silence
from zteam.bus.transport import Closeable, Handle, RawSample, Reply, SampleHandler, Transport, check_use, zenoh_text
from zteam.clock import NS_PER_S, monotonic, pause, stamp_ns, to_seconds
from zteam.errors import BusError
from zteam.messages import Message, encode
from zteam.names import fixed_part, latched_tokens_key

log = logging.getLogger("zteam.bus")

T = TypeVar("T")

_TIMEOUT = b"Timeout"
"""What Zenoh's own timer says of a query."""
_MOST = 0.9
"""Of a time-out: a query that ends after this share of it without a reply has timed out."""
_CACHE = zenoh.ext.CacheConfig(1)
_NUMBERED = zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=None)
_BYTES, _PUT = zenoh.Encoding("zenoh/bytes"), zenoh.SampleKind.PUT
_THREAD = threading.local()
LOOK_PERIOD = 30.0
"""Host seconds without news after which all tokens are looked at."""
_TRIES, _AGAIN = 1000, 0.001
"""To undeclare what another thread uses, and host seconds between two; what stays so long ends with the session."""
_LATCHED_TIMEOUT = 10.0
"""Host seconds for a latched publisher's last message, which may be a large map on a slow link."""
_UNNUMBERED = "uhlc"
"""In place of a number in the token of a publisher whose samples are not numbered; none of zteam's."""


def _stay() -> None:
    """Make the interpreter keep its state of the current thread, one of Zenoh's own.

    Otherwise it makes that state for every callback and throws it away afterwards: 16 KB of stack mapped and unmapped,
    with their page faults, which takes as long as a short callback. An `Ensure` without its `Release` keeps it.

    Python has not started this thread, so coverage and debuggers see it only from here on.
    """
    ctypes.pythonapi.PyGILState_Ensure()
    _THREAD.stays = True
    if (trace := threading.gettrace()) is not None:
        sys.settrace(trace)


class Aside:
    """A thread of its own on which Zenoh's callbacks call handlers, in order.

    Zenoh offers the same with a thread for each callback. But those are no daemons, so at exit the interpreter would
    wait for them, and each costs a process 40 KB.
    """

    def __init__(self, period: float | None = None, on_idle: Callable[[], None] = lambda: None) -> None:
        """Each time nothing has come for `period` host seconds, `on_idle()` is called on the thread."""
        self._period, self._on_idle = period, on_idle
        self._waiting: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work, name="bus", daemon=True)
        self._thread.start()

    def callback(self, handler: Callable[[T], None]) -> Any:
        """A Zenoh callback that calls `handler`, which must not wait long: it keeps others from being called."""
        put = self._waiting.put
        return zenoh.handlers.Callback(lambda event: put(partial(transport.call, handler, event)), indirect=False)

    def do(self, work: Callable[[], object]) -> None:
        """Call `work()` on the thread."""
        self._waiting.put(partial(transport.call, work))

    def end(self) -> None:
        """End the thread when all that waits has been handled, and wait for that a moment."""
        self._waiting.put(None)
        transport.let_end(self._thread)

    def _work(self) -> None:
        while True:
            try:
                work = self._waiting.get(timeout=self._period)
            except queue.Empty:
                work = self._on_idle
            if work is None:
                return
            work()


class ZenohSample(RawSample):
    """One message of Zenoh. Its time stamp is read where it is asked for: that takes as long as the rest."""

    sample: Any = None

    def _time(self) -> int:
        stamp = self.sample.timestamp
        return 0 if stamp is None else int(str(stamp.get_time_as_ntp64()))

    def _session(self) -> str:
        try:
            return str(self.sample.timestamp.get_id())
        except AttributeError:
            # It has no time stamp.
            return ""

    def _measure_delay(self) -> float:
        time = self._time()
        return to_seconds(stamp_ns() - (time * NS_PER_S >> 32)) if time else 0.0

    # In place of the fields.
    timestamp = property(_time)
    source = property(_session)
    delay = property(_measure_delay)

    @property
    def writer(self) -> Writer:
        """Its publisher, as that one's token names it."""
        info = self.sample.source_info
        if info is None:
            return self.key, self.source, _UNNUMBERED
        return self.key, str(info.source_id.zid), str(info.source_id.eid)


def sample_callback(handle: Callable[[ZenohSample], object]) -> Callable[[zenoh.Sample], None]:
    """What Zenoh calls with the samples of one subscription, or the replies to one query.

    It is on Zenoh's own thread: no other has to wake up, and messages of all keys are handled in their order.
    """
    newest = _BYTES, ""
    """The encoding of the sample before, and its text, which takes long to make."""

    def on_sample(sample: zenoh.Sample) -> None:
        nonlocal newest
        if not hasattr(_THREAD, "stays"):
            _stay()
        payload = sample.payload.to_bytes()
        if not payload and sample.kind != _PUT:
            # What was deleted has no bytes.
            return
        encoding, text = newest
        if sample.encoding != encoding:
            encoding = sample.encoding
            text = "" if encoding == _BYTES else str(encoding)
            newest = encoding, text
        handle(ZenohSample(str(sample.key_expr), payload, text, sample=sample))

    return on_sample


def _undeclare(entity: Any) -> None:
    for _ in range(_TRIES):
        try:
            entity.undeclare()
            return
        except zenoh.ZError as error:
            log.debug("undeclare: %s", zenoh_text(error))
            return
        except RuntimeError:
            # "Already borrowed": another thread is putting a message, and Zenoh's Python does not wait for it.
            pause(_AGAIN)
    log.debug("undeclare: another thread uses it still")


def stamping_as(session: str) -> Callable[[], zenoh.Timestamp]:
    """Makes time stamps with the id of a session, each later than the one before; their clock is never set.

    Zenoh's own need clocks that agree. A session or router that makes them refuses those that are more than 0.5 s ahead
    of its clock: it writes another one with its own id, so the sender is no longer known. And it takes over a clock
    that is less far ahead: between two messages from there its own stamps stand still.
    """
    # As Zenoh writes its ids: the last byte comes first, and zeros at the front are left out.
    name = zenoh.TimestampId(bytes.fromhex(session.zfill(2 * -(-len(session) // 2)))[::-1])
    make, time = zenoh.Timestamp, zenoh.NTP64
    return lambda: make(time(*divmod(stamp_ns(), NS_PER_S)), name)


class ZenohPublisher(Handle):
    """Publishes on one key."""

    def __init__(self, entity: Any, latched: bool, stamp: Callable[[], zenoh.Timestamp]) -> None:
        """`stamp()` makes the time stamps of samples."""
        super().__init__(self._end, partial(_undeclare, entity))
        self._entity: Any = entity
        self.has_subscribers = True
        self._stamp = stamp
        if not latched:
            # A listener instead of a question for each message: every call into Zenoh releases the interpreter lock.
            self._lock, self._told = threading.Lock(), False
            callback: Any = zenoh.handlers.Callback(self._on_matching, indirect=False)
            self._listener = entity.declare_matching_listener(callback)
            now = entity.matching_status.matching
            with self._lock:
                # The listener's word is newer than the answer.
                if not self._told:
                    self.has_subscribers = now

    def _end(self) -> None:
        self._entity, self.has_subscribers = None, False

    def _on_matching(self, status: Any) -> None:
        with self._lock:
            self.has_subscribers, self._told = status.matching and self._entity is not None, True

    def put(self, content: bytes | Message) -> None:
        payload = content if isinstance(content, bytes) else encode(content)
        entity = self._entity
        if entity is None:
            return
        try:
            entity.put(payload, timestamp=self._stamp())
        except zenoh.ZError as error:
            log.debug("put: the message is dropped: %s", zenoh_text(error))
        except RuntimeError:
            # "Already mutably borrowed": another thread closes it just now.
            if self._entity is not None:
                raise


class TokenWatch(Handle):
    """Tells a handler of tokens that are there, come or go. `receive` and `look` are called on one thread."""

    def __init__(self, session: zenoh.Session, key_expr: str, handler: transport.TokenHandler, thread: Aside) -> None:
        """The handler is called on `thread`. Raises zenoh.ZError."""
        self._session, self._key_expr, self._handler = session, key_expr, handler
        self._alive: set[str] = set()
        self._missing: set[str] = set()
        """Those that were alive, and that the last look did not find."""

        def on_token(sample: zenoh.Sample) -> None:
            self.receive(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        callback = thread.callback(on_token)
        super().__init__(partial(_undeclare, session.liveliness().declare_subscriber(key_expr, callback, history=True)))

    def receive(self, key: str, alive: bool) -> None:
        (self._alive.add if alive else self._alive.discard)(key)
        self._handler(key, alive)

    def look(self) -> None:
        """Take those as gone that two answers of the router in a row did not have."""
        begin = monotonic()
        try:
            replies = self._session.liveliness().get(self._key_expr, timeout=ROUTER_ANSWER)
            there = {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}
        except zenoh.ZError as error:
            log.debug("tokens: %s", zenoh_text(error))
            return
        # An answer may be empty though tokens are there (1 of 60 sessions just after its start), or come too late.
        if not there & self._alive or monotonic() - begin >= ROUTER_ANSWER:
            return
        missing = self._alive - there
        for key in sorted(missing & self._missing):
            log.debug("the end of %s was not told", key)
            transport.call(partial(self.receive, alive=False), key)
        self._missing = missing


def _reply(query: zenoh.Query, reply: Reply) -> None:
    try:
        with query:
            if reply.error:
                query.reply_err(reply.payload)
            else:
                query.reply(reply.key, reply.payload)
    except zenoh.ZError as error:
        # The session was closed meanwhile: the asker sees its queries end.
        log.debug("reply: %s", zenoh_text(error))


class ZenohTransport(Transport):
    """An open Zenoh session seen as a Transport."""

    def __init__(self, session: zenoh.Session) -> None:
        super().__init__(str(session.zid()))
        self._session = session
        self._stamp = stamping_as(self.instance)
        # Every answer counts: two processes that claim one name both serve its keys.
        self._get = partial(session.get, target=zenoh.QueryTarget.ALL, consolidation=zenoh.ConsolidationMode.NONE)
        self._ids: dict[str, object] = {}
        """Key expressions that are declared for the life of the session."""
        self._latched = LatchedSubscriptions(
            self.instance, self._subscribe_latched, self._find_latched, self._ask_latched
        )
        self._link_handlers: list[Callable[[bool], None]] = []
        self._links = LinkCount()
        self.up = True
        # Answers do not wait for what a change of presence leads to.
        self._queries, self._presence = Aside(), Aside(LOOK_PERIOD, self._look_at_tokens)
        callback = self._presence.callback(self._on_transport)
        # Closed before the session: its own end would be told too, perhaps while the interpreter ends already.
        self._hold(session.info.declare_transport_events_listener(callback, history=True))
        # A script may end without closing: then this does it, while Zenoh can still call into the session.
        atexit.register(self.close)

    def _hold(self, entity: Any) -> Closeable:
        return self._keep(Handle(partial(_undeclare, entity)))

    def _declare(self, action: str, key: str, declare: Callable[[], Any]) -> Closeable:
        """Keep what `declare()` makes until it is closed. Raises BusError."""
        return self._hold(self._make(action, key, declare))

    def _make(self, action: str, key: str, declare: Callable[[], T]) -> T:
        check_use(action, key, self.closed)
        try:
            return declare()
        except zenoh.ZError as error:
            # Closed since the check.
            raise BusError(f"cannot {action} {key}: {zenoh_text(error)}") from None

    def _keep_id(self, key_expr: str) -> None:
        """Call this before a publisher, subscriber or queryable is declared.

        Zenoh gives its key expression, or the part before a wildcard, a number, and takes it back with the last that
        needs it. But routes that it has found keep that number: messages on a key that another subscription matches,
        and queries, are then lost for good (docs/zenoh-report.md). A number that is held is never taken back.
        """
        if (fixed := fixed_part(key_expr)) and fixed not in self._ids:
            self._ids[fixed] = self._session.declare_keyexpr(fixed)

    def declare_publisher(
        self, key: str, encoding: str, latched: bool, to_others: bool = False, source: str = ""
    ) -> transport.RawPublisher:
        options: dict[str, Any] = {
            "encoding": zenoh.Encoding(encoding),
            "congestion_control": zenoh.CongestionControl.DROP,
            "allowed_destination": zenoh.Locality.REMOTE if to_others else zenoh.Locality.ANY,
        }

        def declare() -> Any:
            self._keep_id(key)
            if not latched:
                return self._session.declare_publisher(key, **options)
            # Numbered: without a clock of its own, a session keeps no message that is not.
            return zenoh.ext.declare_advanced_publisher(
                self._session, key, cache=_CACHE, publisher_detection=True, sample_miss_detection=_NUMBERED, **options
            )

        entity = self._make("publish on", key, declare)
        return self._keep(ZenohPublisher(entity, latched, stamping_as(source) if source else self._stamp))

    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, from_others: bool = False
    ) -> Closeable:
        if latched:
            check_use("subscribe to", key_expr, self.closed)
            return self._latched.subscribe(key_expr, handler, from_others)
        return self._subscribe(key_expr, handler, from_others)

    def _subscribe(self, key_expr: str, handle: Callable[[ZenohSample], object], from_others: bool) -> Closeable:
        def declare() -> Any:
            self._keep_id(key_expr)
            callback: Any = zenoh.handlers.Callback(sample_callback(handle), indirect=False)
            origin = zenoh.Locality.REMOTE if from_others else zenoh.Locality.ANY
            return self._session.declare_subscriber(key_expr, callback, allowed_origin=origin)

        return self._declare("subscribe to", key_expr, declare)

    def _subscribe_latched(self, key_expr: str, from_others: bool, subscription: LatchedSubscription) -> Closeable:
        def on_token(token: zenoh.Sample) -> None:
            subscription.on_token(str(token.key_expr), token.kind == zenoh.SampleKind.PUT)

        tokens, callback = latched_tokens_key(key_expr), zenoh.handlers.Callback(on_token, indirect=False)
        live = self._subscribe(key_expr, lambda sample: subscription.receive(sample, sample.writer), from_others)
        # After it: what is published from then on comes, what was published before is asked for.
        watch = self._declare(
            "subscribe to",
            key_expr,
            lambda: self._session.liveliness().declare_subscriber(tokens, callback, history=True),
        )
        return Handle(watch.close, live.close)

    def when_caught_up(self, call: Callable[[], object]) -> None:
        self._presence.do(partial(self._latched.when_caught_up, call))

    def _find_latched(self, key_expr: str, found: Callable[[str], object], done: Callable[[], object]) -> None:
        do = self._presence.do

        def on_reply(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                do(partial(found, str(reply.ok.key_expr)))

        # On another thread: Zenoh holds a lock of the session while it calls these, so a call into it never returns.
        callback: Any = zenoh.handlers.Callback(on_reply, partial(do, done), indirect=False)
        try:
            self._session.liveliness().get(latched_tokens_key(key_expr), callback, timeout=ROUTER_ANSWER)
        except zenoh.ZError as error:
            # Closed meanwhile; `done` is called as well.
            log.debug("latched: %s", zenoh_text(error))

    def _ask_latched(self, token: str, receive: Callable[[RawSample], object], done: Callable[[], object]) -> None:
        take = sample_callback(receive)

        def on_reply(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                take(reply.ok)

        try:
            self._get(
                token,
                zenoh.handlers.Callback(on_reply, partial(self._presence.do, done), indirect=False),
                timeout=_LATCHED_TIMEOUT,
                # The answer has the topic's key, not the token's.
                accept_replies=zenoh.ReplyKeyExpr.ANY,
            )
        except zenoh.ZError as error:
            # Closed meanwhile.
            log.debug("latched: %s", zenoh_text(error))

    def declare_queryable(self, key: str, handler: transport.QueryHandler) -> Closeable:
        def on_query(query: zenoh.Query) -> None:
            payload = query.payload.to_bytes() if query.payload is not None else b""
            self._answers.answer(key, lambda: handler(str(query.key_expr), payload), partial(_reply, query))

        def declare() -> Any:
            self._keep_id(key)
            return self._session.declare_queryable(key, self._queries.callback(on_query), complete=True)

        return self._declare("serve", key, declare)

    def get(self, key_expr: str, payload: bytes, timeout: float, to_others: bool = False) -> list[Reply]:
        place = zenoh.Locality.REMOTE if to_others else zenoh.Locality.ANY

        def ask() -> Any:
            return self._get(key_expr, payload=payload, timeout=timeout, allowed_destination=place)

        replies, begin = [], monotonic()
        for reply in self._make("ask", key_expr, ask):
            if reply.ok is not None:
                replies.append(Reply(str(reply.ok.key_expr), reply.ok.payload.to_bytes(), False))
            elif reply.err is not None:
                text = reply.err.payload.to_bytes()
                replies.append(transport.TIMED_OUT if text == _TIMEOUT else Reply("", text, True))
        if not replies and monotonic() - begin >= _MOST * timeout:
            # The session's own timer adds this error, unless the router's ends the query first.
            replies.append(transport.TIMED_OUT)
        return replies

    def declare_token(self, key: str) -> Closeable:
        return self._declare("declare the token", key, lambda: self._session.liveliness().declare_token(key))

    def watch_tokens(self, key_expr: str, handler: transport.TokenHandler) -> Closeable:
        session, thread = self._session, self._presence
        return self._keep(self._make("watch", key_expr, lambda: TokenWatch(session, key_expr, handler, thread)))

    def _look_at_tokens(self) -> None:
        for declared in list(self._open):
            if isinstance(declared, TokenWatch):
                declared.look()

    def watch_link(self, handler: Callable[[bool], None]) -> None:
        self._link_handlers.append(handler)

    def limit_silence(self, seconds: float) -> None:
        """Let the system end a link over which data goes unacknowledged for so long (`sockets.py`)."""
        self._hold(limit_silence(self._session, seconds))

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        if self._links.count(event):
            self._tell_of_link(False)
        self._tell_of_link(bool(self._links.sessions))

    def _tell_of_link(self, up: bool) -> None:
        if up != self.up:
            self.up = up
            for handler in list(self._link_handlers):
                transport.call(handler, up)

    def before_close(self, call: Callable[[], None]) -> None:
        """Call it when the session is about to be closed, also at the interpreter's end."""
        self._keep(Handle(call))

    def close(self) -> None:
        self._link_handlers.clear()
        super().close()
        self._session.close()  # type: ignore[no-untyped-call]
        self._queries.end()
        self._presence.end()
        # Last: if an interrupt cuts this short, it is done again at the interpreter's end.
        atexit.unregister(self.close)
