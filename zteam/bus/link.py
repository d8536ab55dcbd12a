"""Whether a link to the router that has come back carries both ways, and its end where it does not.

A router ends a link that takes nothing for too long. If the session opens the next one meanwhile, the router may keep
the routes of the first: it takes what the session sends and sends it signs of life, but no message and no query, for
ever (1 of 20 floods of 150 MB to one session). A link that ends once more comes back whole.
"""

import logging
import socket
import threading
from pathlib import Path

import zenoh

from zteam.bus.options import BusOptions, client_config, open_session
from zteam.clock import pause
from zteam.names import declarations_key

log = logging.getLogger("zteam.bus")

_QUESTIONS = 6
"""After each return."""
_PERIOD = 2.0
"""Host seconds from an answer to the next question."""
_PATIENCE = 5.0
"""Host seconds for an answer: the process may be busy."""
_FAILURES = 3
"""Questions in a row without an answer: a busy router may miss one."""
_CUTS = 3
"""Links in a row that are ended: where an access control lets no query through, none is answered."""


class LinkCheck:
    """Asks one session, through the router, after each return of its link."""

    def __init__(self, session: zenoh.Session, options: BusOptions) -> None:
        self._session = session
        self._options = options
        self._key = declarations_key(str(session.zid()))
        self._changes = 0
        self._cuts = 0

    def on_link(self, up: bool) -> None:
        """The link was lost or is back: ask on a thread of its own."""
        self._changes += 1
        if up:
            threading.Thread(target=self._run, args=(self._changes,), name="link", daemon=True).start()

    def _run(self, change: int) -> None:
        failed = 0
        for _ in range(_QUESTIONS):
            links = _links(self._session)
            reached = self._is_reached()
            if self._changes != change or self._session.is_closed():
                return
            failed = failed + 1 if reached is False else 0
            if failed == _FAILURES:
                self._replace(links)
                return
            pause(_PERIOD)
        self._cuts = 0

    def _is_reached(self) -> bool | None:
        """Whether the session answers another one; None if that finds no router."""
        try:
            with open_session(client_config(self._options), "usual") as other:
                return any(reply.ok is not None for reply in other.get(self._key, timeout=_PATIENCE))
        except zenoh.ZError as error:
            log.debug("link: %s", error)
            return None

    def _replace(self, links: set[tuple[str, str]]) -> None:
        if self._cuts == _CUTS:
            log.error("no query reaches this process after %d new links: start it again", _CUTS)
            return
        self._cuts += 1
        log.warning("no query reaches this process on the link that came back: opening another link")
        _cut(links)


def _links(session: zenoh.Session) -> set[tuple[str, str]]:
    try:
        return {(link.src, link.dst) for link in session.info.links()}
    except zenoh.ZError:
        # Closed meanwhile.
        return set()


def _cut(links: set[tuple[str, str]]) -> None:
    """End TCP connections, given as Zenoh's endpoints of both ends: it offers no way to end the link of a session."""
    wanted = {(_of(src), _of(dst)) for src, dst in links}
    for descriptor in Path("/dev/fd").iterdir():
        try:
            connection = socket.socket(fileno=int(descriptor.name))
        except OSError:
            # No socket, or closed meanwhile.
            continue
        try:
            if (_address(connection.getsockname()), _address(connection.getpeername())) in wanted:
                connection.shutdown(socket.SHUT_RDWR)
        except OSError as error:
            # It is not connected.
            log.debug("link: %s", error)
        finally:
            # Zenoh's own: it closes it.
            connection.detach()


def _of(endpoint: str) -> str:
    return endpoint.partition("/")[2]


def _address(name: object) -> str:
    match name:
        case (str(host), int(port), *_):
            return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    return ""
