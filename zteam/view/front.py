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
_CHUNK = 1 << 16


class Front:
    """The door. It has a thread of its own, from `start` until `close`."""

    def __init__(self, listener: socket.socket, target: tuple[str, int], fail: Callable[[BaseException], None]) -> None:
        """Clients come to `listener` and go to `target`; `fail(error)` is called if the thread fails."""
        self._listener, self._target, self._fail = listener, target, fail
        self._loop = asyncio.new_event_loop()
        self._closing = asyncio.Event()
        self._connections = Connections(share_of_descriptors(16, MOST_CLIENTS))
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
        self._loop.set_exception_handler(self._connections.on_loop_error)
        server = await asyncio.start_server(self._let_in, sock=self._listener, backlog=MOST_CLIENTS, limit=MAX_HEAD)
        await self._closing.wait()
        server.close()
        self._connections.end_all()

    async def _let_in(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Pass the bytes of one client to the server and back until either side ends."""
        client = writer.transport
        assert isinstance(client, asyncio.Transport)
        self._connections.open(client)
        try:
            head = await reader.readuntil(b"\r\n\r\n")
            self._connections.begin(client)
            from_server, to_server = await asyncio.open_connection(*self._target)
            with contextlib.closing(to_server):
                to_server.write(head)
                sending = asyncio.create_task(_pass_on(reader, to_server))
                answer = await from_server.read(_CHUNK)
                if answer and self._connections.keep(client, trusted=False):
                    writer.write(answer)
                    await _pass_on(from_server, writer)
                else:
                    client.abort()
                await sending
        except (OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            pass
        finally:
            self._connections.end(client)


async def _pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Write what is read until the end, which ends the other side too."""
    with contextlib.suppress(OSError):
        while data := await reader.read(_CHUNK):
            writer.write(data)
            await writer.drain()
    writer.close()
