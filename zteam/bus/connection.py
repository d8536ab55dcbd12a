"""Opening a session: find the router, start one on demand, and log what the process waits for."""

import logging
import os
import random
import select
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import msgspec
import zenoh

from zteam.bus.bus import Bus
from zteam.bus.link import LinkCheck
from zteam.bus.options import FROM_STDIN as FROM_STDIN
from zteam.bus.options import LEASE, RELEASE, BusOptions, client_config, open_session
from zteam.bus.probe import host_port, port_accepts, why_refused
from zteam.bus.zenoh_session import ZenohTransport
from zteam.clock import Every, monotonic, pause
from zteam.errors import BusError

log = logging.getLogger("zteam.bus")

_LOOK_AGAIN = 0.1
"""Seconds between looks at the request to stop while waiting for the launcher."""
ON_DEMAND_DEADLINE = 20.0
"""Seconds until a router on demand must be up; an interpreter took 2.2 s to start on a crowded machine."""
_RELEASE_DEADLINE = 5.0
"""Seconds until a router that gives its port up must have ended."""
IDLE_EXIT = 10.0
"""Seconds after its last client that a router on demand ends."""


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

    Without `--connect` the local router is started if there is none. With it, this waits for the router, for ever
    or `patience` seconds, and says so; `stopping()` ends the wait. Raises BusError when there is no session.
    """
    if options.connect == FROM_STDIN:
        options = msgspec.structs.replace(options, connect=_read_endpoint(stopping))
    if options.connect is None:
        session = _open_on_demand(options, stopping)
    else:
        session = _open_patiently(options, patience, stopping)
    transport = ZenohTransport(session)
    transport.watch_link(LinkCheck(session, options).on_link)
    if options.connect is None:
        _keep_router_alive(transport, options)
    return Bus(transport)


def _try_open(options: BusOptions) -> zenoh.Session | None:
    try:
        return open_session(client_config(options), "small" if options.small else "usual")
    except zenoh.ZError as error:
        log.debug("open: %s", error)
        return None


def _open_patiently(options: BusOptions, patience: float | None, stopping: Callable[[], bool]) -> zenoh.Session:
    start, say, delay = monotonic(), Every(5.0), 0.05
    while not stopping():
        session = _try_open(options)
        if session is not None:
            return session
        waited = monotonic() - start
        if patience is not None and waited > patience:
            raise BusError(_no_router(options.endpoint))
        if waited > 1.0 and say.due():
            why = f": {': '.join(why_refused(options.endpoint))}" if port_accepts(options.endpoint) else ""
            log.warning("waiting for a Zenoh router at %s (Ctrl+C to give up)%s", options.endpoint, why)
        pause(delay)
        delay = min(0.5, delay * 1.5)
    raise BusError(f"stopped while waiting for a Zenoh router at {options.endpoint}")


def _no_router(endpoint: str) -> str:
    if port_accepts(endpoint):
        return ": ".join(why_refused(endpoint))
    return (
        f"no Zenoh router answers at {endpoint}: start one with 'zteam-router --listen {endpoint}', "
        "or leave --connect out"
    )


def _open_on_demand(options: BusOptions, stopping: Callable[[], bool]) -> zenoh.Session:
    deadline = monotonic() + ON_DEMAND_DEADLINE
    respawn = Every(1.0)
    refused_handshakes = 0
    while monotonic() < deadline and not stopping():
        if not port_accepts(options.endpoint):
            if respawn.due():
                spawn_router(options.endpoint, options.lease)
            pause(0.01)
            continue
        session = _try_open(options)
        if session is not None:
            _refuse_foreign_router(session, options)
            return session
        refused_handshakes += 1
        if refused_handshakes >= 3:
            raise BusError(": ".join(why_refused(options.endpoint)))
    raise BusError(
        f"no router came up at {options.endpoint} within {ON_DEMAND_DEADLINE:.0f} s: "
        f"see {router_log_path(options.endpoint)}, or start 'zteam-router' by hand"
    )


def _refuse_foreign_router(session: zenoh.Session, options: BusOptions) -> None:
    """On a shared machine the default port may be another user's: two users' teams must not mix by accident."""
    owner = router_metadata(options)
    uid = owner.uid if owner else None
    if uid is not None and uid != os.getuid():
        session.close()  # type: ignore[no-untyped-call]
        raise BusError(
            f"the router at {options.endpoint} belongs to user id {uid}: to join it on purpose use "
            f"--connect {options.endpoint}, or run your own with 'zteam-router --listen tcp/127.0.0.1:PORT'"
        )


class RouterMetadata(msgspec.Struct):
    """What a zteam router says of itself in Zenoh's admin space."""

    name: str | None = None
    uid: int | None = None
    pid: int | None = None
    version: str | None = None


class _Admin(msgspec.Struct):
    zid: str = ""
    locators: list[str] = msgspec.field(default_factory=list)
    metadata: RouterMetadata | None = None
    version: str = ""


def router_metadata(options: BusOptions) -> RouterMetadata | None:
    """What the router says of its process; None if it says nothing (zenohd, or no answer)."""
    admin = read_admin(options)
    return admin.metadata if admin else None


def read_admin(options: BusOptions) -> _Admin | None:
    """The router's admin record, read through a session without a namespace (one with gets nothing)."""
    session = _try_open(msgspec.structs.replace(options, namespace=None))
    if session is None:
        return None
    try:
        for reply in session.get("@/*/router", timeout=1.0):
            if reply.ok is not None:
                try:
                    return msgspec.json.decode(reply.ok.payload.to_bytes(), type=_Admin)
                except msgspec.DecodeError as error:
                    log.debug("admin space: %s", error)
    finally:
        session.close()  # type: ignore[no-untyped-call]
    return None


def release_port(endpoint: str) -> bool:
    """Whether the router on demand at `endpoint` has ended for the caller: it is this user's, and had no client."""
    try:
        # The caller may become the router: what the first session of a process runs on is settled for good.
        session = open_session(client_config(BusOptions(connect=endpoint)), "router")
    except zenoh.ZError as error:
        log.debug("open: %s", error)
        return False
    try:
        granted = [reply for reply in session.get(RELEASE, payload=str(os.getuid()), timeout=1.0) if reply.ok]
    finally:
        session.close()  # type: ignore[no-untyped-call]
    deadline = monotonic() + _RELEASE_DEADLINE
    while granted and monotonic() < deadline:
        if not port_accepts(endpoint):
            return True
        pause(0.01)
    return False


def router_log_path(endpoint: str) -> Path:
    """Log file of the router on demand: per user and port, in the user's state folder."""
    state = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "zteam"
    address = host_port(endpoint)
    return state / f"router-{address[1] if address else 'local'}.log"


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


def _keep_router_alive(transport: ZenohTransport, options: BusOptions) -> None:
    """Start a router on demand again when it dies; Zenoh reconnects by itself."""

    def on_link(up: bool) -> None:
        if not up:
            # Not in the callback: it holds a Zenoh thread. Spread out, so that few routers compete for the port.
            # Host time: a restart must not block Zenoh's thread, and clients must not all try at once.
            timer = threading.Timer(random.uniform(0.0, 0.2), revive)  # noqa: TID251
            timer.daemon = True
            timer.start()

    def revive() -> None:
        if transport.up or transport.closed or port_accepts(options.endpoint):
            return
        try:
            spawn_router(options.endpoint, options.lease)
        except BusError as error:
            log.error("%s", error)

    transport.watch_link(on_link)
