"""The links of a team that was started with `--chaos`: TCP connections to its router pass through this process, which
delays, slows or cuts them.

No byte is lost or changed, as on a bad wire under TCP. One thread moves the bytes of all links.
"""

import asyncio
import logging
import socket
import struct
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial

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
_MOST = 8
"""Connections of a link: a process has two of its own, and others may reach its port."""
_REST = 1.0
"""Host seconds without new connections after one could not be taken."""
_RESET = struct.pack("ii", 1, 0)
"""SO_LINGER: `close` ends a connection at once, with a reset."""


class Link:
    """The link of one process. Any thread may change it."""

    def __init__(
        self, loop: asyncio.AbstractEventLoop, told: asyncio.Event, listener: socket.socket, target: tuple[str, int]
    ) -> None:
        self._loop, self._told, self._listener, self.target = loop, told, listener, target
        self.up = self.down = Wire()
        """From the process to the router, and back."""
        self.changed: asyncio.Future[None] = loop.create_future()
        """Done with the next change."""
        self._refuses = False
        """Whether its connections were reset and new ones are."""
        self._connections: dict[asyncio.Task[None], _Pump] = {}
        """The oldest first, with what comes from the router."""
        self._healing: asyncio.TimerHandle | None = None

    @property
    def endpoint(self) -> str:
        """Where the process connects, as in ZTEAM_CONNECT."""
        host, port = self._listener.getsockname()[:2]
        return f"tcp/{host}:{port}"

    def change(self, up: Wire | None = None, down: Wire | None = None, seconds: float = 0.0) -> None:
        """Make the two directions so, None = a good one; with `seconds`, for so many of the host's.

        A link that was reset connects again.
        """
        self.up, self.down, self._refuses = up or Wire(), down or Wire(), False
        self._loop.call_soon_threadsafe(self._notify, seconds)

    def reset(self) -> None:
        """End its connections, and refuse new ones until the next `change`."""
        self._refuses = True
        self._loop.call_soon_threadsafe(lambda: [each.cancel() for each in self._connections])

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
                # The one that was waited for at the cut is held by `_pass_on`, all others by the system.
                while self.up.stalled:
                    await asyncio.wait([self.changed])
                near = None
                try:
                    near, _ = await self._loop.sock_accept(self._listener)
                    if self._refuses or not self._has_room():
                        _reset(near)
                        continue
                    far = socket.socket(socket.AF_INET6 if ":" in self.target[0] else socket.AF_INET)
                except OSError as error:
                    if near is not None:
                        _reset(near)
                    if not self._told.is_set():
                        self._told.set()
                        log.error("a link takes no connection until there is room: %s", error)
                    await asyncio.wait([self.changed], timeout=_REST)
                    continue
                down = _Pump(self, far, near, lambda: self.down)
                connection = self._loop.create_task(self._pass_on(near, far, down))
                self._connections[connection] = down
                connection.add_done_callback(partial(self._end, near, far))

    def _has_room(self) -> bool:
        """Whether it may have one more: the oldest that the router has not answered makes room."""
        if len(self._connections) < _MOST:
            return True
        silent = next((each for each, down in self._connections.items() if not down.has_read), None)
        if silent is not None:
            del self._connections[silent]
            silent.cancel()
        return silent is not None

    async def _pass_on(self, near: socket.socket, far: socket.socket, down: "_Pump") -> None:
        """Pass on the bytes of a process's connection, until both directions have ended."""
        with suppress(OSError):
            while self.up.stalled:
                await asyncio.wait([self.changed])
            far.setblocking(False)
            for end in (near, far):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            await self._loop.sock_connect(far, self.target)
            await asyncio.gather(_Pump(self, near, far, lambda: self.up).run(), down.run())
            near.close()
            far.close()

    def _end(self, near: socket.socket, far: socket.socket, connection: asyncio.Task[None]) -> None:
        """Reset a connection that has not ended by itself, even one that was cancelled before it began."""
        self._connections.pop(connection, None)
        _reset(near, far)


def _reset(*ends: socket.socket) -> None:
    for end in ends:
        with end, suppress(OSError):
            end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)


class _Pump:
    """One direction of a connection: what was read of `source` and not yet written to `sink`."""

    def __init__(self, link: Link, source: socket.socket, sink: socket.socket, wire: Callable[[], Wire]) -> None:
        self._link, self._source, self._sink, self._wire = link, source, sink, wire
        self._held = asyncio.Queue[tuple[float, bytes]]()
        """Bytes, with the host time at which they came; none at the end."""
        self._size = 0
        self.has_read = False
        """Whether the source has sent any."""
        self._room = asyncio.Event()
        """Whether bytes were written since it was cleared."""

    async def run(self) -> None:
        """Pass bytes until the source has ended or the sink takes no more: the other direction goes on to its end."""
        reading = asyncio.ensure_future(self._read())
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
                data = await asyncio.get_running_loop().sock_recv(self._source, _CHUNK)
            except OSError:
                data = b""
            self.has_read |= bool(data)
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
                count = await self._send(part)
                rest = rest[count:]
                if wire.rate is not None:
                    free_at = max(free_at, now - _SLICE) + count / wire.rate
            if not data:
                self._sink.shutdown(socket.SHUT_WR)
                return
            self._size -= len(data)
            self._room.set()

    async def _send(self, part: memoryview) -> int:
        """Send what the sink takes now; without room 0, when there is some or the wire has changed."""
        # Not `sock_sendall`, which goes on during a cut.
        try:
            return self._sink.send(part)
        except BlockingIOError:
            loop = asyncio.get_running_loop()
            # Cancelled when there is some, as often as the loop finds it.
            has_room = loop.create_future()
            loop.add_writer(self._sink, has_room.cancel)
            try:
                await asyncio.wait([has_room, self._link.changed], return_when=asyncio.FIRST_COMPLETED)
            finally:
                loop.remove_writer(self._sink)
            return 0


def most_held(wire: Wire) -> int:
    """The bytes from which on a direction reads no more: one read, and what passes during its delay."""
    return _CHUNK + min(int((wire.rate or _MOST_RATE) * wire.delay), _MOST_HELD)


class Links:
    """A link for each process of a team. The thread ends with `close`, and with it all connections."""

    def __init__(self) -> None:
        runner = asyncio.Runner(loop_factory=asyncio.new_event_loop)
        self._loop, self._closed = runner.get_loop(), asyncio.Event()
        self._told = asyncio.Event()
        """Whether it was logged that a link cannot take a connection."""
        self._links: dict[str, Link] = {}

        def run() -> None:
            with runner:
                runner.run(self._closed.wait())

        self._thread = threading.Thread(target=run, name="links", daemon=True)
        self._thread.start()

    def open(self, host: str, port: int) -> Link:
        """A new link to this address, at a free port of the loopback interface. Raises OSError."""
        listener = socket.create_server(("127.0.0.1", 0))
        listener.setblocking(False)
        link = Link(self._loop, self._told, listener, (host, port))
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
        return f"{router.partition('/')[0]}/{link.endpoint.partition('/')[2]}"

    def change(self, name: str, wire: Wire, seconds: float = 0.0) -> None:
        """Make both directions of a link so; with `seconds`, for so many of the host's. Raises BusError."""
        if name not in self._links:
            raise BusError(f"there is no link of {name!r}; there are those of {', '.join(self._links) or 'no process'}")
        self._links[name].change(wire, wire, seconds)

    def heal(self) -> None:
        """Make all links good ones."""
        for name in self._links:
            self.change(name, Wire())

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
