"""The door before a server without bounds: who passes, and what passes."""

import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from support.limits import LIMIT
from zteam.view import connections as module
from zteam.view.connections import MAX_HEAD, Front

HEAD = b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"
MOST = 8


class Desk:
    """The door, and a server that answers each connection with what it has got."""

    def __init__(self) -> None:
        self.server = socket.create_server(("127.0.0.1", 0))
        self.server.settimeout(LIMIT)
        listener = socket.create_server(("127.0.0.1", 0))
        self._address = listener.getsockname()
        self.failures: list[BaseException] = []
        self.front = Front(listener, self.server.getsockname(), self.failures.append)
        self.front.start()
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
        self.front.close()
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


def has_ended(client: socket.socket) -> bool:
    """Whether the door ends it."""
    try:
        return client.recv(1) == b""
    except ConnectionResetError:
        return True


def test_bytes_pass_as_they_are(desk: Desk) -> None:
    """The request in parts, then megabytes in both directions at once, and the end of either side."""
    client = desk.client(HEAD[:9])
    client.sendall(HEAD[9:] + b"more")
    end = desk.accept()
    assert read(end, len(HEAD) + 4) == HEAD + b"more"
    data = bytes(range(256)) * 20_000
    writers = [threading.Thread(target=each.sendall, args=(data,), daemon=True) for each in (client, end)]
    for writer in writers:
        writer.start()
    assert read(client, len(data)) == data and read(end, len(data)) == data
    for writer in writers:
        writer.join(LIMIT)
    end.close()
    assert has_ended(client)
    other = desk.client(HEAD)
    end = desk.accept()
    other.close()
    assert read(end, len(HEAD) + 1) == HEAD


def test_what_is_no_request_does_not_pass(desk: Desk) -> None:
    """The server hears nothing of connections that are silent, or whose request is too long."""
    desk.client()
    desk.client(HEAD[:-1])
    assert has_ended(desk.client(b"x" * (MAX_HEAD + 1)))
    desk.client(HEAD)
    assert read(desk.accept(), len(HEAD)) == HEAD


def test_clients_that_wait_or_stay_keep_no_other_away(desk: Desk) -> None:
    """Silent ones, those that the server does not answer, and those that it has answered: the next one passes."""
    silent = [desk.client() for _ in range(3 * MOST)]
    unanswered = []
    for _ in range(3 * MOST):
        unanswered.append(desk.client(HEAD))
        desk.accept()
    answered = []
    for _ in range(MOST):
        client = desk.client(HEAD)
        end = desk.accept()
        assert read(end, len(HEAD)) == HEAD
        end.sendall(b"hello")
        assert read(client, 5) == b"hello"
        answered.append(client)
    assert all(has_ended(clients[0]) for clients in (silent, unanswered, answered))
    end.sendall(b"again")
    assert read(client, 5) == b"again"


def test_a_server_that_gives_no_answer_ends_the_client(desk: Desk) -> None:
    """The client waits for nothing, although it has not ended its side; nor where the server is gone."""
    client = desk.client(HEAD)
    end = desk.accept()
    assert read(end, len(HEAD)) == HEAD
    end.close()
    assert has_ended(client)
    desk.server.close()
    assert has_ended(desk.client(HEAD))
