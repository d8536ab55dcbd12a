"""A link to the router that came back."""

import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import pytest

from support.limits import LIMIT
from support.transports import Inbox, RouterProcess, wait_until_true
from zteam.bus import Bus, BusOptions, NoRequest, connect, connection
from zteam.errors import BusError

_KEEP_ALIVE = 4
_KIND = 0x1F


class HalfLink:
    """A wire to a router: its first link can be ended, and the next one is half, as a router makes it after a flood. Of
    the links in `half`, counted from 0, it passes only the handshake and signs of life to the client.
    """

    def __init__(self, endpoint: str, half: frozenset[int]) -> None:
        self._router = "127.0.0.1", int(endpoint.rpartition(":")[2])
        self._half = half
        self._server = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self._server.getsockname()[1]}"
        self._links: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        self._start(self._serve)

    def _start(self, work: Callable[..., None], *args: Any) -> None:
        thread = threading.Thread(target=work, args=args, daemon=True)
        self._threads.append(thread)
        thread.start()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._server.accept()
                router = socket.create_connection(self._router)
                is_half = len(self._links) in self._half
                self._links.append(client)
                self._start(self._link, client, router, is_half)

    def _link(self, client: socket.socket, router: socket.socket, is_half: bool) -> None:
        with client, router:
            up = threading.Thread(target=self._pass, args=(client, router, False), daemon=True)
            up.start()
            self._pass(router, client, is_half)
            up.join()

    @staticmethod
    def _pass(source: socket.socket, target: socket.socket, is_half: bool) -> None:
        """Pass batches, each behind its length, until one end closes."""
        with suppress(OSError, struct.error), source.makefile("rb") as stream:
            passed = 0
            while head := stream.read(2):
                batch = stream.read(struct.unpack("<H", head)[0])
                # The first two answer the handshake.
                if not is_half or passed < 2 or batch[0] & _KIND == _KEEP_ALIVE:
                    target.sendall(head + batch)
                passed += 1
        for end in (source, target):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def cut(self) -> None:
        """End the newest link."""
        with suppress(OSError):
            self._links[-1].shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """End all links, and accept no more."""
        self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        for client in self._links:
            with suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()


@pytest.fixture
def router() -> Iterator[RouterProcess]:
    """A router of the test's own."""
    router = RouterProcess()
    yield router
    router.kill()


def answers(asker: Bus) -> bool:
    """Whether the session behind the wire answers a query."""
    try:
        return bool(asker.query("lamp/info", NoRequest, timeout=0.5))
    except BusError:
        return False


@pytest.fixture(autouse=True)
def _asks_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """The next question follows an answer soon."""
    monkeypatch.setattr(connection, "_LINK_PERIOD", 0.1)


@pytest.mark.gate
def test_a_link_that_came_back_half_is_ended_once_more(router: RouterProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    """The session answers queries again, over another link, after one on which nothing reached it."""
    monkeypatch.setattr(connection, "ROUTER_ANSWER", 0.5)
    wire = HalfLink(router.endpoint, half=frozenset({1}))
    asker, session = (
        connect(BusOptions(connect=endpoint, lease=LIMIT)) for endpoint in (router.endpoint, wire.endpoint)
    )
    told = Inbox()
    session.watch_link(told)
    try:
        session.serve("lamp/info", NoRequest, lambda _: NoRequest())
        wait_until_true(lambda: answers(asker))
        wire.cut()
        told.wait_for(True)
        wait_until_true(lambda: answers(asker))
        # Its listener may hear of the link a moment after the first answer.
        wait_until_true(lambda: len(told.items) >= 4)
        # A busy machine may fail to answer in time on the next link too, which is ended then as well.
        assert told.items[:4] == [False, True, False, True]
    finally:
        session.close()
        asker.close()
        wire.close()


@pytest.mark.gate
def test_a_whole_link_is_kept(
    router: RouterProcess, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A link that came back whole is not ended."""
    ended: list[object] = []
    monkeypatch.setattr(connection, "cut", ended.append)
    wire = HalfLink(router.endpoint, half=frozenset())
    session, told = connect(BusOptions(connect=wire.endpoint, lease=LIMIT)), Inbox()
    try:
        session.watch_link(told)
        wire.cut()
        # A router that still holds the last link ends the next one by itself, and then Zenoh opens a third.
        told.wait_for(True)
        wait_until_true(lambda: "link" not in [thread.name for thread in threading.enumerate()])
        assert told.items[:2] == [False, True]
        assert ended == []
        assert "no query" not in caplog.text
    finally:
        session.close()
        wire.close()
