"""The connections of the view's servers: whatever clients do with theirs, the next one is served."""

import logging
import socket
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress

import pytest
from websockets.exceptions import ConnectionClosed

from support.limits import LIMIT
from support.web_view import TOKEN, View, open_page, open_view
from zteam.bus import MemoryHub
from zteam.view import connections as module
from zteam.view import server
from zteam.view.connections import share_of_descriptors

MOST = 8
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
    """Six times as many as the server takes, with nothing, parts, wholes or more of a request: a page still opens, what
    has waited longest is closed, and the log does not speak of each."""
    with ExitStack() as ends:
        clients = []
        for _ in range(6 * MOST):
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


def test_connections_are_a_part_of_the_descriptors(monkeypatch: pytest.MonkeyPatch) -> None:
    """A few where the system gives few, and never more than are of use."""
    limits = iter([(1024, 4096), (64, 64), (20, 20), (-1, -1), (1_000_000, 1_000_000)])
    monkeypatch.setattr(module.resource, "getrlimit", lambda _kind: next(limits))
    assert [share_of_descriptors(4, 256) for _ in range(5)] == [256, 16, 8, 256, 256]
