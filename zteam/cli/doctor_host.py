"""What `zteam doctor` learns of this machine: versions, and the router."""

import os
import platform
import socket
from importlib.metadata import PackageNotFoundError, version

from zteam.bus import BusOptions
from zteam.bus.connection import host_port, port_accepts, read_admin
from zteam.diagnosis.finding import Finding, ok, problem
from zteam.launch import kinds

_PACKAGES = ("zteam", "eclipse-zenoh", "numpy", "msgspec", "numba", "pymunk", "pillow")
_INIT_SYN = bytes.fromhex("1900c109f2")
_INIT_SYN_END = bytes.fromhex("0ac8ff812701")
"""Zenoh's first handshake message, protocol version 9, around 16 bytes of session id: only a Zenoh router answers."""


def check_versions() -> Finding:
    """The versions of the packages that zteam needs."""
    found = [f"python {platform.python_version()}"]
    for package in _PACKAGES:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"{package} missing")
    return ok("versions", ", ".join(found))


def check_lasers() -> Finding:
    """Whether lasers are computed fast."""
    from importlib.util import find_spec

    if find_spec("numba") is None:
        return problem("lasers", "numba is missing: scans are computed slowly", "pip install numba")
    return ok("lasers", "compiled by numba")


def speaks_zenoh(endpoint: str) -> bool | None:
    """Whether a Zenoh router answers at a TCP endpoint; None for an endpoint that is not TCP."""
    address = host_port(endpoint)
    if address is None or not endpoint.startswith("tcp/"):
        return None
    try:
        with socket.create_connection(address, timeout=1.0) as link:
            link.settimeout(1.0)
            link.sendall(_INIT_SYN + os.urandom(16) + _INIT_SYN_END)
            answer = link.recv(64)
    except OSError:
        return False
    # Behind two bytes of length: InitAck is message 1 with the A flag.
    return len(answer) > 2 and answer[2] & 0x1F == 1 and bool(answer[2] & 0x20)


def check_router(options: BusOptions) -> Finding:
    """Whether a Zenoh router answers."""
    endpoint = options.endpoint
    if not port_accepts(endpoint):
        return problem("router", f"nothing listens at {endpoint}", kinds.ROUTER_KIND.hint)
    if speaks_zenoh(endpoint) is False:
        step = "end that program, or run 'zteam-router --listen tcp/127.0.0.1:PORT' and use --connect"
        return problem("router", f"what listens at {endpoint} does not speak Zenoh", step)
    admin = read_admin(endpoint)
    if admin is None:
        step = "is it frozen, or does it need TLS (--config)?"
        return problem("router", f"the router at {endpoint} does not answer", step)
    data = admin.metadata
    router = "zteam-router" if data and data.name else "a Zenoh router that is not zteam's"
    pid = f", process {data.pid}" if data and data.pid else ""
    return ok("router", f"{router} at {endpoint}{pid}, Zenoh {admin.version.partition('-')[0] or '?'}")
