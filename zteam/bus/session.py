"""The Zenoh transport: one session, everything declared on it, and an orderly end."""

import atexit
import itertools
import logging
from collections.abc import Callable
from typing import Any, TypeVar

import zenoh
import zenoh.ext

from zteam.bus.answering import DeferredAnswers, error_reply, make_answer
from zteam.bus.keys import check_use, first_line
from zteam.bus.token_watch import LOOK_PERIOD, TokenWatch, look_at_tokens
from zteam.bus.transport import (
    Closeable,
    QueryHandler,
    RawPublisher,
    Reply,
    SampleHandler,
    TokenHandler,
)
from zteam.bus.zenoh_callbacks import Aside, call, sample_callback
from zteam.bus.zenoh_publisher import Declared, ZenohPublisher, stamping_as
from zteam.clock import monotonic
from zteam.errors import BusError

log = logging.getLogger("zteam.bus")

D = TypeVar("D", bound=Declared)

_MOST = 0.9
"""Of a time-out: a query that ends after this share of it without a reply has timed out."""
_HISTORY = zenoh.ext.HistoryConfig(detect_late_publishers=True)


def _reply(query: zenoh.Query, reply: Reply) -> None:
    """Answer a query and end it."""
    try:
        with query:
            if reply.error:
                query.reply_err(reply.payload)
            else:
                query.reply(reply.key, reply.payload)
    except zenoh.ZError as error:
        # The session was closed meanwhile: the asker sees its queries end.
        log.debug("reply: %s", error)


class ZenohTransport:
    """An open Zenoh session seen as a Transport."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self.instance = str(session.zid())
        self._declared: set[Declared] = set()
        self._changes, self.matching_changes = itertools.count(1), 0
        self._link_handlers: list[Callable[[bool], None]] = []
        self._routers: set[str] = {str(zid) for zid in session.info.routers_zid()}
        # Answers do not wait for what a change of presence leads to.
        self._queries, self._presence = Aside(), Aside(LOOK_PERIOD, lambda: look_at_tokens(self._declared))
        events = session.info.declare_transport_events_listener(self._presence.callback(self._on_transport))
        # Closed before the session: its own end would be told too, perhaps while the interpreter ends already.
        self._keep(Declared(events, self._declared.discard))
        # Asked again: a router may have connected before the listener was there.
        self._routers |= {str(zid) for zid in session.info.routers_zid()}
        self._deferred = DeferredAnswers()
        self.up, self.closed = True, False
        # A script may end without closing: then this does it, while Zenoh can still call into the session.
        atexit.register(self.close)

    def _declare(self, action: str, key: str, declare: Callable[[], Any]) -> Closeable:
        """Keep what `declare()` makes until it is closed. Raises BusError."""
        return self._keep(Declared(self._make(action, key, declare), self._declared.discard))

    def _make(self, action: str, key: str, declare: Callable[[], Any]) -> Any:
        check_use(action, key, self.closed)
        try:
            return declare()
        except zenoh.ZError as error:
            # Closed since the check.
            raise BusError(f"cannot {action} {key}: {first_line(error)}") from None

    def _keep(self, declared: D) -> D:
        self._declared.add(declared)
        return declared

    def declare_publisher(
        self, key: str, encoding: str, latched: bool, to_others: bool = False, source: str = ""
    ) -> RawPublisher:
        options: dict[str, Any] = {
            "encoding": zenoh.Encoding(encoding),
            "congestion_control": zenoh.CongestionControl.DROP,
        }
        if to_others:
            options["allowed_destination"] = zenoh.Locality.REMOTE

        def declare() -> Any:
            if not latched:
                return self._session.declare_publisher(key, **options)
            cache = zenoh.ext.CacheConfig(1)
            return zenoh.ext.declare_advanced_publisher(
                self._session, key, cache=cache, publisher_detection=True, **options
            )

        entity = self._make("publish on", key, declare)
        stamps = [stamping_as(self._session, source)] if source else []
        return self._keep(ZenohPublisher(entity, self._declared.discard, latched, self._on_matching, *stamps))

    def declare_subscriber(
        self, key_expr: str, handler: SampleHandler, latched: bool, stamped: bool = True
    ) -> Closeable:
        callback = sample_callback(handler, stamped)

        def declare() -> Any:
            if not latched:
                return self._session.declare_subscriber(key_expr, callback)
            return zenoh.ext.declare_advanced_subscriber(self._session, key_expr, callback, history=_HISTORY)

        return self._declare("subscribe to", key_expr, declare)

    def declare_queryable(self, key: str, handler: QueryHandler) -> Closeable:
        def on_query(query: zenoh.Query) -> None:
            payload = query.payload.to_bytes() if query.payload is not None else b""
            answer = make_answer(key, lambda: handler(str(query.key_expr), payload))
            if isinstance(answer, Reply):
                _reply(query, answer)
            else:
                self._deferred.start(key, answer, lambda reply: _reply(query, reply))

        def declare() -> Any:
            return self._session.declare_queryable(key, self._queries.callback(on_query), complete=True)

        return self._declare("serve", key, declare)

    def get(self, key_expr: str, payload: bytes, timeout: float, to_others: bool = False) -> list[Reply]:
        def ask() -> Any:
            return self._session.get(
                key_expr,
                payload=payload,
                timeout=timeout,
                target=zenoh.QueryTarget.ALL,
                # Every answer counts: two processes that claim one name both serve its keys.
                consolidation=zenoh.ConsolidationMode.NONE,
                allowed_destination=zenoh.Locality.REMOTE if to_others else zenoh.Locality.ANY,
            )

        replies, begin = [], monotonic()
        for reply in self._make("ask", key_expr, ask):
            if reply.ok is not None:
                replies.append(Reply(str(reply.ok.key_expr), reply.ok.payload.to_bytes(), False))
            elif reply.err is not None:
                replies.append(Reply("", reply.err.payload.to_bytes(), True))
        if not replies and monotonic() - begin >= _MOST * timeout:
            # The session's own timer adds this error, unless the router's ends the query first.
            replies.append(error_reply("Timeout"))
        return replies

    def declare_token(self, key: str) -> Closeable:
        return self._declare("declare the token", key, lambda: self._session.liveliness().declare_token(key))

    def watch_tokens(self, key_expr: str, handler: TokenHandler) -> Closeable:
        watch = TokenWatch(self._session, key_expr, handler, self._declared.discard)
        self._make("watch", key_expr, lambda: watch.declare(self._presence))
        return self._keep(watch)

    def _on_matching(self) -> None:
        self.matching_changes = next(self._changes)

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
                call(handler, up)

    def close(self) -> None:
        self.closed = True
        self._link_handlers.clear()
        for declared in list(self._declared):
            declared.close()
        self._session.close()  # type: ignore[no-untyped-call]
        self._queries.end()
        self._presence.end()
        # Last: if an interrupt cuts this short, it is done again at the interpreter's end.
        atexit.unregister(self.close)
