"""The web server: its pages, what they share, and the commands of each one after another."""

import asyncio
import contextlib
import itertools
import logging
import socket
import threading
from concurrent.futures import ThreadPoolExecutor

import msgspec
import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.types import Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from zteam.clock import monotonic
from zteam.errors import DecodeError, UsageError, log
from zteam.messages import Twist, Vector3
from zteam.view import requests
from zteam.view.commands import Commands
from zteam.view.composing import Composer
from zteam.view.connections import Connections, Gatekeeper, is_token, protocols_of, share_of_descriptors, takes_origin
from zteam.view.driving import Driving
from zteam.view.files import FOLDER, HEADERS, PageFiles
from zteam.view.received import Viewer
from zteam.view.team_view import TeamView

GATHER = 0.01
"""Host seconds from the first message of a tick until a frame is made: the tick's other messages come within them."""


STOPS, MAX_STOPS = 8, 2
"""Stops at the same time: of all pages, of one."""
MAX_WAITING = 32
"""Commands of one page that wait for those before them."""
BURST, RATE = 200.0, 100.0
"""Messages that a page may send at once, and a second; more are read later, so they delay no other page."""
HELLO_LIMIT = 5.0
"""Host seconds for a page's first message."""
POLICY_VIOLATION = 1008


class Page:
    """One connection. What cannot be taken raises DecodeError: the page is told why, and its socket is closed."""

    def __init__(self, socket: WebSocket, server: "WebServer") -> None:
        self._socket, self._server, self._state = socket, server, server.state
        self._ready, self._news = asyncio.Event(), asyncio.Event()
        self._news.set()
        self._replies: asyncio.Queue[bytes] = asyncio.Queue()
        self._commands: asyncio.Queue[requests.Command] = asyncio.Queue(MAX_WAITING)
        self._stops: set[asyncio.Task[None]] = set()

    async def run(self) -> None:
        """Serve the page until its socket is closed."""
        await self._socket.accept()
        try:
            viewer = await self._greet()
        except DecodeError as refusal:
            await self._refuse(str(refusal))
            return
        except WebSocketDisconnect:
            return
        self._state.add(viewer)
        self._server.news.add(self._news)
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(self._receive(viewer))
                tasks.create_task(self._carry_out_in_turn(viewer.number))
                tasks.create_task(self._send_replies())
                tasks.create_task(self._send_frames(viewer))
        except* DecodeError as refusals:
            await self._refuse(str(refusals.exceptions[0]))
        except* WebSocketDisconnect:
            pass
        finally:
            self._server.news.discard(self._news)
            self._state.remove(viewer)
            await self._server.driving.release_all(viewer.number)

    async def _greet(self) -> Viewer:
        try:
            # Host time: a page that says nothing is let go, while this thread serves others.
            hello = await asyncio.wait_for(self._read(), HELLO_LIMIT)  # noqa: TID251
        except TimeoutError:
            raise DecodeError(f"no hello within {HELLO_LIMIT:g} s") from None
        if not isinstance(hello, requests.Hello):
            raise DecodeError("the first message has to be hello")
        if hello.version != requests.VERSION:
            raise DecodeError(f"the page speaks version {hello.version}, this server {requests.VERSION}: load it again")
        viewer = Viewer(next(self._server.numbers), is_token(hello.token, self._server.token))
        if not self._keep(viewer):
            raise DecodeError("too many pages are open: close one of them")
        welcome = {
            "op": "welcome", "version": requests.VERSION, "viewer": viewer.number, "may_command": viewer.may_command,
            "namespace": self._state.namespace,
        }  # fmt: skip
        await self._socket.send_text(msgspec.json.encode(welcome).decode())
        return viewer

    def _keep(self, viewer: Viewer) -> bool:
        """Whether the connection may stay: if too many are open, it takes the place of a page that only watches."""
        return self._server.connections.keep(self._socket.scope["transport"], trusted=viewer.may_command)

    async def _read(self) -> requests.Request:
        message = await self._socket.receive()
        if message["type"] != "websocket.receive":
            raise WebSocketDisconnect(message.get("code", 1005))
        text = message.get("text")
        if text is None:
            raise DecodeError("messages are text")
        return requests.decode_request(text)

    async def _receive(self, viewer: Viewer) -> None:
        left, counted = BURST, monotonic()
        while True:
            self._take(viewer, await self._read())
            now = monotonic()
            left, counted = min(BURST, left + RATE * (now - counted)) - 1.0, now
            if left < 0.0:
                # Host time: a page that says too much is read later.
                await asyncio.sleep(-left / RATE)  # noqa: TID251

    def _take(self, viewer: Viewer, request: requests.Request) -> None:
        match request:
            case requests.Ack():
                viewer.on_ack(request)
                self._ready.set()
            case requests.Look():
                viewer.look = request
                self._state.changed()
            case requests.Watch():
                viewer.on_watch(request)
                self._state.changed()
            case requests.Hello():
                raise DecodeError("hello comes once")
            case requests.Token():
                viewer.may_command |= is_token(request.token, self._server.token)
                self._keep(viewer)
                self._say({"op": "rights", "may_command": viewer.may_command})
            case requests.Drive():
                command = Twist(Vector3(request.linear, request.left), Vector3(z=request.angular))
                if not self._server.driving.drive(request.robot, viewer.number, command):
                    self._say({"op": "lost", "robot": request.robot})
            case requests.Command() if self._state.queries.replay and request.op not in requests.WITH_RECORDING:
                self._reply(request, "a recording is shown, which takes no commands")
            case requests.Command(op="stop_robots") if len(self._stops) >= MAX_STOPS:
                self._reply(request, f"{MAX_STOPS} stops of this page are under way already")
            case requests.Command(op="stop_robots"):
                # At once: it waits for no other command, and needs no token.
                task = asyncio.create_task(self._carry_out(request, self._server.stopper))
                self._stops.add(task)
                task.add_done_callback(self._stops.discard)
            case requests.Command() if not viewer.may_command:
                self._reply(request, "this page may only watch: open it with its token")
            case requests.Command() if self._commands.full():
                self._reply(request, f"{MAX_WAITING} commands of this page wait already")
            case requests.Command():
                self._commands.put_nowait(request)

    async def _carry_out(self, command: requests.Command, threads: ThreadPoolExecutor | None = None) -> None:
        carry_out = self._server.commands.carry_out
        self._reply(command, await asyncio.get_running_loop().run_in_executor(threads, carry_out, command))

    async def _carry_out_in_turn(self, viewer: int) -> None:
        driving = self._server.driving
        while True:
            match command := await self._commands.get():
                case requests.OfRobot(op="take"):
                    self._reply(command, await driving.take(command.robot, viewer))
                case requests.OfRobot(op="release"):
                    self._reply(command, await driving.release(command.robot, viewer))
                case _:
                    await self._carry_out(command)

    def _reply(self, command: requests.Command, error: str) -> None:
        self._say({"op": "reply", "seq": command.seq, "error": error})
        self._state.on_news()

    def _say(self, message: dict[str, object]) -> None:
        self._replies.put_nowait(msgspec.json.encode(message))

    async def _send_replies(self) -> None:
        while True:
            await self._socket.send_text((await self._replies.get()).decode())

    async def _send_frames(self, viewer: Viewer) -> None:
        while True:
            while not viewer.has_credit:
                self._ready.clear()
                await self._ready.wait()
            await self._news.wait()
            # Host time: a page gets so many frames a second of host time.
            await asyncio.sleep(viewer.sent + self._state.period - monotonic())  # noqa: TID251
            self._news.clear()
            data = self._server.composer.compose(viewer)
            if viewer.cut:
                self._news.set()
            if data is not None:
                await self._socket.send_bytes(data)

    async def _refuse(self, reason: str) -> None:
        log.info("a page is refused: %s", reason)
        if self._socket.application_state != WebSocketState.CONNECTED:
            return
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            await self._socket.send_text(msgspec.json.encode({"op": "refused", "reason": reason}).decode())
            # A close frame has 123 bytes of reason at most.
            await self._socket.close(POLICY_VIOLATION, reason.encode()[:120].decode(errors="ignore"))


def _is_own_fault(record: logging.LogRecord) -> bool:
    """Whether it is not about what one client sent, of which there may be any number."""
    return record.levelno >= logging.ERROR and not (record.exc_info and record.exc_info[0] is UnicodeDecodeError)


logging.getLogger("uvicorn.error").addFilter(_is_own_fault)

BACKLOG = 64
MOST_CONNECTIONS = 256
MAX_HEAD = 1 << 14
"""Bytes of a request's line and headers."""


class WebServer:
    """Runs on a thread of its own, from `start` until `close`."""

    driving: Driving

    def __init__(self, state: TeamView, listener: socket.socket, host: str, token: str, layout: bytes = b"") -> None:
        """`listener` listens at `host`; `layout` is JSON that pages begin with."""
        self.state, self.token, self._layout = state, token, layout
        self.composer, self.commands = Composer(state), Commands(state)
        self.connections = Connections(share_of_descriptors(4, MOST_CONNECTIONS))
        self.numbers = itertools.count(1)
        self.news: set[asyncio.Event] = set()
        """One for each page, set when something came."""
        self._wakes = False
        """Whether `_tell` is due."""
        self.stopper = ThreadPoolExecutor(STOPS, "stop")
        """For stops: no other command may delay them."""
        self._listener, self._gate, self._app = listener, Gatekeeper(host), self._make_app()
        http, ws = protocols_of(self.connections, self._answer)
        self._server = uvicorn.Server(uvicorn.Config(
            self._app, http=http, ws=ws, ws_max_size=requests.MAX_BYTES, ws_per_message_deflate=False,
            ws_ping_interval=10.0, ws_ping_timeout=20.0, timeout_graceful_shutdown=1, lifespan="off", log_config=None,
            access_log=False, server_header=False, date_header=False, headers=[*HEADERS.items()], proxy_headers=False,
            h11_max_incomplete_event_size=MAX_HEAD, backlog=BACKLOG,
        ))  # fmt: skip
        self._thread = threading.Thread(target=self._run, name="web", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        """Close all sockets, and wait until that is done."""
        self._server.should_exit = True
        self._thread.join(1.0)

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            self.state.node.fail(error)

    async def _serve(self) -> None:
        # Commands wait for the simulator; those of one page must not hold those of others.
        self._loop = asyncio.get_running_loop()
        self._loop.set_default_executor(ThreadPoolExecutor(32, "command"))
        self._loop.set_exception_handler(self.connections.on_loop_error)
        self.driving = Driving(self.state.node.bus)
        self.state.lease_of, self.state.on_news = self.driving.holder, self._on_news
        try:
            await self._server.serve([self._listener])
        finally:
            self.driving.stop()
            self.stopper.shutdown(wait=False)

    def _on_news(self) -> None:
        # Waking this thread for each message of lock-step would take longer than the frames.
        if not self._wakes:
            self._wakes = True
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._loop.call_later, GATHER, self._tell)

    def _tell(self) -> None:
        self._wakes = False
        for event in self.news:
            event.set()

    async def _answer(self, transport: asyncio.Transport, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request of a connection, after the checks of `Host` and `Origin`."""
        headers = Headers(scope=scope)
        host, is_socket, problem = headers.get("host", ""), scope["type"] == "websocket", ""
        if not self._gate.takes_host(host):
            problem = f"this server is not known as {host!r:.80}"
        elif is_socket and not takes_origin(headers.get("origin"), host):
            problem = f"a page of {headers['origin']!r:.80} may not open it"
        scope["transport"] = transport
        self.connections.begin(transport)
        try:
            if problem and is_socket:
                log.info("a socket is refused: %s", problem)
                # Before it is accepted this is the answer 403.
                await send({"type": "websocket.close", "code": POLICY_VIOLATION})
            else:
                await (PlainTextResponse(problem, 421) if problem else self._app)(scope, receive, send)
        finally:
            self.connections.rest(transport)

    def _make_app(self) -> Starlette:
        """The routes: the page, its files, the layout that it begins with, its socket."""

        async def index(_request: Request) -> Response:
            return FileResponse(FOLDER / "index.html")

        async def first_layout(_request: Request) -> Response:
            media_type = "application/json" if self._layout else None
            return Response(self._layout, 200 if self._layout else 204, media_type=media_type)

        return Starlette(
            routes=[
                Route("/", index, methods=["GET"]),
                Route("/layout.json", first_layout, methods=["GET"]),
                Mount("/page", PageFiles(directory=FOLDER)),
                WebSocketRoute("/ws", lambda socket: Page(socket, self).run()),
            ],
            middleware=[Middleware(GZipMiddleware)],
        )


def listen(host: str, port: int) -> tuple[socket.socket, int]:
    """A socket that listens at `host`, at `port` (0 = any) or where that is taken at one of the 20 next, or any; and
    its port. Raises UsageError.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)[0]
    except OSError as error:
        raise UsageError(f"--host {host}: {error.strerror or error}") from None
    for chosen in (*range(port, port + 21), 0) if port else (0,):
        try:
            # `::` is every address of either version.
            listener = socket.create_server(
                (address[0], chosen), family=family, backlog=BACKLOG, dualstack_ipv6=family == socket.AF_INET6
            )
        except OSError as error:
            last = error
        else:
            return listener, int(listener.getsockname()[1])
    raise UsageError(f"cannot listen at {host}: {last.strerror or last}")
