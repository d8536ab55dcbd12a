"""Why the router at an endpoint takes no session of this process, and what to do."""

import socket

from zteam.bus.options import TLS_VARIABLES, BusOptions, TlsFiles, host_port, port_accepts
from zteam.bus.router import ANSWER_WITHIN, RouterRecord, find_local_routers
from zteam.clock import monotonic

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
            return _why_no_trust(endpoint, address, options.tls)
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


def _why_no_trust(endpoint: str, address: tuple[str, int], tls: TlsFiles) -> tuple[str, str]:
    from zteam.bus.tls import own_fault, own_identity, refusal

    if fault := own_fault(tls) or refusal(address, tls):
        return f"the router at {endpoint} and this process do not trust each other", fault
    return (
        f"the router at {endpoint} gives the certificate {own_identity(tls)[0]} no rights",
        "it was revoked or replaced ('zteam certs list'), or the team's namespace is another one (--namespace)",
    )


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
        before, listens = self._given, port_accepts(self._options.endpoint)
        self._given = ": ".join(why_refused(self._options)) if listens else ""
        return None if self._given and self._given == before else self._given
