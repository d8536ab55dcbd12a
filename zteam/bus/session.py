"""The Zenoh transport: one session, everything declared on it, and an orderly end."""

import atexit
import ctypes
import logging
import queue
import threading
from collections.abc import Callable
from typing import Any, TypeVar

import zenoh
import zenoh.ext

from zteam.bus.transport import Closeable, QueryHandler, RawPublisher, RawSample, Reply, SampleHandler, TokenHandler
from zteam.errors import BusError, ZteamError

log = logging.getLogger("zteam.bus")

T = TypeVar("T")

_MAX_WAITING = 64
"""Queries whose answers take their time, at once; each has a thread."""
_BYTES = "zenoh/bytes"
_HISTORY = zenoh.ext.HistoryConfig(detect_late_publishers=True)


_THREAD = threading.local()


def _stay() -> None:
    """Let the interpreter keep what it needs to know of this thread, one of Zenoh's own.

    It would make that anew for every callback and throw it away after it, which takes as long as a short callback does:
    16 KB of stack mapped and unmapped, with their page faults. An `Ensure` without its `Release` leaves it in place.
    """
    ctypes.pythonapi.PyGILState_Ensure()
    _THREAD.stays = True


def _aside(handler: Callable[[T], None]) -> Any:
    """A Zenoh callback that calls `handler` on a thread of its own, in order, until its declaration is taken back.

    Zenoh does so by itself, but on a thread that is no daemon: the interpreter would wait for its end at exit, before
    anything can close the session.
    """
    waiting: queue.SimpleQueue[T | None] = queue.SimpleQueue()

    def work() -> None:
        while (event := waiting.get()) is not None:
            try:
                handler(event)
            except Exception:
                # A fault in one call must not end those that follow, and nothing else sees it.
                log.exception("error in a callback of the bus")

    threading.Thread(target=work, name="bus", daemon=True).start()
    return zenoh.handlers.Callback(waiting.put, lambda: waiting.put(None), indirect=False)


class _Declared:
    """A Zenoh declaration; undeclaring it twice, or after the session's end, does nothing."""

    def __init__(self, entity: Any, forget: Callable[["_Declared"], None]) -> None:
        self._entity = entity
        self._forget = forget

    def close(self) -> None:
        entity, self._entity = self._entity, None
        if entity is not None:
            self._forget(self)
            try:
                entity.undeclare()
            except zenoh.ZError as error:
                log.debug("undeclare: %s", error)


class _Publisher(_Declared):
    def __init__(self, entity: Any, forget: Callable[[_Declared], None], latched: bool) -> None:
        super().__init__(entity, forget)
        self.has_subscribers = True
        if not latched:
            # Told instead of asked: a question to Zenoh gives the interpreter away each time.
            self._lock, self._told = threading.Lock(), False
            listener: Any = zenoh.handlers.Callback(self._on_matching, indirect=False)
            self._matching = entity.declare_matching_listener(listener)
            now = entity.matching_status.matching
            with self._lock:
                # What was told meanwhile is newer.
                if not self._told:
                    self.has_subscribers = now

    def _on_matching(self, status: Any) -> None:
        with self._lock:
            self.has_subscribers, self._told = status.matching, True

    def put(self, payload: bytes) -> None:
        entity = self._entity
        if entity is None:
            return
        try:
            entity.put(payload)
        except zenoh.ZError as error:
            # The session is closing; a message that can no longer leave is as good as dropped.
            log.debug("put: %s", error)


class ZenohTransport:
    """An open Zenoh session seen as a Transport."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self.instance = str(session.zid())
        self._declared: set[_Declared] = set()
        self._link_handlers: list[Callable[[bool], None]] = []
        self._routers: set[str] = {str(zid) for zid in session.info.routers_zid()}
        self._events = session.info.declare_transport_events_listener(_aside(self._on_transport))
        # Lost between open() and the listener: the listener cannot have seen it.
        self._routers |= {str(zid) for zid in session.info.routers_zid()}
        self._waiting = threading.BoundedSemaphore(_MAX_WAITING)
        self.up = True
        self.closed = False
        # A script may end without closing, such as with an exception: then it is done at the interpreter's end, into
        # which Zenoh must not call.
        atexit.register(self.close)

    def _keep(self, declared: _Declared) -> _Declared:
        self._declared.add(declared)
        return declared

    def _wrap(self, entity: Any) -> _Declared:
        return self._keep(_Declared(entity, self._declared.discard))

    def declare_publisher(self, key: str, encoding: str, latched: bool, to_others: bool = False) -> RawPublisher:
        options: dict[str, Any] = {
            "encoding": zenoh.Encoding(encoding),
            "congestion_control": zenoh.CongestionControl.DROP,
        }
        if to_others:
            options["allowed_destination"] = zenoh.Locality.REMOTE
        if latched:
            entity: Any = zenoh.ext.declare_advanced_publisher(
                self._session, key, cache=zenoh.ext.CacheConfig(1), publisher_detection=True, **options
            )
        else:
            entity = self._session.declare_publisher(key, **options)
        publisher = _Publisher(entity, self._declared.discard, latched)
        self._keep(publisher)
        return publisher

    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, stamped: bool = True
    ) -> Closeable:
        def on_sample(sample: zenoh.Sample) -> None:
            if not hasattr(_THREAD, "stays"):
                _stay()
            if sample.kind != zenoh.SampleKind.PUT:
                return
            encoding = str(sample.encoding)
            if encoding == _BYTES:
                encoding = ""
            key, payload = str(sample.key_expr), sample.payload.to_bytes()
            if not stamped:
                handler(RawSample(key, payload, encoding))
                return
            # "<NTP64>/<id>": the only exact form of a timestamp that Python gets.
            time, _, source = str(sample.timestamp or "").partition("/")
            handler(RawSample(key, payload, encoding, int(time) if time else 0, source))

        # On Zenoh's own thread: no other has to be woken, and messages of different keys are taken in the order in
        # which they came, such as a frame's fixed transform before what moves in it. Handlers must not wait.
        direct = zenoh.handlers.Callback(on_sample, indirect=False)
        if latched:
            return self._wrap(zenoh.ext.declare_advanced_subscriber(self._session, key_expr, direct, history=_HISTORY))
        return self._wrap(self._session.declare_subscriber(key_expr, direct))

    def declare_queryable(self, key: str, handler: QueryHandler) -> Closeable:
        def answer(query: zenoh.Query, make: Callable[[], bytes | Callable[[], bytes]]) -> Callable[[], bytes] | None:
            """Answer a query, or give back the call whose answer takes its time."""
            try:
                answered = make()
                if callable(answered):
                    return answered
                query.reply(key, answered)
            except ZteamError as error:
                query.reply_err(str(error))
            except Exception as error:
                log.exception("error while answering the query %s", key)
                query.reply_err(f"{type(error).__name__}: {error}")
            return None

        def answer_later(query: zenoh.Query, finish: Callable[[], bytes]) -> None:
            try:
                with query:
                    answer(query, finish)
            except zenoh.ZError:
                pass  # the session was closed meanwhile: nobody is there to be answered
            finally:
                self._waiting.release()

        def on_query(query: zenoh.Query) -> None:
            payload = query.payload.to_bytes() if query.payload is not None else b""
            later: Callable[[], bytes] | None = None
            try:
                later = answer(query, lambda: handler(payload))
            finally:
                if later is None:
                    query.drop()  # type: ignore[no-untyped-call]
            if later is None:
                return
            if self._waiting.acquire(blocking=False):
                threading.Thread(target=answer_later, args=(query, later), daemon=True).start()
            else:
                with query:
                    query.reply_err(f"more than {_MAX_WAITING} queries are waiting: ask again later")

        return self._wrap(self._session.declare_queryable(key, _aside(on_query), complete=True))

    def get(self, key_expr: str, payload: bytes, timeout: float) -> list[Reply]:
        try:
            answers = self._session.get(
                key_expr,
                payload=payload,
                timeout=timeout,
                target=zenoh.QueryTarget.ALL,
                # Every answer counts: two processes that claim one name both serve its keys.
                consolidation=zenoh.ConsolidationMode.NONE,
            )
        except zenoh.ZError as error:
            # Threads that ask may outlive the session.
            raise BusError(f"cannot ask {key_expr}: {error}") from None
        replies = []
        for reply in answers:
            if reply.ok is not None:
                replies.append(Reply(str(reply.ok.key_expr), reply.ok.payload.to_bytes(), False))
            elif reply.err is not None:
                replies.append(Reply("", reply.err.payload.to_bytes(), True))
        return replies

    def declare_token(self, key: str) -> Closeable:
        return self._wrap(self._session.liveliness().declare_token(key))

    def watch_tokens(self, key_expr: str, handler: TokenHandler) -> Closeable:
        def on_token(sample: zenoh.Sample) -> None:
            handler(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

        return self._wrap(self._session.liveliness().declare_subscriber(key_expr, _aside(on_token), history=True))

    def watch_link(self, handler: Callable[[bool], None]) -> None:
        self._link_handlers.append(handler)

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        zid = str(event.transport.zid)
        if event.kind == zenoh.SampleKind.PUT:
            self._routers.add(zid)
        else:
            self._routers.discard(zid)
        up = bool(self._routers)
        if up != self.up:
            self.up = up
            for handler in list(self._link_handlers):
                handler(up)

    def close(self) -> None:
        self.closed = True
        self._link_handlers.clear()
        for declared in list(self._declared):
            declared.close()
        self._session.close()  # type: ignore[no-untyped-call]
        # Last: what an interrupt cuts short here is done at the interpreter's end.
        atexit.unregister(self.close)
