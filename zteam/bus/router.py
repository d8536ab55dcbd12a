"""The one Zenoh router of a host: the router itself, and what its users ask of it, or do to have one."""

import logging
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import zenoh

from zteam.bus.options import (
    LEASE,
    RELEASE,
    BusOptions,
    RouterOptions,
    host_port,
    open_session,
    port_accepts,
    router_config,
    try_open,
)
from zteam.bus.sockets import LinkCount, limit_silence
from zteam.clock import monotonic, pause
from zteam.errors import BusError, UsageError

log = logging.getLogger("zteam.router")

ON_DEMAND_DEADLINE = 20.0
"""Seconds until a router on demand must be up; an interpreter took 2.2 s to start on a crowded machine."""
IDLE_EXIT = 10.0
"""Seconds after its last client that a router on demand ends."""
_RELEASE_DEADLINE = 5.0
"""Seconds until a router that gives its port up must have ended."""
_CONFIG_PERIOD = 0.25
"""Seconds between looks at the file of settings."""
_OPEN_TRIES = 20
"""Before a router that was closed for new settings gives up."""


class RouterMetadata(msgspec.Struct):
    """What a zteam router says of itself in Zenoh's admin space."""

    name: str | None = None
    uid: int | None = None
    pid: int | None = None


class RouterLink(msgspec.Struct):
    """A connection of a session; `dst` is the session's end, such as tcp/127.0.0.1:33004."""

    dst: str = ""


class RouterSession(msgspec.Struct):
    """A session at a router."""

    peer: str = ""
    """Its id."""
    whatami: str = ""
    """client, peer or router."""
    links: list[RouterLink] = msgspec.field(default_factory=list)


class RouterRecord(msgspec.Struct):
    """What a router says of itself in Zenoh's admin space; one that is not zteam's has no metadata."""

    zid: str = ""
    locators: list[str] = msgspec.field(default_factory=list)
    metadata: RouterMetadata | None = None
    version: str = ""
    sessions: list[RouterSession] = msgspec.field(default_factory=list)


def read_record(session: zenoh.Session, router: str) -> RouterRecord | None:
    for reply in session.get(f"@/{router}/router", timeout=1.0):
        if reply.ok is not None:
            try:
                return msgspec.json.decode(reply.ok.payload.to_bytes(), type=RouterRecord)
            except msgspec.DecodeError as error:
                log.debug("admin space: %s", error)
    return None


def read_admin(options: BusOptions) -> RouterRecord | None:
    """The record of the router that is connected to, read without a namespace (a session with one gets nothing).

    None without a router.
    """
    session = try_open(msgspec.structs.replace(options, namespace=None))
    if session is None:
        return None
    with session:
        # Routers that are linked to it would answer too.
        return next((read_record(session, str(zid)) for zid in session.info.routers_zid()), None)


def _find_endpoint(listen: str, locators: Sequence[str]) -> str:
    """That of a router's locators which is the endpoint `listen`, with the port that it got."""
    host = listen.rpartition(":")[0] + ":"
    return next((found for found in locators if found.startswith(host)), locators[0] if locators else listen)


class Router:
    """An open router; `endpoint` is where it really listens first (port 0 becomes the port it got)."""

    def __init__(self, options: RouterOptions) -> None:
        if options.tls is not None:
            from zteam.bus.tls import own_fault

            if fault := own_fault(options.tls):
                raise BusError(fault)
        self._file, self._lease = options.config, options.lease
        self._version = _version_of(options.config)
        self._config = router_config(options)
        self._links = LinkCount()
        self._changed = threading.Condition()
        self._idle_since = monotonic()
        self._idle_exit: float | None = None
        self._session = self._open(self._config, options.listen)
        record = read_record(self._session, str(self._session.zid()))
        locators = record.locators if record else []
        self.endpoint = _find_endpoint(options.listen[0], locators)
        # An endpoint with a host such as 0.0.0.0 stands for several, of which a locator is one.
        listen = tuple(_find_endpoint(e, locators) if e.endswith(":0") else e for e in options.listen)
        self._options = msgspec.structs.replace(options, listen=listen)
        """How it is opened again."""
        self._note = _state_file(self.endpoint, _NOTE)
        self._made = [folder for folder in self._note.parents if not folder.exists()]
        """Folders that are removed with the note, the innermost first."""
        try:
            self._note.parent.mkdir(parents=True, exist_ok=True)
            self._note.write_text(self.endpoint)
        except OSError as error:
            log.debug("the router is found by its endpoint only: %s", error)

    def _open(self, config: zenoh.Config, listen: Sequence[str]) -> zenoh.Session:
        """A session that routes and counts its clients. Raises BusError."""
        try:
            session = open_session(config, "router")
        except zenoh.ZError as error:
            text, places = str(error), ", ".join(listen)
            if "Address already in use" in text:
                raise BusError(
                    f"{places} is in use: another router is there (use it), or choose another port with --listen"
                ) from None
            # What follows is the line in Zenoh's own source.
            raise BusError(f"cannot listen at {places}: {text.splitlines()[0].partition(' at /')[0]}") from None
        with self._changed:
            # The ends of the last session's links may be told later.
            self._links = links = LinkCount()
            self._idle_since = monotonic()
        on_transport = partial(self._on_transport, links)
        self._events = session.info.declare_transport_events_listener(on_transport, history=True)
        self._silence = limit_silence(session, self._lease)
        if self._idle_exit is not None:
            self._serve_release(session)
        return session

    def _serve_release(self, session: zenoh.Session) -> None:
        callback: Any = zenoh.handlers.Callback(self._on_release, indirect=False)
        session.declare_queryable(RELEASE, callback)

    def _take_changed_file(self) -> None:
        """Open the session again where its file of settings has changed, with all links; clients come back.

        Zenoh applies an access control when it opens, and only so is a certificate that was taken back out. A file
        that Zenoh does not take changes nothing.
        """
        version = _version_of(self._file)
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
            self._session, self._config = self._open(config, self._options.listen), config
        except BusError as error:
            log.error("--config %s: %s; the router keeps the settings it had", self._file, error)
            self._session = self._open_again()
        else:
            log.info("%s has changed: the router has taken it and opened all links again", self._file)

    def _open_again(self) -> zenoh.Session:
        """With the settings it had. Its certificate may be about to be replaced, and its key fit in a moment only."""
        for _ in range(_OPEN_TRIES):
            try:
                return self._open(self._config, self._options.listen)
            except BusError as error:
                log.debug("%s", error)
                pause(_CONFIG_PERIOD)
        return self._open(self._config, self._options.listen)

    @property
    def _clients(self) -> set[str]:
        return self._links.sessions

    def _on_transport(self, links: LinkCount, event: zenoh.TransportEvent) -> None:
        with self._changed:
            links.take(event)
            if event.kind != zenoh.SampleKind.PUT:
                self._idle_since = monotonic()
            self._changed.notify_all()

    def _on_release(self, query: zenoh.Query) -> None:
        """A launcher of this user asks for the port: granted, and then this ends with it, if it is the only client."""
        asker = query.payload.to_bytes() if query.payload else b""
        with query, self._changed:
            if asker == str(os.getuid()).encode() and len(self._clients) == 1:
                self._idle_exit = 0.0
                query.reply(RELEASE, b"")

    def run(self, stopping: Callable[[], bool], idle_exit: float | None = None) -> None:
        """Route until `stopping()`, checked when `wake` is called, or until no client was there for `idle_exit` s."""
        self._idle_exit = idle_exit
        if idle_exit is not None:
            self._serve_release(self._session)
        while True:
            with self._changed:
                if stopping():
                    return
                left = None
                if self._idle_exit is not None and not self._clients:
                    left = self._idle_since + self._idle_exit - monotonic()
                    if left <= 0:
                        log.info("no client for %g s: the router ends", self._idle_exit)
                        return
                if self._file is not None:
                    left = _CONFIG_PERIOD if left is None else min(_CONFIG_PERIOD, left)
                self._changed.wait(left)
            # Without the lock: closing a session ends links, which `_on_transport` counts.
            if self._file is not None:
                self._take_changed_file()

    def wake(self) -> None:
        """Let `run` look at `stopping` again."""
        with self._changed:
            self._changed.notify_all()

    def close(self) -> None:
        """Stop routing."""
        try:
            self._note.unlink(missing_ok=True)
            for folder in self._made:
                folder.rmdir()
        except OSError as error:
            log.debug("%s", error)
        self._session.close()  # type: ignore[no-untyped-call]


def _version_of(config: str | None) -> tuple[int, ...]:
    """Changes with each new content of the file, also where a link to it leads elsewhere; empty without one."""
    try:
        found = Path(config).stat() if config is not None else None
    except OSError:
        # It is about to be replaced, or router_config says why it cannot be read.
        found = None
    return (found.st_dev, found.st_ino, found.st_mtime_ns, found.st_size) if found is not None else ()


def detach() -> None:
    """Fork away from the spawner, before Zenoh starts threads; the spawner's half ends here."""
    if hasattr(os, "fork") and os.fork() != 0:
        os._exit(0)


def release_port(endpoint: str) -> bool:
    """Whether the router on demand at `endpoint` has ended for the caller: it is this user's, and had no client."""
    # The caller may become the router: what the first session of a process runs on is settled for good.
    session = try_open(BusOptions(connect=endpoint), "router")
    if session is None:
        return False
    with session:
        granted = [reply for reply in session.get(RELEASE, payload=str(os.getuid()), timeout=1.0) if reply.ok]
    deadline = monotonic() + _RELEASE_DEADLINE
    while granted and monotonic() < deadline:
        if not port_accepts(endpoint):
            return True
        pause(0.01)
    return False


_NOTE = "endpoint"


def _state_folder() -> Path:
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "zteam"


def _state_file(endpoint: str, suffix: str) -> Path:
    address = host_port(endpoint)
    return _state_folder() / f"router-{address[1] if address else 'local'}.{suffix}"


def router_log_path(endpoint: str) -> Path:
    """Log file of the router on demand: per user and port, in the user's state folder."""
    return _state_file(endpoint, "log")


def find_local_routers() -> list[str]:
    """The endpoints of this user's routers on this machine, sorted. Each has noted its own in the state folder."""
    found = []
    for note in _state_folder().glob(f"router-*.{_NOTE}"):
        try:
            endpoint = note.read_text()
            if port_accepts(endpoint):
                found.append(endpoint)
            else:
                # It was killed.
                note.unlink()
        except OSError as error:
            log.debug("%s: %s", note, error)
    return sorted(found)


def spawn_router(endpoint: str, lease: float = LEASE) -> None:
    """Start a detached router that ends by itself. If several processes do this at once, one router gets the port.

    Its lease is never shorter than the usual one, because others will use it too.
    """
    log.info("starting a router at %s", endpoint)
    path = router_log_path(endpoint)
    command = [sys.executable, "-m", "zteam.cli.zteam_router", "--listen", endpoint, "--detached", str(IDLE_EXIT)]
    command += ["--lease", str(max(lease, LEASE))]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("ab") as output:
            # The child forks before it imports zenoh and its first half ends at once: no zombie stays here, and
            # no folder named zteam or zenoh in the user's directory can shadow the packages (cwd, -P).
            subprocess.run(
                [command[0], "-P", *command[1:]],
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
