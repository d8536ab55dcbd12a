"""The web server: the page's files over HTTP, and its WebSocket. No command is taken over HTTP."""

import asyncio
import logging
import socket
import threading
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from zteam.errors import UsageError
from zteam.nodes.web.connection import Page
from zteam.nodes.web.desk import Desk
from zteam.nodes.web.files import HEADERS, KEPT, find_version, read_file, read_index
from zteam.nodes.web.hub import Hub
from zteam.nodes.web.requests import MAX_BYTES
from zteam.nodes.web.rights import Gatekeeper

log = logging.getLogger("zteam")

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]

BACKLOG = 64
THREADS = 32
"""For commands."""
TRIES = 20
"""Ports that are tried after one that is taken."""


class WebServer:
    """Runs on a thread of its own, from `start` until `close`."""

    def __init__(self, hub: Hub, listener: socket.socket, host: str, token: str, layout: bytes = b"") -> None:
        """`listener` listens at `host`; `layout` is JSON that pages begin with."""
        self._hub, self._listener, self._token, self._layout = hub, listener, token, layout
        self._gate = Gatekeeper(host)
        self._server: uvicorn.Server | None = None
        self._thread = threading.Thread(target=self._run, name="web", daemon=True)

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def close(self) -> None:
        """Close all sockets, and wait until that is done."""
        if self._server is not None:
            self._server.should_exit = True
        self._thread.join(1.0)

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            self._hub.node.fail(error)

    async def _serve(self) -> None:
        # Commands wait for the simulator; those of one page must not hold those of others.
        asyncio.get_running_loop().set_default_executor(ThreadPoolExecutor(THREADS, "command"))
        desk = Desk(self._hub, self._token)
        config = uvicorn.Config(
            Guarded(make_app(desk, self._layout), self._gate),
            ws="websockets-sansio", ws_max_size=MAX_BYTES, ws_per_message_deflate=False, timeout_graceful_shutdown=1,
            ws_ping_interval=10.0, ws_ping_timeout=20.0, lifespan="off", log_config=None, access_log=False,
            server_header=False, date_header=False, http="h11",
        )  # fmt: skip
        self._server = uvicorn.Server(config)
        if self._hub.node.stopping:
            return
        try:
            await self._server.serve([self._listener])
        finally:
            desk.driving.stop()


class Guarded:
    """An ASGI application behind the checks of `Host` and `Origin`; the page's headers go out with every answer."""

    def __init__(self, app: Starlette, gate: Gatekeeper) -> None:
        self._app, self._gate = app, gate

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = {name: value.decode("latin-1") for name, value in scope["headers"]}
        host = headers.get(b"host", "")
        if not self._gate.takes_host(host):
            await self._answer(scope, receive, send, 421, "this server is not known under that name")
            return
        if scope["type"] == "websocket" and not self._gate.takes_origin(headers.get(b"origin"), host):
            await self._answer(scope, receive, send, 403, "a page of another site may not open this socket")
            return

        async def send_with_headers(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                said = {name for name, _ in message["headers"]}
                given = ((name.encode(), value.encode()) for name, value in HEADERS.items())
                added = [header for header in given if header[0] not in said]
                message = {**message, "headers": [*message["headers"], *added]}
            await send(message)

        await self._app(scope, receive, send_with_headers)

    async def _answer(self, scope: Scope, receive: Receive, send: Send, code: int, text: str) -> None:
        response = PlainTextResponse(text, code)
        if scope["type"] == "websocket":
            await WebSocket(scope, receive, send).send_denial_response(response)
        else:
            await response(scope, receive, send)


def make_app(desk: Desk, layout: bytes) -> Starlette:
    """The routes: the page, its files, the layout that it begins with, its socket."""

    shown = ""

    async def index(_request: Request) -> Response:
        nonlocal shown
        shown = find_version()
        page = read_index(shown)
        return Response(page.content, media_type=page.kind)

    async def file(request: Request) -> Response:
        name: str = request.path_params["name"]
        version, _, rest = name.partition("/")
        return _file(rest, KEPT) if version == shown else _file(name)

    async def first_layout(_request: Request) -> Response:
        return Response(layout, 200 if layout else 204, media_type="application/json" if layout else None)

    async def open_socket(socket: WebSocket) -> None:
        await Page(socket, desk).run()

    return Starlette(
        routes=[
            Route("/", index, methods=["GET"]),
            Route("/layout.json", first_layout, methods=["GET"]),
            Route("/page/{name:path}", file, methods=["GET"]),
            WebSocketRoute("/ws", open_socket),
        ]
    )


def _file(name: str, headers: Mapping[str, str] | None = None) -> Response:
    found = read_file(name)
    if found is None:
        return PlainTextResponse("there is no such file", 404)
    return Response(found.content, media_type=found.kind, headers=headers)


def listen(host: str, port: int) -> tuple[socket.socket, int]:
    """A socket that listens at `host`, at `port` or where that is taken at one of the next; and its port.

    Raises UsageError.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)[0]
    except OSError as error:
        raise UsageError(f"--host {host}: {error.strerror or error}") from None
    for chosen in [port, *range(port + 1, port + 1 + TRIES), 0] if port else [0]:
        listener = socket.socket(family, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((address[0], chosen))
            listener.listen(BACKLOG)
        except OSError as error:
            listener.close()
            last = error
            continue
        return listener, int(listener.getsockname()[1])
    raise UsageError(f"cannot listen at {host}: {last.strerror or last}")
