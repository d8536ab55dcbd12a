"""The links of a team that was started with `--chaos`: TCP connections to its router pass through this process, which
delays, slows or cuts them.

No byte is lost or changed, as on a bad wire under TCP. One thread moves the bytes of all links.
"""

import asyncio
import socket
import threading
from collections.abc import Callable
from contextlib import ExitStack, closing, suppress

from zteam import names
from zteam.bus import Bus
from zteam.bus.options import host_port
from zteam.clock import monotonic
from zteam.errors import BusError, UsageError
from zteam.team.chaos.means import GOOD, LinkReply, LinkRequest, Wire

_CHUNK = 1 << 16
"""Bytes that are read at once."""
_MOST_RATE = 1 << 20
"""Bytes a second that a delayed direction without a limit holds."""
_MOST_HELD = 1 << 22
"""Bytes that a delayed direction holds at most."""
_SLICE = 0.02
"""Seconds of a limited rate that are sent at once."""


class Link:
    """The link of one process. Any thread may change it."""

    def __init__(self, loop: asyncio.AbstractEventLoop, target: tuple[str, int]) -> None:
        """A free port of the loopback interface leads to `target`. Raises OSError."""
        self._loop, self.target = loop, target
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.setblocking(False)
        self.port = self._listener.getsockname()[1]
        self.up = self.down = GOOD
        """From the process to the router, and back."""
        self._changed: asyncio.Future[None] = loop.create_future()
        """Done with the next change."""
        self._healing: asyncio.TimerHandle | None = None

    def change(self, up: Wire = GOOD, down: Wire = GOOD, seconds: float = 0.0) -> None:
        """Make the two directions so; with `seconds`, for so many of the host's."""
        self.up, self.down = up, down
        self._loop.call_soon_threadsafe(self._notify, seconds)

    def _notify(self, seconds: float) -> None:
        if self._healing is not None:
            self._healing.cancel()
        self._healing = self._loop.call_later(seconds, self.change) if seconds else None
        self._changed.set_result(None)
        self._changed = self._loop.create_future()

    async def serve(self) -> None:
        with closing(self._listener):
            async with asyncio.TaskGroup() as connections:
                while True:
                    near, _ = await self._loop.sock_accept(self._listener)
                    connections.create_task(self._pass_on(near))

    async def _pass_on(self, near: socket.socket) -> None:
        """Pass on the bytes of a process's connection, until both directions have ended."""
        # Not asyncio's streams: where one direction ends with an error, they drop the bytes of the other.
        with suppress(OSError), closing(near):
            await self._until_uncut(lambda: self.up)
            with closing(await self._connect()) as far:
                for each in (near, far):
                    each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                up, down = self._pump(near, far, lambda: self.up), self._pump(far, near, lambda: self.down)
                await asyncio.gather(up, down)

    async def _connect(self) -> socket.socket:
        """A connection to the router. Raises OSError."""
        # The name of a host may have several addresses.
        for family, kind, _, _, address in await self._loop.getaddrinfo(*self.target, type=socket.SOCK_STREAM):
            with suppress(OSError), ExitStack() as opened:
                far = opened.enter_context(socket.socket(family, kind))
                far.setblocking(False)
                await self._loop.sock_connect(far, address)
                opened.pop_all()
                return far
        raise OSError(f"nothing listens at {self.target}")

    async def _until_uncut(self, wire_now: Callable[[], Wire]) -> None:
        while wire_now().stalled:
            await asyncio.wait([self._changed])

    async def _pump(self, source: socket.socket, sink: socket.socket, wire_now: Callable[[], Wire]) -> None:
        """Pass bytes until the source has ended or the sink takes no more: the other direction goes on to its end."""
        held = asyncio.Queue[tuple[float, bytes]]()
        """Bytes, with the host time at which they came; none at the end."""
        size, room = 0, asyncio.Event()

        async def read() -> None:
            nonlocal size
            data = b"first"
            while data:
                # A stalled wire reads nothing, so that the sender's system holds the bytes.
                await self._until_uncut(wire_now)
                while size >= most_held(wire_now()):
                    room.clear()
                    await room.wait()
                try:
                    data = await self._loop.sock_recv(source, _CHUNK)
                except OSError:
                    data = b""
                size += len(data)
                held.put_nowait((monotonic(), data))

        reading = self._loop.create_task(read())
        free_at = 0.0  # Host time from which the rate allows the next byte.
        try:
            with suppress(OSError):
                while True:
                    came, data = await held.get()
                    rest = memoryview(data)
                    while rest or not data:
                        wire, now = wire_now(), monotonic()
                        wait = max(came + wire.delay - now, free_at - now if wire.rate else 0.0)
                        if wire.stalled or wait > 0.0:
                            await asyncio.wait([self._changed], timeout=None if wire.stalled else wait)
                            continue
                        if not data:
                            sink.shutdown(socket.SHUT_WR)
                            return
                        part = rest if wire.rate is None else rest[: max(1, int(wire.rate * _SLICE))]
                        await self._loop.sock_sendall(sink, part)
                        rest = rest[len(part) :]
                        if wire.rate is not None:
                            free_at = max(free_at, now - _SLICE) + len(part) / wire.rate
                    size -= len(data)
                    room.set()
        finally:
            reading.cancel()


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
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._closed.set)
            self._thread.join()
