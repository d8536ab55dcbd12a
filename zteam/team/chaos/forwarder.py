"""Links that can be made bad: TCP connections to a router pass through this process, which delays, slows or cuts them.

No byte is lost or changed, as on a bad wire under TCP. One thread moves the bytes of all links.
"""

import contextlib
import logging
import selectors
import socket
import struct
import threading
from collections import deque
from collections.abc import Callable

import msgspec

from zteam.clock import monotonic

log = logging.getLogger("zteam")

_CHUNK = 1 << 16
"""Bytes that are read at once."""
_MOST_RATE = 1 << 20
"""Bytes a second. A delayed direction without a limit holds what comes at this rate during its delay; then its sender
waits."""
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


class Wire(msgspec.Struct, frozen=True):
    """One direction of a link. The default is a good one."""

    delay: float = 0.0
    """Host seconds that each byte takes."""
    rate: float | None = None
    """Bytes a host second; None = as fast as they come. With a `delay` a direction holds 4 MiB at most, and without a
    rate as much as 1 MiB a second: then its sender waits."""
    stalled: bool = False
    """Whether no byte passes. What waits passes when this ends."""


class _Pump:
    """One direction of a connection: what was read of `source` and not yet written to `sink`."""

    def __init__(self, source: socket.socket, sink: socket.socket, wire: Callable[[], Wire]) -> None:
        self.source, self.sink, self._wire = source, sink, wire
        self._held: deque[tuple[float, bytes]] = deque()
        """Bytes, with the host time at which they came."""
        self._size = 0
        self._free_at = 0.0
        """Host time from which the rate allows the next byte."""
        self._ended = False
        """Whether the source has no more bytes."""
        self.has_read = False
        """Whether the source has sent any."""
        self.done = False
        """Whether the sink was told so."""

    @property
    def may_read(self) -> bool:
        """Whether there is room. A stalled wire reads nothing, so that the sender's system holds the bytes."""
        wire = self._wire()
        most = _CHUNK + min(int((wire.rate or _MOST_RATE) * wire.delay), _MOST_HELD)
        return not (self._ended or wire.stalled) and self._size < most

    def due_in(self, now: float) -> float | None:
        """Host seconds until the next bytes, or the end, may be written; None if none are held."""
        wire = self._wire()
        if wire.stalled or not self._held:
            return None
        return max(0.0, self._held[0][0] + wire.delay - now, self._free_at - now if wire.rate else 0.0)

    def read(self, now: float, buffer: memoryview) -> None:
        """Take what the source has. An error ends it, as its last byte does: the other direction goes on to its end."""
        try:
            count = self.source.recv_into(buffer)
        except BlockingIOError:
            return
        except OSError:
            count = 0
        # As many bytes as came: `recv` takes memory for a whole chunk, of which it gives back the rest in small pieces.
        data, self._ended = bytes(buffer[:count]), not count
        self.has_read |= bool(count)
        self._held.append((now, data))
        self._size += len(data)

    def write(self, now: float) -> None:
        """Write what is due, as much as the sink takes."""
        try:
            while self.due_in(now) == 0.0:
                self._write_first(now)
        except BlockingIOError:
            return
        except OSError:
            self._held.clear()
            self._ended = self.done = True

    def _write_first(self, now: float) -> None:
        came, data = self._held[0]
        rate = self._wire().rate
        if data:
            count = self.sink.send(data if rate is None else data[: max(1, int(rate * _SLICE))])
        else:
            self.sink.shutdown(socket.SHUT_WR)
            self.done, count = True, 0
        self._size -= count
        if count < len(data):
            self._held[0] = came, data[count:]
        else:
            self._held.popleft()
        if rate is not None:
            self._free_at = max(self._free_at, now - _SLICE) + count / rate


class _Connection:
    """A process's connection to the router: `near` is the process's end, `far` the router's."""

    def __init__(self, near: socket.socket, far: socket.socket, link: "Link") -> None:
        self.up, self.down = _Pump(near, far, lambda: link.up), _Pump(far, near, lambda: link.down)
        self.ends = near, far

    def due_in(self, now: float) -> float | None:
        """Host seconds until bytes may be written; None if none are held."""
        return min((due for pump in (self.up, self.down) if (due := pump.due_in(now)) is not None), default=None)

    def interest(self, now: float) -> list[int]:
        """What is waited for at each of the `ends`."""
        pairs = ((self.up, self.down), (self.down, self.up))
        return [
            selectors.EVENT_READ * reader.may_read | selectors.EVENT_WRITE * (writer.due_in(now) == 0.0)
            for reader, writer in pairs
        ]

    def pass_on(self, end: socket.socket | None, mask: int, now: float, buffer: memoryview) -> bool:
        """Read from `end` (through `buffer`) and write what is possible; whether the connection goes on."""
        for pump in (self.up, self.down):
            if pump.source is end and mask & selectors.EVENT_READ and pump.may_read:
                pump.read(now, buffer)
            pump.write(now)
        return not (self.up.done and self.down.done)


class Link:
    """The link of one process. Any thread may change it."""

    def __init__(self, forwarder: "Forwarder", listener: socket.socket, target: tuple[str, int]) -> None:
        self._forwarder, self.listener, self.target = forwarder, listener, target
        self.up = self.down = Wire()
        """From the process to the router, and back."""
        self.refuses = False
        """Whether its connections were reset and new ones are."""
        self.connections: dict[_Connection, None] = {}
        """The oldest first."""

    @property
    def endpoint(self) -> str:
        """Where the process connects, as in ZTEAM_CONNECT."""
        host, port = self.listener.getsockname()[:2]
        return f"tcp/{host}:{port}"

    def change(self, up: Wire | None = None, down: Wire | None = None) -> None:
        """Make the two directions so from now on, None = a good one; a link that was reset connects again."""
        self.up, self.down, self.refuses = up or Wire(), down or Wire(), False
        self._forwarder.look_at(self)

    def cut(self) -> None:
        """Stall both directions, as when a cable is pulled: neither side hears of it."""
        self.change(Wire(stalled=True), Wire(stalled=True))

    def reset(self) -> None:
        """End its connections, and refuse new ones until the next `change`."""
        self.refuses = True
        self._forwarder.look_at(self)


class Forwarder:
    """Links to a router. Its thread ends with `close`, and with it all connections."""

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()
        self._wake, self._awake = socket.socketpair()
        self._awake.setblocking(False)
        self._selector.register(self._awake, selectors.EVENT_READ)
        self._changed: deque[Link] = deque()
        self._links: list[Link] = []
        self._timed: set[_Connection] = set()
        """Connections that hold bytes until a moment to come."""
        self._owner: dict[_Connection, Link] = {}
        self._resting: dict[Link, float] = {}
        """Links that take no connections until this host time."""
        self._told = False
        self._buffer = memoryview(bytearray(_CHUNK))
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="forwarder", daemon=True)
        self._thread.start()

    def open(self, host: str, port: int) -> Link:
        """A link to this address, at a free port of the loopback interface. Raises OSError."""
        listener = socket.create_server(("127.0.0.1", 0))
        listener.setblocking(False)
        link = Link(self, listener, (host, port))
        self._links.append(link)
        self.look_at(link)
        return link

    def look_at(self, link: Link) -> None:
        """Let the thread see what has changed on a link."""
        self._changed.append(link)
        with contextlib.suppress(OSError):
            self._wake.send(b"\0")

    def close(self) -> None:
        """End the thread, all links and their connections."""
        self._closing = True
        with contextlib.suppress(OSError):
            self._wake.send(b"\0")
        self._thread.join()

    def _run(self) -> None:
        try:
            while not self._closing:
                now = monotonic()
                due = [due for each in self._timed if (due := each.due_in(now)) is not None]
                due += [max(0.0, until - now) for until in self._resting.values()]
                ready = self._selector.select(min(due, default=None))
                self._step(ready)
        finally:
            for connection in list(self._owner):
                self._end(connection)
            for link in self._links:
                link.listener.close()
            self._selector.close()
            self._wake.close()
            self._awake.close()

    def _step(self, ready: list[tuple[selectors.SelectorKey, int]]) -> None:
        now, touched = monotonic(), set(self._timed)
        for key, mask in ready:
            if key.fileobj is self._awake:
                self._awake.recv(_CHUNK)
            elif isinstance(key.data, Link):
                self._accept(key.data)
            elif key.data in self._owner and isinstance(key.fileobj, socket.socket):
                self._pass_on(key.data, key.fileobj, mask, now)
                touched.add(key.data)
        for link in [link for link, until in self._resting.items() if until <= now]:
            del self._resting[link]
            self._changed.append(link)
        while self._changed:
            link = self._changed.popleft()
            takes = not link.up.stalled and link not in self._resting
            self._watch(link.listener, selectors.EVENT_READ * takes, link)
            touched.update(link.connections)
            for connection in list(link.connections):
                if link.refuses:
                    self._end(connection)
        for connection in touched:
            self._pass_on(connection, None, 0, now)

    def _pass_on(self, connection: _Connection, end: socket.socket | None, mask: int, now: float) -> None:
        if connection not in self._owner:
            return
        if not connection.pass_on(end, mask, now, self._buffer):
            self._end(connection)
            return
        for each, events in zip(connection.ends, connection.interest(now), strict=True):
            self._watch(each, events, connection)
        (self._timed.add if connection.due_in(now) else self._timed.discard)(connection)

    def _watch(self, end: socket.socket, events: int, data: object) -> None:
        """Wait for these events at a socket, for none if there are none."""
        known = self._selector.get_map().get(end)
        if known is None and events:
            self._selector.register(end, events, data)
        elif known is not None and not events:
            self._selector.unregister(end)
        elif known is not None and known.events != events:
            self._selector.modify(end, events, data)

    def _accept(self, link: Link) -> None:
        try:
            near = link.listener.accept()[0]
        except BlockingIOError:
            return
        except OSError as error:
            self._let_rest(link, error)
            return
        if link.refuses or not self._has_room(link):
            _close(near)
            return
        try:
            family = socket.AF_INET6 if ":" in link.target[0] else socket.AF_INET
            far = socket.socket(family, socket.SOCK_STREAM)
        except OSError as error:
            _close(near)
            self._let_rest(link, error)
            return
        connection = _Connection(near, far, link)
        for end in connection.ends:
            end.setblocking(False)
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # That it is refused shows when it is read.
        far.connect_ex(link.target)
        link.connections[connection] = None
        self._owner[connection] = link
        self._pass_on(connection, None, 0, monotonic())

    def _has_room(self, link: Link) -> bool:
        """Whether it may have one more: the oldest that the router has not answered makes room."""
        if len(link.connections) < _MOST:
            return True
        silent = next((each for each in link.connections if not each.down.has_read), None)
        if silent is not None:
            self._end(silent)
        return silent is not None

    def _let_rest(self, link: Link, error: OSError) -> None:
        """Take no connections of a link for a while: there is no descriptor for one."""
        self._resting[link] = monotonic() + _REST
        self._watch(link.listener, 0, link)
        if not self._told:
            self._told = True
            log.error("a link takes no more connections until there is room: %s", error)

    def _end(self, connection: _Connection) -> None:
        self._owner.pop(connection).connections.pop(connection, None)
        self._timed.discard(connection)
        for end in connection.ends:
            self._watch(end, 0, None)
            _close(end, reset=not (connection.up.done and connection.down.done))


def _close(end: socket.socket, *, reset: bool = True) -> None:
    if reset:
        with contextlib.suppress(OSError):
            end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
    end.close()
