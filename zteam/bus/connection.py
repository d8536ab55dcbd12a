"""Opening a session: find the router, start one on demand, and say what the process waits for or why it cannot join.

While it is open, a session's link is watched: whether it carries both ways after it has come back, and whether a router
on demand must be started again.
"""

import logging
import math
import random
import select
import socket
import sys
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import msgspec
import zenoh

from zteam.bus.bus import Bus
from zteam.bus.options import (
    FROM_STDIN,
    ROUTER_ANSWER,
    TLS_VARIABLES,
    BusOptions,
    client_config,
    host_port,
    open_session,
    port_accepts,
    try_open,
)
from zteam.bus.rights import RightCheck
from zteam.bus.router import (
    ANSWER_WITHIN,
    ON_DEMAND_DEADLINE,
    RouterRecord,
    find_local_routers,
    read_admin,
    router_log_path,
    spawn_router,
)
from zteam.bus.sockets import Ends, cut, links_of
from zteam.bus.transport import let_end, zenoh_text
from zteam.bus.zenoh_session import ZenohTransport
from zteam.clock import HOST_FACTOR, Every, monotonic, pause
from zteam.errors import BusError
from zteam.names import declarations_key

log = logging.getLogger("zteam.bus")

_LOOK_AGAIN = 0.1
"""Host seconds between looks while waiting for the launcher, for a session, or for a link."""
_OPENS_WITHIN = 3.0 * HOST_FACTOR
"""Host seconds until a port that accepts connections and takes no session is held by something else."""
_REVIVE_PERIOD = 1.0
"""Host seconds from one look at the port of a router on demand to the next, while there is no link."""
_LINK_QUESTIONS = 6
"""Asked of a session through the router, after each return of its link."""
_LINK_PERIOD = 2.0
"""Host seconds from an answer to the next question."""
_LINK_PATIENCE = 5.0
"""Host seconds after which a process with a certificate says why its link does not come back."""
_RIGHTS_WITHIN = 2.0 * HOST_FACTOR
"""Host seconds for a declaration to reach the router."""
_LINK_FAILURES = 3
"""Questions in a row without an answer: a busy router may miss one."""
_LINK_CUTS = 3
"""Links in a row that are ended: where an access control lets no query through, none is answered."""

_ALERT = b"\x15\x03"
"""The first bytes with which TLS refuses what is no TLS."""
_CLOSE = b"\x02\x00\x03"
"""The first bytes with which a Zenoh router refuses what is no Zenoh: two of length, and the number of a Close."""
_FIRST_PAUSE, _LONGEST_PAUSE = 5.0, 60.0
"""Host seconds between two looks for the reason why a router does not let a process in."""


def why_foreign(record: RouterRecord | None, endpoint: str) -> tuple[str, str] | None:
    """Why the router at the default port is not joined, and what to do; None if it is joined.

    On a shared machine it may be another user's: two users' teams must not mix by accident.
    """
    owner = record.metadata.owner if record and record.metadata else None
    if owner is None or not owner.is_another_user():
        return None
    own = "'zteam-router --listen tcp/127.0.0.1:PORT'"
    step = f"to join it on purpose use --connect {endpoint}, or run your own with {own}"
    return f"the router at {endpoint} belongs to {owner}", step


def _answer_to_nonsense(address: tuple[str, int]) -> bytes | None:
    """What is answered to bytes that mean nothing; None if a router of this machine, or anything, stays silent."""
    host, port = address
    try:
        with socket.create_connection(address, timeout=ANSWER_WITHIN) as link:
            host, port = link.getpeername()[:2]
            link.sendall(bytes(32))
            answer = link.recv(64)
    except TimeoutError:
        return None
    except OSError:
        answer = b""
    # A router that has too many connections to open ends some of them.
    return None if not answer and f"tcp/{host}:{port}" in find_local_routers() else answer


def why_refused(options: BusOptions) -> tuple[str, str]:
    """Why no session was opened at an endpoint that accepts connections, and what to do."""
    endpoint = options.endpoint
    address, place = host_port(endpoint), endpoint.partition("/")[2]
    answer = b"" if address is None else _answer_to_nonsense(address)
    if answer is None:
        step = "a router there is frozen, or another program is there: name a router elsewhere with --connect"
        return f"{endpoint} takes connections but does not answer", step
    if answer.startswith(_ALERT):
        if options.tls is not None and address is not None:
            from zteam.bus.tls import own_fault, own_identity, refusal

            if fault := own_fault(options.tls) or refusal(address, options.tls):
                return f"the router at {endpoint} and this process do not trust each other", fault
            return (
                f"the router at {endpoint} gives the certificate {own_identity(options.tls)[0]} no rights",
                "it was revoked or replaced ('zteam certs list'), or the team's namespace is another one (--namespace)",
            )
        step = f"use --connect tls/{place}, and set {', '.join(TLS_VARIABLES)} (docs/security.md)"
        return f"the router at {endpoint} takes certificates only", step
    if answer.startswith(_CLOSE):
        unset = f" without {', '.join(TLS_VARIABLES)}" if options.tls is not None else ""
        step = f"use --connect tcp/{place}{unset}, and name in --config what it asks for, such as a password"
        return f"the router at {endpoint} has no certificates, or refuses this process", step
    return (
        f"{endpoint} is held by something that does not speak Zenoh",
        "end it, or run a router elsewhere and name it with --connect",
    )


def _why_no_session(options: BusOptions) -> str:
    """Why no session was opened, and what to do; empty where nothing listens, or over another protocol than TCP."""
    if (address := host_port(options.endpoint)) is None:
        return ""
    if port_accepts(options.endpoint):
        return ": ".join(why_refused(options))
    try:
        socket.getaddrinfo(*address)
    except (socket.gaierror, UnicodeError):
        return f"no host has the name {address[0]!r}: check {options.endpoint} (--connect, ZTEAM_CONNECT)"
    return ""


class Reasons:
    """Why a process has no link. Each reason is given once, and again when it has changed.

    A Zenoh router accepts nothing for 0.1 s after a TLS handshake that fails, and each look makes some. So the pause
    between looks doubles: otherwise a large team that is kept out could never come in.
    """

    def __init__(self, options: BusOptions, first: float) -> None:
        """`first` is the time to the first look, in host seconds."""
        self._options = options
        self._next, self._pause = monotonic() + first, _FIRST_PAUSE
        self._given = ""

    def look(self) -> str | None:
        """The reason, empty where nothing listens; None if it was given before, or it is not yet time to look."""
        now = monotonic()
        if now < self._next:
            return None
        self._next, self._pause = now + self._pause, min(2.0 * self._pause, _LONGEST_PAUSE)
        before, self._given = self._given, _why_no_session(self._options)
        return None if self._given and self._given == before else self._given


def _read_endpoint(stopping: Callable[[], bool]) -> str:
    # Host time: the read of an endpoint must notice a request to stop.
    while not stopping() and not select.select([sys.stdin], [], [], _LOOK_AGAIN)[0]:  # noqa: TID251
        # Nothing yet; a read would not see the request to stop.
        continue
    line = "" if stopping() else sys.stdin.readline().strip()
    if not line:
        raise BusError("--connect - expects an endpoint on standard input, such as tcp/127.0.0.1:7447")
    return line


def connect(options: BusOptions, *, patience: float | None = None, stopping: Callable[[], bool] = lambda: False) -> Bus:
    """A bus on an open session.

    Without `--connect` and certificates the local router is started if there is none. Otherwise this waits for the
    router and says so: `patience` seconds, else those of `options.give_up`, else for ever. `stopping()` ends the wait.
    Raises BusError when there is no session.
    """
    if options.connect == FROM_STDIN:
        options = msgspec.structs.replace(options, connect=_read_endpoint(stopping))
    if options.tls is not None:
        # A router on demand would have none of its own.
        options = msgspec.structs.replace(options, connect=options.endpoint)
    if options.connect is None:
        session = _open_on_demand(options, stopping)
    else:
        session = _open_patiently(options, options.give_up if patience is None else patience, stopping)
    transport = ZenohTransport(session)
    _on_link(transport, True, LinkCheck(session, options).run)
    if options.tls is not None:
        _on_link(transport, False, partial(_say_why_link_stays_away, options))
        transport.limit_silence(options.lease)
        rights = RightCheck(transport, options)
        transport.before_close(rights.close)
        return Bus(transport, rights, options)
    if options.connect is None:
        _on_link(transport, False, partial(_keep_router_alive, options))
    return Bus(transport, options=options)


def _open_patiently(options: BusOptions, patience: float | None, stopping: Callable[[], bool]) -> zenoh.Session:
    start, reasons, delay = monotonic(), Reasons(options, 1.0), 0.05
    while not stopping():
        session = try_open(options)
        if session is not None and (options.tls is None or _has_rights(session, options)):
            return session
        if session is not None:
            session.close()  # type: ignore[no-untyped-call]
        if options.tls is not None:
            from zteam.bus.tls import own_fault

            if fault := own_fault(options.tls):
                raise BusError(fault)
        waited = monotonic() - start
        if patience is not None and waited > patience:
            way_out = f"start one with 'zteam-router --listen {options.endpoint}', or leave --connect out"
            raise BusError(_why_no_session(options) or f"no Zenoh router answers at {options.endpoint}: {way_out}")
        if (why := reasons.look()) is not None:
            place = f"{options.endpoint} (Ctrl+C to give up)"
            log.warning("waiting for a Zenoh router at %s", f"{place}: {why}" if why else place)
        pause(delay)
        delay = min(0.5, delay * 1.5)
    raise BusError(f"stopped while waiting for a Zenoh router at {options.endpoint}")


def _has_rights(session: zenoh.Session, options: BusOptions) -> bool:
    """Whether the router lets through what a session with a certificate sends: a question to it, from another one."""
    key, deadline = declarations_key(str(session.zid())), monotonic() + _RIGHTS_WITHIN
    callback: Any = zenoh.handlers.Callback(lambda query: query.reply(key, b""), indirect=False)
    with session.declare_queryable(key, callback):
        while not (is_reached := _is_reached(options, key)) and monotonic() < deadline:
            pause(_LOOK_AGAIN)
    return bool(is_reached)


def _open_on_demand(options: BusOptions, stopping: Callable[[], bool]) -> zenoh.Session:
    # A mistake in the options starts no router.
    client_config(options)
    deadline = monotonic() + ON_DEMAND_DEADLINE
    respawn = Every(1.0)
    refused_until = math.inf
    while monotonic() < deadline and not stopping():
        if not port_accepts(options.endpoint):
            if respawn.due():
                spawn_router(options.endpoint, options.lease)
            pause(0.01)
            continue
        session = try_open(options)
        if session is not None:
            if foreign := why_foreign(read_admin(options), options.endpoint):
                session.close()  # type: ignore[no-untyped-call]
                raise BusError(": ".join(foreign))
            return session
        # The published port of a container is open before the router in it is.
        refused_until = min(refused_until, monotonic() + _OPENS_WITHIN)
        if monotonic() >= refused_until:
            raise BusError(": ".join(why_refused(options)))
        pause(_LOOK_AGAIN)
    raise BusError(
        f"no router came up at {options.endpoint} within {ON_DEMAND_DEADLINE:.0f} s: "
        f"see {router_log_path(options.endpoint)}, or start 'zteam-router' by hand"
    )


def _on_link(transport: ZenohTransport, up: bool, watch: Callable[[Callable[[], bool]], object]) -> None:
    """Call `watch(lasts)` on a thread of its own each time the link is back, or without `up` is lost: `lasts()` is True
    until it changes."""
    changes, thread = 0, None

    def on_link(is_up: bool) -> None:
        nonlocal changes, thread
        changes += 1
        change = changes

        def lasts() -> bool:
            return changes == change and not transport.closed

        if is_up == up:
            started = threading.Thread(target=watch, args=[lasts], name="link", daemon=True)
            started.start()
            thread = started

    transport.watch_link(on_link)
    transport.before_close(lambda: let_end(thread))


def _say_why_link_stays_away(options: BusOptions, lasts: Callable[[], bool]) -> None:
    """Zenoh tries again for ever, also when a certificate expires or another program takes the router's port."""
    reasons = Reasons(options, _LINK_PATIENCE)
    while lasts():
        if why := reasons.look():
            log.error("no link to the router: %s", why)
        pause(_LOOK_AGAIN)


def _keep_router_alive(options: BusOptions, lasts: Callable[[], bool]) -> None:
    """Start a router on demand again when it dies; Zenoh reconnects by itself."""
    # Spread out, so that few routers compete for the port.
    pause(random.uniform(0.0, 0.2))
    while lasts():
        # A router that is there may end before Zenoh has connected to it.
        if not port_accepts(options.endpoint):
            try:
                spawn_router(options.endpoint, options.lease)
            except BusError as error:
                log.error("%s", error)
        pause(_REVIVE_PERIOD)


def _is_reached(options: BusOptions, key: str) -> bool | None:
    """Whether the session that answers on `key` is reached by another one; None if that finds no router."""
    try:
        with open_session(client_config(options), "usual") as other:
            return any(reply.ok is not None for reply in other.get(key, timeout=ROUTER_ANSWER))
    except zenoh.ZError as error:
        log.debug("link: %s", zenoh_text(error))
        return None


class LinkCheck:
    """Asks one session, through the router, after each return of its link: whether that carries both ways.

    A router ends a link that takes nothing for too long. If the session opens the next one meanwhile, the router may
    keep the routes of the first: it takes what the session sends and sends it signs of life, but no message and no
    query, for ever. A link that ends once more comes back whole.
    """

    def __init__(self, session: zenoh.Session, options: BusOptions) -> None:
        self._session, self._options = session, options
        self._cuts = 0

    def run(self, lasts: Callable[[], bool]) -> None:
        """The link is back: ask while it `lasts()`."""
        failed, key = 0, declarations_key(str(self._session.zid()))
        for _ in range(_LINK_QUESTIONS):
            links, is_reached = links_of(self._session), _is_reached(self._options, key)
            if not lasts():
                return
            failed = failed + 1 if is_reached is False else 0
            if failed == _LINK_FAILURES:
                self._mend(links)
                return
            pause(_LINK_PERIOD)
        self._cuts = 0

    def _mend(self, links: set[Ends]) -> None:
        if self._options.tls is not None and read_admin(self._options) is None:
            # No further link would carry more.
            log.error("%s", ": ".join(why_refused(self._options)))
            return
        if self._cuts == _LINK_CUTS:
            log.error("no query reaches this process after %d new links: start it again", _LINK_CUTS)
            return
        self._cuts += 1
        log.warning("no query reaches this process on the link that came back: opening another link")
        cut(links)
