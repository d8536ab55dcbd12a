"""A door before a server that bounds no connections: it lets in clients that ask for something, and no more than a few.

A connection passes when its first request is whole. It is kept once the server has answered; until then it may be ended
as those of the page are. The door neither reads nor changes what passes.
"""

import asyncio
import contextlib
import socket
import threading
from collections.abc import Callable

from zteam.view.connections import Connections, share_of_descriptors

MAX_HEAD = 1 << 14
"""Bytes of the first request."""
MOST_CLIENTS = 64
"""Connections; each takes three descriptors of the process."""


class _Side(asyncio.Protocol):
    """One side of a connection, whose bytes go to `other`."""

    def __init__(self) -> None:
        self.transport: asyncio.Transport | None = None
        self.other: _Side | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        if self.other is not None and self.other.transport is not None:
            self.other.transport.write(data)

    def pause_writing(self) -> None:
        if self.other is not None and self.other.transport is not None:
            self.other.transport.pause_reading()

    def resume_writing(self) -> None:
        if self.other is not None and self.other.transport is not None:
            self.other.transport.resume_reading()

    def connection_lost(self, _error: Exception | None) -> None:
        if self.other is not None and self.other.transport is not None:
            self.other.transport.close()


class _Server(_Side):
    """The server's side."""

    def __init__(self, kept: Callable[[], bool]) -> None:
        """`kept()` is called with the first answer: whether the client may stay."""
        super().__init__()
        self._kept = kept
        self._answers = False

    def data_received(self, data: bytes) -> None:
        if self._answers or self._kept():
            self._answers = True
            super().data_received(data)
        elif self.transport is not None:
            self.transport.abort()


class _Client(_Side):
    """The client's side."""

    def __init__(self, connections: Connections, target: tuple[str, int]) -> None:
        super().__init__()
        self._connections, self._target = connections, target
        self._head = b""
        self._opening: asyncio.Task[None] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        assert self.transport is not None
        self._connections.open(self.transport)

    def data_received(self, data: bytes) -> None:
        transport = self.transport
        if self.other is not None or transport is None:
            super().data_received(data)
            return
        self._head += data
        if len(self._head) > MAX_HEAD:
            transport.abort()
        elif b"\r\n\r\n" in self._head and self._opening is None:
            transport.pause_reading()
            self._connections.begin(transport)
            self._opening = asyncio.get_running_loop().create_task(self._open(transport))

    async def _open(self, transport: asyncio.Transport) -> None:
        """Reach the server, and pass on what has come."""
        server = _Server(lambda: self._connections.keep(transport, trusted=False))
        try:
            await asyncio.get_running_loop().create_connection(lambda: server, *self._target)
        except OSError:
            transport.abort()
            return
        server.other, self.other = self, server
        if transport.is_closing() or server.transport is None:
            self.connection_lost(None)
            return
        server.transport.write(self._head)
        transport.resume_reading()

    def connection_lost(self, error: Exception | None) -> None:
        if self.transport is not None:
            self._connections.close(self.transport)
        super().connection_lost(error)


class Front:
    """The door. It has a thread of its own, from `start` until `close`."""

    def __init__(self, listener: socket.socket, target: tuple[str, int], fail: Callable[[BaseException], None]) -> None:
        """Clients come to `listener` and go to `target`; `fail(error)` is called if the thread fails."""
        self._listener, self._target, self._fail = listener, target, fail
        self._loop = asyncio.new_event_loop()
        self._closing = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="front", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._closing.set)
        self._thread.join(1.0)

    def _run(self) -> None:
        try:
            with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
                runner.run(self._serve())
        except BaseException as error:
            self._fail(error)

    async def _serve(self) -> None:
        connections = Connections(share_of_descriptors(16, MOST_CLIENTS))
        self._loop.set_exception_handler(connections.on_loop_error)
        server = await self._loop.create_server(
            lambda: _Client(connections, self._target), sock=self._listener, backlog=MOST_CLIENTS
        )
        await self._closing.wait()
        server.close()
        connections.end_all()
