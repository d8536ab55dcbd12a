"""The connections of the view's servers: which are taken, and may command, and how many: those that bring no request
are closed.
"""

import asyncio
import contextlib
import errno
import hmac
import ipaddress
import re
import resource
import secrets
import socket
import threading
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

from starlette.types import Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from zteam.errors import log

_HOST = re.compile(r"(?:\[([^\[\]]+)\]|([^:\[\]]+))(?::[0-9]*)?")
"""An address of IPv6 in brackets, or a name or another address; then a port."""
LOOPBACK = ("127.0.0.1", "localhost", "::1")


def make_token() -> str:
    """A token that cannot be guessed: 128 bits. Hexadecimal, as a word that begins with "-" would be an option."""
    return secrets.token_hex(16)


def is_token(given: str, token: str) -> bool:
    """Whether it is the token; it takes the same time wherever they differ."""
    return hmac.compare_digest(given.encode(), token.encode())


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches what listens there."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class Gatekeeper:
    """Knows the names under which a page of this server can be reached.

    A name of another site that leads here (DNS rebinding) is none of them, so a page of that site gets nothing.
    """

    def __init__(self, host: str) -> None:
        """`host` is where the server listens."""
        self._only_here = is_loopback(host)
        names = {host, *LOOPBACK} if self._only_here else {host, *LOOPBACK, socket.gethostname(), socket.getfqdn()}
        self._names = {name.lower() for name in names}

    def takes_host(self, header: str) -> bool:
        """Whether a request with this `Host` is answered; a published port may be another one than the server's."""
        match = _HOST.fullmatch(header)
        if match is None:
            return False
        name = (match[1] or match[2]).lower()
        if name in self._names:
            return True
        try:
            address = ipaddress.ip_address(name)
        except ValueError:
            return False
        # An address is no name that another site could lead here.
        return not self._only_here or address.is_loopback


def takes_origin(origin: str | None, host_header: str) -> bool:
    """Whether a page from `origin` may open a socket; a program that is no browser sends none."""
    return origin in (None, f"http://{host_header}", f"https://{host_header}")


PATIENCE = 10.0
"""Host seconds for a connection to bring a whole request, the first or the next."""
_SHORTAGE = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


def share_of_descriptors(part: int, most: int) -> int:
    """How many connections are one `part` of the descriptors that this process may open; `most` at most."""
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return most if soft == resource.RLIM_INFINITY else max(8, min(most, soft // part))


class Connections:
    """At most `most` at a time: another one ends the one that has waited longest. Half of them may be kept.

    A connection waits for a request, then it is busy with it, then it waits again; the socket of a page is kept once
    the page has said hello.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._open: dict[asyncio.Transport, asyncio.TimerHandle | None] = {}
        """Those that are not kept, the oldest first, with the end of their patience; None while they are busy."""
        self._kept: dict[asyncio.Transport, bool] = {}
        """Whether each is trusted."""
        self._told = False

    def open(self, transport: asyncio.Transport) -> None:
        """A connection has come, and waits for its request."""
        if len(self._open) + len(self._kept) >= self._most:
            self.end(min(self._open, key=lambda each: self._open[each] is None, default=transport))
        self._wait(transport)

    def _wait(self, transport: asyncio.Transport, unsent: int = 0) -> None:
        # Host time: a client's silence.
        loop = asyncio.get_running_loop()
        self._forget(transport)
        self._open[transport] = loop.call_later(PATIENCE, self._look_at, transport, unsent)

    def _look_at(self, transport: asyncio.Transport, unsent: int) -> None:
        """End it, unless it takes the answer to its last request still."""
        left = transport.get_write_buffer_size()
        if left > 0 and (left < unsent or not unsent):
            self._wait(transport, left)
        else:
            self.end(transport)

    def begin(self, transport: asyncio.Transport) -> None:
        """Its request has come."""
        if (timer := self._open.get(transport)) is not None:
            timer.cancel()
            self._open[transport] = None

    def rest(self, transport: asyncio.Transport) -> None:
        """Its request is answered."""
        if transport in self._open:
            self._wait(transport)

    def keep(self, transport: asyncio.Transport, *, trusted: bool) -> bool:
        """Never end it by itself from now on, unless too many come; False if there are too many that are trusted.

        It takes the place of the oldest one that is not.
        """
        if transport not in self._kept and len(self._kept) >= self._most // 2:
            stranger = next((each for each, is_trusted in self._kept.items() if not is_trusted), None)
            if stranger is None:
                return False
            self.end(stranger)
        self._forget(transport)
        self._kept[transport] = trusted
        return True

    def close(self, transport: asyncio.Transport) -> None:
        self._forget(transport)
        self._kept.pop(transport, None)

    def _forget(self, transport: asyncio.Transport) -> None:
        if timer := self._open.pop(transport, None):
            timer.cancel()

    def end(self, *transports: asyncio.Transport) -> None:
        """End these, or all."""
        for transport in transports or (*self._open, *self._kept):
            transport.abort()
            self.close(transport)

    def on_loop_error(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """An error on the thread of the server: where no descriptor is left, say so once and end what waits."""
        error = context.get("exception")
        if not (isinstance(error, OSError) and error.errno in _SHORTAGE):
            loop.default_exception_handler(context)
            return
        for transport in [*self._open]:
            self.end(transport)
        if not self._told:
            self._told = True
            log.warning("a connection could not be taken: %s; those that wait are closed", error.strerror)


Answer = Callable[[asyncio.Transport, Scope, Receive, Send], Awaitable[None]]


def protocols_of(connections: Connections, answer: Answer) -> tuple[type[asyncio.Protocol], type[asyncio.Protocol]]:
    """Those of HTTP and of WebSocket, whose connections are counted; `answer` is told which one a request is of."""

    class Http(H11Protocol):
        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            connections.open(transport)
            super().connection_made(transport)
            self.app = partial(answer, transport)

        def connection_lost(self, exc: Exception | None) -> None:
            connections.close(self.transport)
            super().connection_lost(exc)

    class WebSocket(WebSocketsSansIOProtocol):
        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            self.app = partial(answer, transport)

        def connection_lost(self, exc: Exception | None) -> None:
            connections.close(self.transport)
            super().connection_lost(exc)

    return Http, WebSocket


MAX_HEAD = 1 << 14
"""Bytes of the first request."""
MOST_CLIENTS = 64
"""Connections; each takes three descriptors of the process."""
_CHUNK = 1 << 16


def open_front(
    listener: socket.socket, target: tuple[str, int], fail: Callable[[BaseException], None]
) -> Callable[[], None]:
    """A door before a server that bounds no connections, on a thread of its own, until `close()`, which is returned.

    Clients come to `listener` and go to `target`; `fail(error)` is called if the thread fails. A connection passes when
    its first request is whole. It is kept once the server has answered; until then it may be ended as those of the page
    are. The door neither reads nor changes what passes.
    """
    connections = Connections(share_of_descriptors(16, MOST_CLIENTS))
    loop, closing = asyncio.new_event_loop(), asyncio.Event()

    async def let_in(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Pass the bytes of one client to the server and back until either side ends."""
        client = writer.transport
        assert isinstance(client, asyncio.Transport)
        connections.open(client)
        try:
            head = await reader.readuntil(b"\r\n\r\n")
            connections.begin(client)
            from_server, to_server = await asyncio.open_connection(*target)
            with contextlib.closing(to_server):
                to_server.write(head)
                sending = asyncio.create_task(_pass_on(reader, to_server))
                answer = await from_server.read(_CHUNK)
                if answer and connections.keep(client, trusted=False):
                    writer.write(answer)
                    await _pass_on(from_server, writer)
                else:
                    client.abort()
                await sending
        except (OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass
        finally:
            connections.end(client)

    async def serve() -> None:
        loop.set_exception_handler(connections.on_loop_error)
        server = await asyncio.start_server(let_in, sock=listener, backlog=MOST_CLIENTS, limit=MAX_HEAD)
        await closing.wait()
        server.close()
        connections.end()

    def run() -> None:
        try:
            with asyncio.Runner(loop_factory=lambda: loop) as runner:
                runner.run(serve())
        except BaseException as error:
            fail(error)

    def close() -> None:
        with contextlib.suppress(RuntimeError):
            loop.call_soon_threadsafe(closing.set)
        thread.join(1.0)

    thread = threading.Thread(target=run, name="front", daemon=True)
    thread.start()
    return close


async def _pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Write what is read until the end, which ends the other side too."""
    with contextlib.suppress(OSError):
        while data := await reader.read(_CHUNK):
            writer.write(data)
            await writer.drain()
    writer.close()
