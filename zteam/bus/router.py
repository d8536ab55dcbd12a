"""The one Zenoh router of a machine: the router itself, and what its users ask of it, or do to have one."""

import logging
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import zenoh

from zteam.bus.options import LEASE, RELEASE, BusOptions, host_port, open_session, port_accepts, router_config, try_open
from zteam.clock import monotonic, pause
from zteam.errors import BusError

log = logging.getLogger("zteam.router")

ON_DEMAND_DEADLINE = 20.0
"""Seconds until a router on demand must be up; an interpreter took 2.2 s to start on a crowded machine."""
IDLE_EXIT = 10.0
"""Seconds after its last client that a router on demand ends."""
_RELEASE_DEADLINE = 5.0
"""Seconds until a router that gives its port up must have ended."""


class RouterMetadata(msgspec.Struct):
    """What a zteam router says of itself in Zenoh's admin space."""

    name: str | None = None
    uid: int | None = None
    pid: int | None = None


class RouterRecord(msgspec.Struct):
    """What a router says of itself in Zenoh's admin space; one that is not zteam's has no metadata."""

    zid: str = ""
    locators: list[str] = msgspec.field(default_factory=list)
    metadata: RouterMetadata | None = None
    version: str = ""


def _read_record(session: zenoh.Session, router: str = "*") -> RouterRecord | None:
    for reply in session.get(f"@/{router}/router", timeout=1.0):
        if reply.ok is not None:
            try:
                return msgspec.json.decode(reply.ok.payload.to_bytes(), type=RouterRecord)
            except msgspec.DecodeError as error:
                log.debug("admin space: %s", error)
    return None


def read_admin(options: BusOptions) -> RouterRecord | None:
    """The router's record, read through a session without a namespace (one with gets nothing); None without one."""
    session = try_open(msgspec.structs.replace(options, namespace=None))
    if session is None:
        return None
    with session:
        return _read_record(session)


class Router:
    """An open router; `endpoint` is where it really listens (port 0 becomes the port it got)."""

    def __init__(self, listen: str, config: str | None = None, lease: float = LEASE) -> None:
        try:
            self._session = open_session(router_config(listen, config, lease), "router")
        except zenoh.ZError as error:
            text = str(error)
            if "Address already in use" in text:
                raise BusError(
                    f"{listen} is in use: another router is there (use it), or choose another port with --listen"
                ) from None
            raise BusError(f"cannot listen at {listen}: {text.splitlines()[0]}") from None
        self._clients: set[str] = set()
        self._changed = threading.Condition()
        self._idle_since = monotonic()
        self._idle_exit: float | None = None
        self._events = self._session.info.declare_transport_events_listener(self._on_transport, history=True)
        record = _read_record(self._session, str(self._session.zid()))
        self.endpoint = record.locators[0] if record and record.locators else listen
        self._note = _state_file(self.endpoint, _NOTE)
        self._made = [folder for folder in self._note.parents if not folder.exists()]
        """Folders that are removed with the note, the innermost first."""
        try:
            self._note.parent.mkdir(parents=True, exist_ok=True)
            self._note.write_text(self.endpoint)
        except OSError as error:
            log.debug("the router is found by its endpoint only: %s", error)

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        zid = str(event.transport.zid)
        with self._changed:
            if event.kind == zenoh.SampleKind.PUT:
                self._clients.add(zid)
            else:
                self._clients.discard(zid)
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
            callback: Any = zenoh.handlers.Callback(self._on_release, indirect=False)
            self._session.declare_queryable(RELEASE, callback)
        with self._changed:
            while not stopping():
                left = None
                if self._idle_exit is not None and not self._clients:
                    left = self._idle_since + self._idle_exit - monotonic()
                    if left <= 0:
                        log.info("no client for %g s: the router ends", self._idle_exit)
                        return
                self._changed.wait(left)

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
