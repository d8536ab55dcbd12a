"""The connections of the view's servers: whatever clients do with theirs, the next one is served."""

import asyncio
import errno
import logging
import os
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress
from typing import Any, cast

import pytest
from websockets.exceptions import ConnectionClosed

from support.limits import LIMIT
from support.log_capture import captured_log
from support.web_view import TOKEN, View, open_page, open_view
from zteam.bus import MemoryHub
from zteam.view import connections as module
from zteam.view import server
from zteam.view.connections import MAX_HEAD, Connections, open_front, share_of_descriptors

MOST = 8
REQUEST = b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"
UPGRADE = (
    b"GET /ws HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
)


@pytest.fixture
def view(monkeypatch: pytest.MonkeyPatch) -> Iterator[View]:
    """A view that takes few connections."""
    monkeypatch.setattr(server, "share_of_descriptors", lambda _part, _most: MOST)
    with open_view(MemoryHub().bus()) as view:
        yield view


def has_ended(client: socket.socket) -> bool:
    """Whether the server ends it."""
    try:
        while client.recv(1 << 16):
            pass
    except ConnectionResetError:
        return True
    return True


@pytest.mark.parametrize(
    "sent",
    [
        b"",
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ",
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n",
        b"GET /page/js/main.js HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" * 100,
        b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 1000000\r\n\r\nx",
        b"\0" * 1000,
        *(
            # The first one may be closed only when it has neither said hello nor answered the closing handshake.
            pytest.param(UPGRADE + rest, marks=pytest.mark.ci)
            for rest in (b"", b"\x81\xfe", b"\x81\x81\0\0\0\0\xff")
        ),
    ],
)
def test_connections_that_wait_keep_no_page_away(view: View, caplog: pytest.LogCaptureFixture, sent: bytes) -> None:
    """Three times as many as the server takes, with nothing, parts, wholes or more of a request: a page opens, what
    has waited longest is closed, and the log does not speak of each."""
    with ExitStack() as ends:
        clients = []
        for _ in range(3 * MOST):
            client = ends.enter_context(socket.create_connection(("127.0.0.1", view.port), LIMIT))
            clients.append(client)
            with suppress(BrokenPipeError, ConnectionResetError):
                client.sendall(sent)
        assert view.get("/").status == 200
        with open_page(view.port) as page:
            assert "does not drive" in page.command(op="release", robot=0)
        assert has_ended(clients[0])
    assert not [record for record in caplog.records if record.levelno > logging.INFO]


def test_a_connection_without_a_request_is_closed_after_a_while(view: View, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also one that stops within a request; that of a page stays."""
    monkeypatch.setattr(module, "PATIENCE", 0.05)
    with open_page(view.port) as page:
        for sent in (b"", b"GET / HT", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\nGET / HT"):
            with closing(socket.create_connection(("127.0.0.1", view.port), LIMIT)) as client:
                client.sendall(sent)
                assert has_ended(client)
        assert "does not drive" in page.command(op="release", robot=0)


def test_a_page_takes_the_place_of_one_that_only_watches(view: View) -> None:
    """Half of all connections are pages: one more ends the oldest without the token; where all have it, it is told."""
    with ExitStack() as ends:
        watchers = [ends.enter_context(open_page(view.port, token="another")) for _ in range(MOST // 2 + 1)]
        pages = [ends.enter_context(open_page(view.port)) for _ in range(MOST // 2)]
        for watcher in watchers:
            with pytest.raises(ConnectionClosed):
                watcher.wait(lambda: False)
        for token in ("another", TOKEN):
            with open_page(view.port, hello=False) as refused:
                refused.say(op="hello", version=1, token=token)
                assert refused.end() == (1008, "too many pages are open: close one of them")
        for page in pages:
            assert "does not drive" in page.command(op="release", robot=0)


class Transport:
    """A connection that is none."""

    def __init__(self, *unsent: int) -> None:
        self.unsent, self.aborted = [*unsent], False

    def get_write_buffer_size(self) -> int:
        """Bytes that the client has not taken."""
        return self.unsent.pop(0) if len(self.unsent) > 1 else self.unsent[0]

    def abort(self) -> None:
        """End it."""
        self.aborted = True


def in_a_loop(test: Callable[[], None]) -> None:
    """Run it where timers can be set; none is due."""

    async def run() -> None:
        test()

    asyncio.run(run())


def test_a_client_that_takes_its_answer_slowly_is_not_cut() -> None:
    """As long as it takes some of it between two looks."""

    def test() -> None:
        connections, slow = Connections(MOST), Transport(300, 200, 100, 100)
        transport = cast(asyncio.Transport, slow)
        connections.open(transport)
        for unsent in (0, 300, 200):
            connections._look_at(transport, unsent)
            assert not slow.aborted
        connections._look_at(transport, 100)
        assert slow.aborted

    in_a_loop(test)


def test_a_lack_of_descriptors_is_told_once() -> None:
    """Waiting connections are closed, so that the next one finds room; other errors are logged as always."""

    def test() -> None:
        connections, found = Connections(MOST), [Transport(0) for _ in range(3)]
        for transport in found:
            connections.open(cast(asyncio.Transport, transport))
        connections.keep(cast(asyncio.Transport, found[2]), trusted=False)
        loop, others = asyncio.get_running_loop(), list[dict[str, Any]]()
        with captured_log() as log, pytest.MonkeyPatch().context() as patch:
            patch.setattr(loop, "default_exception_handler", others.append)
            for _ in range(100):
                connections.on_loop_error(loop, {"exception": OSError(errno.EMFILE, os.strerror(errno.EMFILE))})
            connections.on_loop_error(loop, {"exception": OSError(errno.EPIPE, "x")})
            connections.on_loop_error(loop, {"message": "x"})
        assert log.lines == ["a connection could not be taken: Too many open files; those that wait are closed"]
        assert len(others) == 2
        assert [transport.aborted for transport in found] == [True, True, False]

    in_a_loop(test)


def test_connections_are_a_part_of_the_descriptors(monkeypatch: pytest.MonkeyPatch) -> None:
    """A few where the system gives few, and never more than are of use."""
    limits = iter([(1024, 4096), (64, 64), (20, 20), (-1, -1), (1_000_000, 1_000_000)])
    monkeypatch.setattr(module.resource, "getrlimit", lambda _kind: next(limits))
    assert [share_of_descriptors(4, 256) for _ in range(5)] == [256, 16, 8, 256, 256]


class Desk:
    """The door, and a server that answers each connection with what it has got."""

    def __init__(self) -> None:
        self.server = socket.create_server(("127.0.0.1", 0))
        self.server.settimeout(LIMIT)
        listener = socket.create_server(("127.0.0.1", 0))
        self._address = listener.getsockname()
        self.failures: list[BaseException] = []
        self._close_front = open_front(listener, self.server.getsockname(), self.failures.append)
        self._ends = ExitStack()
        self.ends = self._ends.enter_context(ExitStack())

    def client(self, sent: bytes = b"") -> socket.socket:
        """A new connection, which sends this first."""
        client = self.ends.enter_context(socket.create_connection(self._address, LIMIT))
        client.sendall(sent)
        return client

    def accept(self) -> socket.socket:
        """Its end at the server."""
        end = self.ends.enter_context(self.server.accept()[0])
        end.settimeout(LIMIT)
        return end

    def close(self) -> None:
        """End all of it."""
        self._ends.close()
        self._close_front()
        self.server.close()


@pytest.fixture
def desk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    """A door for few clients."""
    monkeypatch.setattr(module, "share_of_descriptors", lambda _part, _most: MOST)
    made = Desk()
    yield made
    made.close()
    assert not made.failures


def read(end: socket.socket, count: int) -> bytes:
    """Exactly this many bytes."""
    data = b""
    while len(data) < count and (part := end.recv(count - len(data))):
        data += part
    return data


def test_bytes_pass_as_they_are(desk: Desk) -> None:
    """The request in parts, then megabytes in both directions at once, and the end of either side."""
    client = desk.client(REQUEST[:9])
    client.sendall(REQUEST[9:] + b"more")
    end = desk.accept()
    assert read(end, len(REQUEST) + 4) == REQUEST + b"more"
    data = bytes(range(256)) * 20_000
    writers = [threading.Thread(target=each.sendall, args=(data,), daemon=True) for each in (client, end)]
    for writer in writers:
        writer.start()
    assert read(client, len(data)) == data and read(end, len(data)) == data
    for writer in writers:
        writer.join(LIMIT)
    end.close()
    assert has_ended(client)
    other = desk.client(REQUEST)
    end = desk.accept()
    other.close()
    assert read(end, len(REQUEST) + 1) == REQUEST


def test_what_is_no_request_does_not_pass(desk: Desk) -> None:
    """The server hears nothing of connections that are silent, or whose request is too long."""
    desk.client()
    desk.client(REQUEST[:-1])
    assert has_ended(desk.client(b"x" * (MAX_HEAD + 1)))
    desk.client(REQUEST)
    assert read(desk.accept(), len(REQUEST)) == REQUEST


def test_clients_that_wait_or_stay_keep_no_other_away(desk: Desk) -> None:
    """Silent ones, those that the server does not answer, and those that it has answered: the next one passes."""
    silent = [desk.client() for _ in range(3 * MOST)]
    unanswered = []
    for _ in range(3 * MOST):
        unanswered.append(desk.client(REQUEST))
        desk.accept()
    answered = []
    for _ in range(MOST):
        client = desk.client(REQUEST)
        end = desk.accept()
        assert read(end, len(REQUEST)) == REQUEST
        end.sendall(b"hello")
        assert read(client, 5) == b"hello"
        answered.append(client)
    assert all(has_ended(clients[0]) for clients in (silent, unanswered, answered))
    end.sendall(b"again")
    assert read(client, 5) == b"again"


def test_a_server_that_gives_no_answer_ends_the_client(desk: Desk) -> None:
    """The client waits for nothing, although it has not ended its side; nor where the server is gone."""
    client = desk.client(REQUEST)
    end = desk.accept()
    assert read(end, len(REQUEST)) == REQUEST
    end.close()
    assert has_ended(client)
    desk.server.close()
    assert has_ended(desk.client(REQUEST))


def test_servers_without_descriptors_close_what_waits(view: View, desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    """That of the page, and the door."""

    def accept(_listener: socket.socket) -> None:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    with captured_log() as log, closing(socket.create_connection(("127.0.0.1", view.port), LIMIT)) as silent:
        before_the_door = desk.client()
        # Those that come later have been taken: these have too.
        assert view.get("/").status == 200
        desk.client(REQUEST)
        desk.accept()
        monkeypatch.setattr(socket.socket, "accept", accept)
        desk.client()
        with closing(socket.create_connection(("127.0.0.1", view.port), LIMIT)):
            assert has_ended(silent) and has_ended(before_the_door)
    assert log.count("a connection could not be taken") == 2
