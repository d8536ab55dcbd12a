"""The one Zenoh router of a host: the router itself, and what its users ask of it, or do to have one."""

import logging
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import msgspec
import zenoh

from zteam.bus.options import (
    LEASE,
    RELEASE,
    BusOptions,
    Owner,
    RouterOptions,
    host_port,
    open_session,
    port_accepts,
    router_config,
    try_open,
)
from zteam.bus.sockets import LinkCount, limit_silence
from zteam.bus.transport import decode_json, zenoh_text
from zteam.clock import HOST_FACTOR, monotonic, pause, wait_until
from zteam.errors import BusError, DecodeError, UsageError
from zteam.names import declarations_key, is_of_team, split_namespaced_token_key, tokens_key

log = logging.getLogger("zteam.router")

ON_DEMAND_DEADLINE = 20.0
"""Seconds until a router on demand must be up; an interpreter took 2.2 s to start on a crowded machine."""
IDLE_EXIT = 10.0
"""Seconds after its last client that a router on demand ends."""
_CLAIMS, _CLAIM_PERIOD = 25, 0.2
"""How often a team's router tries to get a port that was promised: a client of the router there may have started the
next one, or another team has got it; and seconds that a router may take to end."""
ANSWER_WITHIN, _ASK_AGAIN = 3.0, 0.05
"""Seconds in which a router on demand that has just begun, or is busy, answers; and from question to question."""
_COME_OVER = 1.0 * HOST_FACTOR
"""Seconds for the clients of the router that gave its port up to connect to the next one: they try each 0.5 s."""
_POLL = 0.002
"""Seconds between looks at a port that is about to become free."""
_NOTE = "endpoint"
_CONFIG_PERIOD = 0.25
"""Seconds between looks at the file of settings."""
_OPEN_TRIES = 20
"""Before a router that was closed for new settings gives up."""


class RouterMetadata(msgspec.Struct):
    """What a zteam router says of itself in Zenoh's admin space."""

    name: str | None = None
    owner: Owner = Owner()
    pid: Annotated[int, msgspec.Meta(ge=0, le=2**32 - 1)] | None = None
    on_demand: bool = False


class ReleaseRequest(msgspec.Struct):
    """Asks a router on demand for its port. The reply: the sessions that will want another one, null if it stays."""

    owner: Owner
    """Of the asker."""
    session: str
    """The asker's own, which ends before the router does."""
    secure: bool
    """Whether the next router has certificates: without one no client could follow."""
    returns: bool = False
    """Whether it is the router of the team here, which has failed and is started again."""


class PortInUseError(BusError):
    """Another process listens where a router was to listen."""


class RouterSession(msgspec.Struct):
    peer: str = ""
    """Its id."""
    whatami: str = ""
    """client, peer or router."""
    links: list[dict[str, Any]] = []
    """With the session's end as `dst`, such as tcp/127.0.0.1:33004."""


class RouterRecord(msgspec.Struct):
    """What a router says of itself in Zenoh's admin space; one that is not zteam's has no metadata."""

    zid: str = ""
    locators: list[str] = []
    metadata: RouterMetadata | None = None
    version: str = ""
    sessions: list[RouterSession] = []


def read_record(session: zenoh.Session, router: str = "") -> RouterRecord | None:
    """The record of a router, by default of the one that the session is connected to."""
    # By its id: routers that are linked to it would answer too.
    for zid in [router] if router else session.info.routers_zid():
        for reply in session.get(f"@/{zid}/router", timeout=1.0):
            if reply.ok is not None:
                with suppress(DecodeError):
                    return decode_json(reply.ok.payload.to_bytes(), RouterRecord)
    return None


def read_admin(options: BusOptions) -> RouterRecord | None:
    """The record of the router that is connected to, read without a namespace (a session with one gets nothing).

    None without a router.
    """
    session = try_open(msgspec.structs.replace(options, namespace=None))
    if session is None:
        return None
    with session:
        return read_record(session)


def _find_endpoint(listen: str, locators: Sequence[str]) -> str:
    """That of a router's locators which is the endpoint `listen`, with the port that it got."""
    host = listen.rpartition(":")[0] + ":"
    return next((found for found in locators if found.startswith(host)), locators[0] if locators else listen)


class Router:
    """An open router; `endpoint` is where it really listens first (port 0 becomes the port it got)."""

    def __init__(self, options: RouterOptions) -> None:
        if options.tls is not None:
            from zteam.bus.tls import own_fault

            if fault := own_fault(options.tls, routes=True):
                raise BusError(fault)
        self._version = _version_of(options.config)
        self._config = router_config(options)
        self._links = LinkCount()
        self._changed = threading.Condition()
        self._idle_since = monotonic()
        self._heirs: set[str] = set()
        """Sessions of those that were promised the port."""
        self._options = options
        """How it is opened again."""
        self._session = self._open(self._config)
        record = read_record(self._session, str(self._session.zid()))
        locators = record.locators if record else []
        self.endpoint = _find_endpoint(options.listen[0], locators)
        # An endpoint with a host such as 0.0.0.0 stands for several, of which a locator is one.
        listen = tuple(_find_endpoint(e, locators) if e.endswith(":0") else e for e in options.listen)
        self._options = msgspec.structs.replace(options, listen=listen)
        self._note = _state_file(self.endpoint, _NOTE)
        # Without a note it is found by its endpoint only.
        with suppress(OSError):
            self._note.parent.mkdir(parents=True, exist_ok=True)
            self._note.write_text(self.endpoint)

    def _open(self, config: zenoh.Config) -> zenoh.Session:
        """A session that routes and counts its clients. Raises BusError."""
        try:
            session = open_session(config, "router")
        except zenoh.ZError as error:
            places = ", ".join(self._options.listen)
            if "Address already in use" in str(error):
                raise PortInUseError(
                    f"{places} is in use: another router is there (use it), or choose another port with --listen"
                ) from None
            raise BusError(f"cannot listen at {places}: {zenoh_text(error)}") from None
        with self._changed:
            # The ends of the last session's links may be told later.
            self._links = links = LinkCount()
            self._idle_since = monotonic()
        on_transport = partial(self._on_transport, links)
        self._events = session.info.declare_transport_events_listener(on_transport, history=True)
        self._silence = limit_silence(session, self._options.lease)
        if self._options.idle_exit is not None:
            # On a thread of its own: an answer may wait for Zenoh's.
            session.declare_queryable(RELEASE, self._answer)
        return session

    def _take_changed_file(self) -> None:
        """Open the session again where its file of settings has changed, with all links; clients come back.

        Zenoh applies an access control when it opens, and only so is a certificate that was taken back out. A file
        that Zenoh does not take changes nothing.
        """
        file = self._options.config
        version = _version_of(file)
        if version == self._version:
            return
        self._version = version
        try:
            config = router_config(self._options)
        except UsageError as error:
            log.error("%s; the router keeps the settings it has", error)
            return
        self._session.close()  # type: ignore[no-untyped-call]
        try:
            self._session, self._config = self._open(config), config
        except BusError as error:
            log.error("--config %s: %s; the router keeps the settings it had", file, error)
            self._session = self._open_again()
        else:
            log.info("%s has changed: the router has taken it and opened all links again", file)

    def _open_again(self) -> zenoh.Session:
        """With the settings it had. Its certificate may be about to be replaced, and its key fit in a moment only."""
        for _ in range(_OPEN_TRIES):
            try:
                return self._open(self._config)
            except BusError as error:
                log.debug("%s", error)
                pause(_CONFIG_PERIOD)
        return self._open(self._config)

    def _on_transport(self, links: LinkCount, event: zenoh.TransportEvent) -> None:
        with self._changed:
            links.count(event)
            if event.kind != zenoh.SampleKind.PUT:
                self._idle_since = monotonic()
            self._changed.notify_all()

    def _answer(self, query: zenoh.Query) -> None:
        """Promise the port to a router of the same user if no other team is here and the clients can follow."""
        promised = None
        # The session may be closed meanwhile.
        with suppress(zenoh.ZError), query:
            with suppress(DecodeError):
                request = decode_json(query.payload.to_bytes() if query.payload else b"", ReleaseRequest)
                promised = self._promise(request)
            query.reply(RELEASE, msgspec.json.encode(promised))
        if promised is not None:
            with self._changed:
                self._heirs.add(request.session)
                self._changed.notify_all()

    def _promise(self, request: ReleaseRequest) -> list[str] | None:
        """The sessions that will want another router; None if this one keeps the port."""
        with self._changed:
            others = sorted(self._links.sessions - {request.session, *self._heirs})
        keeps = others and not request.returns and (request.secure or self._holds_team())
        return None if keeps or request.owner.is_another_user() else others

    def _holds_team(self) -> bool:
        """Whether a process of a team is here, in any namespace; True if that cannot be found out."""
        for reply in self._session.liveliness().get(tokens_key("**"), timeout=1.0):
            token = None if reply.ok is None else split_namespaced_token_key(str(reply.ok.key_expr))
            if reply.ok is None or (token is not None and is_of_team(token[1])):
                return True
        return False

    def _end(self) -> tuple[str, float | None]:
        """Why a router on demand ends now, empty if it does not; and seconds until that may change by itself."""
        if self._heirs:
            # Not before the answers have arrived.
            return ("" if self._heirs & self._links.sessions else "a team's router gets its port"), None
        idle_exit = self._options.idle_exit
        if idle_exit is None or self._links.sessions:
            return "", None
        left = self._idle_since + idle_exit - monotonic()
        return (f"no client for {idle_exit:g} s" if left <= 0 else ""), left

    def run(self, stopping: Callable[[], bool]) -> None:
        """Route until `stopping()`, checked when `wake` is called; one on demand also until no client was there for its
        `idle_exit`, or until it has given its port up."""
        while True:
            with self._changed:
                if stopping():
                    return
                reason, left = self._end()
                if reason:
                    log.info("the router ends: %s", reason)
                    return
                self._changed.wait(left if self._options.config is None else _CONFIG_PERIOD)
            # Without the lock: closing a session ends links, which `_on_transport` counts.
            self._take_changed_file()

    def wait_for(self, sessions: Sequence[str]) -> None:
        """Wait until these sessions are clients, for a moment at most: one may be frozen."""
        with self._changed:
            wait_until(self._changed, lambda: self._links.sessions.issuperset(sessions), _COME_OVER)

    def wake(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def close(self) -> None:
        with suppress(OSError):
            self._note.unlink()
        self._session.close()  # type: ignore[no-untyped-call]


def _version_of(config: str | None) -> tuple[int, ...]:
    """Changes with each new content of the file, also where a link to it leads elsewhere; empty without one."""
    try:
        found = Path(config).stat() if config is not None else None
    except OSError:
        # It is about to be replaced, or router_config says why it cannot be read.
        found = None
    return (found.st_dev, found.st_ino, found.st_mtime_ns, found.st_size) if found is not None else ()


def find_strangers(options: BusOptions) -> tuple[str, list[str]]:
    """The router's id, and the sessions there that are none of zteam's, each by its id and its addresses. Empty where
    the router reports none.

    Every session of zteam answers for its declarations, in whatever namespace it is.
    """
    session = try_open(msgspec.structs.replace(options, namespace=None))
    if session is None:
        return "", []
    known, asked = {str(session.zid())}, declarations_key("*")
    with session:
        record = read_record(session)
        for key in (asked, f"*/{asked}"):
            replies = session.get(key, timeout=1.0)
            known |= {str(reply.ok.key_expr).rsplit("/", 2)[1] for reply in replies if reply.ok is not None}
    strangers = [
        ", ".join([f"session {each.peer}", *(str(link.get("dst")) for link in each.links)])
        for each in (record.sessions if record else [])
        if each.peer not in known and each.whatami != "router"
    ]
    return (record.zid if record else ""), strangers


def open_team_router(options: RouterOptions) -> Router:
    """The router of a team, at the first endpoint of `options` if it can be had, else at any port. Raises BusError.

    A router on demand there gives its port up if it is this user's and holds no team, and its clients have come over
    when this returns: a process of theirs that holds a name is older than the team's, and keeps it. All else that
    listens there keeps the port. A router that `returns` after a failure finds its own team there, and takes no other
    port.
    """
    protocol, _, address = options.listen[0].partition("/")
    place, returns = f"tcp/{address}", options.for_team == "returns"
    clients = list[str]()
    for _ in range(_CLAIMS):
        if port_accepts(place, timeout=0.2):
            found = _release_port(place, protocol == "tls", returns)
            if found is None:
                break
            clients = found
        try:
            router = Router(options)
        except PortInUseError:
            pause(_POLL)
        else:
            if not returns:
                router.wait_for(clients)
            return router
    return Router(options if returns else msgspec.structs.replace(options, listen=(f"{protocol}/127.0.0.1:0",)))


def _release_port(endpoint: str, secure: bool, returns: bool) -> list[str] | None:
    """Ask a router on demand for its port, and give it a moment to end: its clients' sessions, None if it keeps it."""
    # The caller becomes the router: what the first session of a process runs on is settled for good.
    session = try_open(BusOptions(connect=endpoint), "router")
    if session is None:
        # A router that has just ended, or something else.
        return None if port_accepts(endpoint) else []
    with session:
        clients = _ask_for_port(session, ReleaseRequest(Owner.of_this_process(), str(session.zid()), secure, returns))
    end = monotonic() + _CLAIM_PERIOD
    while clients is not None and port_accepts(endpoint) and monotonic() < end:
        pause(_POLL)
    return clients


def _ask_for_port(session: zenoh.Session, request: ReleaseRequest) -> list[str] | None:
    """The sessions of the other clients of the router if it promises its port, else None."""
    end = monotonic() + ANSWER_WITHIN
    while monotonic() < end:
        record = read_record(session)
        if record is None and not session.info.routers_zid():
            # It has just ended.
            return []
        if record is None or record.metadata is None or not record.metadata.on_demand:
            return None
        replies = session.get(RELEASE, payload=msgspec.json.encode(request), timeout=1.0)
        if answers := [reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None]:
            with suppress(DecodeError):
                return decode_json(answers[0], list[str])
            return None
        pause(_ASK_AGAIN)
    return None


def _state_file(endpoint: str, suffix: str) -> Path:
    """In the user's state folder, one for each port."""
    folder = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "zteam"
    address = host_port(endpoint)
    return folder / f"router-{address[1] if address else 'local'}.{suffix}"


def router_log_path(endpoint: str) -> Path:
    return _state_file(endpoint, "log")


def find_local_routers() -> list[str]:
    """The endpoints of this user's routers on this machine, sorted. Each has noted its own in the state folder."""
    found = []
    for note in _state_file("", _NOTE).parent.glob(f"router-*.{_NOTE}"):
        with suppress(OSError):
            endpoint = note.read_text()
            if port_accepts(endpoint):
                found.append(endpoint)
            else:
                # It was killed.
                note.unlink()
    return sorted(found)


def spawn_router(endpoint: str, lease: float = LEASE) -> None:
    """Start a detached router that ends by itself. If several processes do this at once, one router gets the port.

    Its lease is never shorter than the usual one, because others will use it too.
    """
    log.info("starting a router at %s", endpoint)
    path = router_log_path(endpoint)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab") as output:
            # The child forks before it imports zenoh and its first half ends at once: no zombie stays here, and
            # no folder named zteam or zenoh in the user's directory can shadow the packages (cwd, -P).
            subprocess.run(
                [sys.executable, "-P", "-m", "zteam.node.router", endpoint, str(max(lease, LEASE)), str(IDLE_EXIT)],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                cwd="/",
                start_new_session=True,
                close_fds=True,
                timeout=ON_DEMAND_DEADLINE,
                check=False,
            )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise BusError(f"cannot start a router: {error}: start 'zteam-router' by hand") from None
