"""The TCP sockets behind a session's links: Zenoh offers no way to end a link, nor to say how long it may be silent."""

import socket
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import zenoh

Ends = tuple[str, str]
"""Zenoh's endpoints of a link: this process's and the other one's."""


class LinkCount:
    """How many links of each other session are open. The end of one may be told after the beginning of the next."""

    def __init__(self) -> None:
        self._links = Counter[str]()

    def count(self, event: zenoh.TransportEvent) -> bool:
        """Count a beginning or an end. Whether it begins a link in the place of one whose end has not been told."""
        session, begins = str(event.transport.zid), event.kind == zenoh.SampleKind.PUT
        replaces = begins and self._links[session] > 0
        self._links[session] += 1 if begins else -1
        if not self._links[session]:
            del self._links[session]
        return replaces

    @property
    def sessions(self) -> set[str]:
        return {session for session, links in self._links.items() if links > 0}


def links_of(session: zenoh.Session) -> set[Ends]:
    try:
        return {(link.src, link.dst) for link in session.info.links()}
    except zenoh.ZError:
        # Closed meanwhile.
        return set()


def cut(links: set[Ends]) -> None:
    for connection in _find(links):
        # It has ended meanwhile.
        with suppress(OSError):
            connection.shutdown(socket.SHUT_RDWR)


def limit_silence(session: zenoh.Session, seconds: float) -> "zenoh.LinkEventsListener[None]":
    """Let the system end each link of a session, now and later, over which data goes unacknowledged for so long.

    Zenoh ends a link after its lease. But over TLS it first sends a goodbye, behind all that waits to be sent, and so
    it would wait for a host that is cut off for many minutes. Systems other than Linux have no such limit.
    """
    option = getattr(socket, "TCP_USER_TIMEOUT", None)

    def limit(event: zenoh.LinkEvent) -> None:
        if option is not None and event.kind == zenoh.SampleKind.PUT:
            for connection in _find({(event.link.src, event.link.dst)}):
                with suppress(OSError):
                    connection.setsockopt(socket.IPPROTO_TCP, option, round(seconds * 1e3))

    callback: Any = zenoh.handlers.Callback(limit, indirect=False)
    return session.info.declare_link_events_listener(callback, history=True)


def _find(links: set[Ends]) -> Iterator[socket.socket]:
    """This process's sockets of TCP links. They are Zenoh's, which closes them."""
    wanted = {(src.partition("/")[2], dst.partition("/")[2]) for src, dst in links}
    paths = list[Path]()
    # Without a descriptor left, nothing is found.
    with suppress(OSError):
        paths += Path("/dev/fd").iterdir()
    for path in paths:
        # No socket, or closed meanwhile.
        with suppress(OSError):
            connection = socket.socket(fileno=int(path.name))
            try:
                if (_address(connection.getsockname()), _address(connection.getpeername())) in wanted:
                    yield connection
            finally:
                connection.detach()


def _address(name: object) -> str:
    match name:
        case (str(host), int(port), *_):
            return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    return ""
