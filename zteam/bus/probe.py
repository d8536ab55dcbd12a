"""What is at an endpoint, as bytes tell: Zenoh says no more than that it could not connect."""

import os
import socket

from zteam.bus.local_routers import find_local_routers

_INIT_SYN = bytes.fromhex("1900c109f2")
_INIT_SYN_END = bytes.fromhex("0ac8ff812701")
"""Zenoh's first handshake message, protocol version 9, around 16 bytes of session id: only a Zenoh router answers."""
_ALERT = b"\x15\x03"
"""The first bytes with which TLS refuses what is no TLS."""


def host_port(endpoint: str) -> tuple[str, int] | None:
    """Host and port of a tcp or tls endpoint, None for any other kind."""
    protocol, slash, address = endpoint.partition("/")
    host, colon, port = address.partition("#")[0].partition("?")[0].rpartition(":")
    if not slash or not colon or protocol not in {"tcp", "tls"} or not port.isdigit():
        return None
    return host.strip("[]"), int(port)


def port_accepts(endpoint: str, timeout: float = 1.0) -> bool:
    """Whether something accepts TCP connections at `endpoint`."""
    address = host_port(endpoint)
    if address is None:
        return True
    try:
        socket.create_connection(address, timeout=timeout).close()
    except OSError:
        return False
    return True


def _first_answer(address: tuple[str, int]) -> bytes | None:
    """What is answered to the first message of Zenoh; None if a router of this machine, or anything, stays silent."""
    peer = ""
    try:
        with socket.create_connection(address, timeout=1.0) as link:
            host, port = link.getpeername()[:2]
            peer = f"tcp/{host}:{port}"
            link.sendall(_INIT_SYN + os.urandom(16) + _INIT_SYN_END)
            answer = link.recv(64)
    except TimeoutError:
        return None
    except OSError:
        answer = b""
    # A router that has too many connections to open ends some of them.
    return None if not answer and peer in find_local_routers() else answer


def _is_zenoh(answer: bytes) -> bool:
    """Whether it is, behind two bytes of length, an InitAck (message 1 with the A flag) or a Close (3, short)."""
    head = answer[2] if len(answer) > 2 else 0
    return (head & 0x3F) == 0x21 or (len(answer) == 4 and head & 0x1F == 3)


def why_refused(endpoint: str) -> tuple[str, str]:
    """Why no session was opened at an endpoint that accepts connections, and what to do."""
    address = host_port(endpoint)
    answer = b"" if address is None else _first_answer(address)
    protocol, _, place = endpoint.partition("/")
    if answer is None:
        step = (
            "a router there is frozen, or held up by connections that say nothing ('ss -tnp' lists them); "
            "if another program is there, name a router elsewhere with --connect"
        )
        return f"{endpoint} takes connections but does not answer", step
    if answer.startswith(_ALERT):
        if protocol == "tls":
            return (
                f"the router at {endpoint} and this process do not trust each other's certificates",
                "name them in a file with transport/link/tls, and that file with --config",
            )
        return f"the router at {endpoint} takes TLS only", f"use --connect tls/{place}, with certificates in --config"
    if _is_zenoh(answer):
        if protocol == "tls":
            return f"the router at {endpoint} does not speak TLS", f"use --connect tcp/{place}"
        return (
            f"the router at {endpoint} refuses this process",
            "name in --config what it asks for, such as a user and a password",
        )
    return (
        f"{endpoint} is held by something that does not speak Zenoh",
        "end it, or run a router elsewhere and name it with --connect",
    )
