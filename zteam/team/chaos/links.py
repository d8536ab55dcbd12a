"""The links of a team that was started with `--chaos`: TCP connections to its router pass through this process, which
delays, slows or cuts them.

No byte is lost or changed, as on a bad wire under TCP. One thread moves the bytes of all links.
"""

import asyncio
import logging
import socket
import threading
from collections.abc import Callable
from contextlib import suppress

from zteam import names
from zteam.bus import Bus
from zteam.bus.options import host_port
from zteam.clock import monotonic
from zteam.errors import BusError, UsageError
from zteam.team.chaos.means import LinkReply, LinkRequest, Wire

log = logging.getLogger("zteam")

_CHUNK = 1 << 16
"""Bytes that are read at once."""
_MOST_RATE = 1 << 20
"""Bytes a second that a delayed direction without a limit holds."""
_MOST_HELD = 1 << 22
"""Bytes that a delayed direction holds at most."""
_SLICE = 0.02
"""Seconds of a limited rate that are sent at once."""
_REST = 1.0
"""Host seconds without new connections after one could not be accepted."""


class Link:
    """The link of one process. Any thread may change it."""

    def __init__(self, loop: asyncio.AbstractEventLoop, target: tuple[str, int]) -> None:
        """A free port of the loopback interface leads to `target`. Raises OSError."""
        self._loop, self.target = loop, target
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.setblocking(False)
        self.port = self._listener.getsockname()[1]
        self.up = self.down = Wire()
        """From the process to the router, and back."""
        self.changed: asyncio.Future[None] = loop.create_future()
        """Done with the next change."""
        self.connections: set[asyncio.Task[None]] = set()
        self._healing: asyncio.TimerHandle | None = None

    def change(self, up: Wire | None = None, down: Wire | None = None, seconds: float = 0.0) -> None:
        """Make the two directions so, None = a good one; with `seconds`, for so many of the host's."""
        self.up, self.down = up or Wire(), down or Wire()
        self._loop.call_soon_threadsafe(self._notify, seconds)

    def _notify(self, seconds: float) -> None:
        if self._healing is not None:
            self._healing.cancel()
        self._healing = self._loop.call_later(seconds, self.change) if seconds else None
        self.changed.set_result(None)
        self.changed = self._loop.create_future()

    async def serve(self) -> None:
        """Accept connections and pass them on."""
        with self._listener:
            while True:
                try:
                    near, _ = await self._loop.sock_accept(self._listener)
                except OSError as error:
                    log.error("a link takes no connection until there is room: %s", error)
                    await asyncio.wait([self.changed], timeout=_REST)
                    continue
                connection = self._loop.create_task(self._pass_on(near))
                self.connections.add(connection)
                connection.add_done_callback(self.connections.discard)

    async def _pass_on(self, near: socket.socket) -> None:
        """Pass on the bytes of a process's connection, until both directions have ended."""
        with near, suppress(OSError):
            while self.up.stalled:
                await asyncio.wait([self.changed])
            with socket.socket(socket.AF_INET6 if ":" in self.target[0] else socket.AF_INET) as far:
                far.setblocking(False)
                for end in (near, far):
                    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                await self._loop.sock_connect(far, self.target)
                up = _Pump(self, near, far, lambda: self.up)
                down = _Pump(self, far, near, lambda: self.down)
                await asyncio.gather(up.run(), down.run())


class _Pump:
    """One direction of a connection: what was read of `source` and not yet written to `sink`."""

    def __init__(self, link: Link, source: socket.socket, sink: socket.socket, wire: Callable[[], Wire]) -> None:
        self._link, self._source, self._sink, self._wire = link, source, sink, wire
        self._loop = asyncio.get_running_loop()
        self._held = asyncio.Queue[tuple[float, bytes]]()
        """Bytes, with the host time at which they came; none at the end."""
        self._size = 0
        self._room = asyncio.Event()
        """Whether bytes were written since it was cleared."""

    async def run(self) -> None:
        """Pass bytes until the source has ended or the sink takes no more: the other direction goes on to its end."""
        reading = self._loop.create_task(self._read())
        try:
            with suppress(OSError):
                await self._write()
        finally:
            reading.cancel()

    async def _read(self) -> None:
        data = b"first"
        while data:
            # A stalled wire reads nothing, so that the sender's system holds the bytes.
            while self._wire().stalled:
                await asyncio.wait([self._link.changed])
            while self._size >= most_held(self._wire()):
                self._room.clear()
                await self._room.wait()
            try:
                data = await self._loop.sock_recv(self._source, _CHUNK)
            except OSError:
                data = b""
            self._size += len(data)
            self._held.put_nowait((monotonic(), data))

    async def _write(self) -> None:
        free_at = 0.0  # Host time from which the rate allows the next byte.
        while True:
            came, data = await self._held.get()
            rest = memoryview(data)
            while True:
                wire, now = self._wire(), monotonic()
                wait = max(came + wire.delay - now, free_at - now if wire.rate else 0.0)
                if wire.stalled or wait > 0.0:
                    await asyncio.wait([self._link.changed], timeout=None if wire.stalled else wait)
                    continue
                part = rest if wire.rate is None else rest[: max(1, int(wire.rate * _SLICE))]
                if not part:
                    break
                await self._loop.sock_sendall(self._sink, part)
                rest = rest[len(part) :]
                if wire.rate is not None:
                    free_at = max(free_at, now - _SLICE) + len(part) / wire.rate
            if not data:
                self._sink.shutdown(socket.SHUT_WR)
                return
            self._size -= len(data)
            self._room.set()


def most_held(wire: Wire) -> int:
    """The bytes from which on a direction reads no more: one read, and what passes during its delay."""
    return _CHUNK + min(int((wire.rate or _MOST_RATE) * wire.delay), _MOST_HELD)


class Links:
    """A link for each process of a team. The thread ends with `close`, and with it all connections."""

    def __init__(self) -> None:
        runner = asyncio.Runner(loop_factory=asyncio.new_event_loop)
        self._loop, self._closed = runner.get_loop(), asyncio.Event()
        self._links: dict[str, Link] = {}

        def run() -> None:
            with runner:
                runner.run(self._closed.wait())

        self._thread = threading.Thread(target=run, name="links", daemon=True)
        self._thread.start()

    def open(self, host: str, port: int) -> Link:
        """A new link to this address. Raises OSError."""
        link = Link(self._loop, (host, port))
        asyncio.run_coroutine_threadsafe(link.serve(), self._loop)
        return link

    def endpoint(self, name: str, router: str) -> str:
        """Where the process `name` connects, to reach the router at this endpoint. Raises UsageError."""
        address = host_port(router)
        if address is None:
            raise UsageError(f"{router}: a link can be cut if the router listens at tcp/HOST:PORT or tls/HOST:PORT")
        if name not in self._links:
            self._links[name] = self.open(*address)
        link = self._links[name]
        link.target = address
        return f"{router.partition('/')[0]}/127.0.0.1:{link.port}"

    def change(self, name: str, wire: Wire, seconds: float = 0.0) -> None:
        """Make both directions of a link so; with `seconds`, for so many of the host's. Raises BusError."""
        if name not in self._links:
            raise BusError(f"there is no link of {name!r}; there are those of {', '.join(self._links) or 'no process'}")
        self._links[name].change(wire, wire, seconds)

    def serve(self, bus: Bus) -> None:
        """Let `zteam chaos` change links."""

        def answer(request: LinkRequest) -> LinkReply:
            self.change(request.name, request.wire, request.seconds)
            return LinkReply([*self._links])

        bus.serve(names.service_key(names.LAUNCHER, names.LINKS), LinkRequest, answer)

    def close(self) -> None:
        """End the thread, all links and their connections."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._closed.set)
            self._thread.join()
