"""A view's server in the test's process, and pages that are no browsers."""

import http.client
import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from studies.view.frames import Frame, decode_frame
from support.limits import LIMIT
from zteam.bus import Bus
from zteam.clock import monotonic
from zteam.node.process_node import ProcessNode
from zteam.node.shutdown import Stop
from zteam.view.frames import DOC
from zteam.view.server import WebServer, listen
from zteam.view.team_view import TeamView

TOKEN = "the token"


class Page:
    """A page without a browser: it acknowledges every frame, and keeps what came."""

    def __init__(self, socket: ClientConnection, *, acknowledges: bool = True) -> None:
        self._socket, self._acknowledges = socket, acknowledges
        self._seq = 0
        self.welcome: dict[str, Any] = {}
        self.frames: list[Frame] = []
        self.blocks: dict[tuple[int, int], bytes] = {}
        """The newest of each type and robot."""
        self.docs: dict[str, Any] = {}
        self.replies: dict[int, str] = {}
        self.refused = ""

    def say(self, **message: Any) -> None:
        """Send a message."""
        self._socket.send(json.dumps(message))

    def say_raw(self, message: str | bytes) -> None:
        """Send anything."""
        self._socket.send(message)

    def take(self, timeout: float = LIMIT) -> None:
        """Take the next message. Raises TimeoutError, or ConnectionClosed."""
        message = self._socket.recv(timeout=timeout)
        if isinstance(message, str):
            self._take_text(json.loads(message))
            return
        frame, blocks = decode_frame(message)
        self.frames.append(frame)
        for kind, _, owner, body in blocks:
            self.blocks[kind, owner] = body
            if kind == DOC:
                length = int.from_bytes(body[:2], "little")
                self.docs[body[2 : 2 + length].decode()] = json.loads(body[2 + length :])
        if self._acknowledges:
            self.say(op="ack", frame=frame.number)

    def _take_text(self, message: dict[str, Any]) -> None:
        if message["op"] == "welcome":
            self.welcome = message
        elif message["op"] == "reply":
            self.replies[message["seq"]] = message["error"]
        elif message["op"] == "refused":
            self.refused = message["reason"]

    def wait(self, ready: Callable[[], Any]) -> None:
        """Take messages until `ready()`."""
        end = monotonic() + LIMIT
        while not ready():
            left = end - monotonic()
            assert left > 0.0, f"not true within {LIMIT:g} s; documents: {self.docs}"
            try:
                self.take(min(left, 0.5))
            except TimeoutError:
                continue

    def command(self, **message: Any) -> str:
        """Send a command; the error in its reply."""
        self._seq += 1
        seq = self._seq
        self.say(**message, seq=seq)
        self.wait(lambda: seq in self.replies)
        return self.replies[seq]

    def end(self) -> tuple[int, str]:
        """Take messages until the server closes the socket: the code and the reason."""
        try:
            while True:
                self.take()
        except ConnectionClosed as closed:
            assert closed.rcvd is not None
            return closed.rcvd.code, closed.rcvd.reason

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


@contextmanager
def open_page(
    port: int, token: str = TOKEN, *, hello: bool = True, acknowledges: bool = True, **headers: str
) -> Iterator[Page]:
    """A page of the server at this port."""
    with connect(
        f"ws://127.0.0.1:{port}/ws", compression=None, max_size=None, additional_headers=headers, close_timeout=1.0
    ) as socket:
        page = Page(socket, acknowledges=acknowledges)
        if hello:
            page.say(op="hello", version=1, token=token)
            page.wait(lambda: page.welcome)
        yield page


class View(NamedTuple):
    """A view in this process."""

    state: TeamView
    port: int

    def get(self, path: str, host: str | None = None, method: str = "GET") -> http.client.HTTPResponse:
        """The answer to a request; `host` is its Host."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=LIMIT)
        try:
            connection.putrequest(method, path, skip_host=host is not None)
            if host is not None:
                connection.putheader("Host", host)
            connection.endheaders()
            response = connection.getresponse()
            response.read()
            return response
        finally:
            connection.close()


@contextmanager
def open_view(bus: Bus, layout: bytes = b"") -> Iterator[View]:
    """Serve a view of this bus."""
    stop = Stop()
    node = ProcessNode("view", bus, stop)
    state = TeamView(node)
    listener, port = listen("127.0.0.1", 0)
    server = WebServer(state, listener, "127.0.0.1", TOKEN, layout)
    serving = threading.Thread(target=state.serve, name="state", daemon=True)
    server.start()
    serving.start()
    try:
        yield View(state, port)
    finally:
        stop.request("the test is over")
        server.close()
        serving.join(LIMIT)
        node.close()
