"""One page's WebSocket: its messages are taken in order, and frames go out as it takes them."""

import asyncio
import contextlib
import logging

import msgspec
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from zteam.clock import monotonic
from zteam.errors import DecodeError
from zteam.nodes.web import rights
from zteam.nodes.web.desk import GATHER, Desk
from zteam.nodes.web.leases import Velocity
from zteam.nodes.web.orders import Allowance, Orders
from zteam.nodes.web.requests import (
    MAX_BYTES,
    VERSION,
    Ack,
    AnyRequest,
    Command,
    Drive,
    Hello,
    Look,
    Unwatch,
    Watch,
    decode_request,
)
from zteam.nodes.web.viewer import Viewer

log = logging.getLogger("zteam")

HELLO_LIMIT = 5.0
"""Host seconds for a page's first message."""
POLICY_VIOLATION = 1008


class RefusedError(Exception):
    """The page is told why, and its socket is closed."""


class Page:
    """One connection."""

    def __init__(self, socket: WebSocket, desk: Desk) -> None:
        self._socket, self._desk, self._hub = socket, desk, desk.hub
        self._ready, self._news = asyncio.Event(), asyncio.Event()
        self._news.set()
        self._replies: asyncio.Queue[bytes] = asyncio.Queue()
        self._orders = Orders(desk, self._reply)
        self._allowance = Allowance()

    async def run(self) -> None:
        """Serve the page until its socket is closed."""
        await self._socket.accept()
        try:
            viewer = await self._greet()
        except RefusedError as refusal:
            await self._refuse(str(refusal))
            return
        except WebSocketDisconnect:
            return
        self._hub.add(viewer)
        self._desk.news.add(self._news)
        try:
            async with asyncio.TaskGroup() as tasks:
                for work in (
                    self._receive(viewer),
                    self._orders.carry_out(viewer.number),
                    self._send_replies(),
                    self._send_frames(viewer),
                ):
                    tasks.create_task(work)
        except* RefusedError as refusals:
            await self._refuse(str(refusals.exceptions[0]))
        except* WebSocketDisconnect:
            pass
        finally:
            self._desk.news.discard(self._news)
            self._hub.remove(viewer)
            await self._desk.driving.release_all(viewer.number)

    async def _greet(self) -> Viewer:
        try:
            # Host time: a page that says nothing is let go, while this thread serves others.
            hello = await asyncio.wait_for(self._read(), HELLO_LIMIT)  # noqa: TID251
        except TimeoutError:
            raise RefusedError(f"no hello within {HELLO_LIMIT:g} s") from None
        if not isinstance(hello, Hello):
            raise RefusedError("the first message has to be hello")
        if hello.version != VERSION:
            raise RefusedError(f"the page speaks version {hello.version}, this server {VERSION}: load it again")
        viewer = Viewer(next(self._desk.numbers), rights.is_token(hello.token, self._desk.token))
        welcome = {"op": "welcome", "version": VERSION, "viewer": viewer.number, "may_command": viewer.may_command}
        await self._socket.send_text(msgspec.json.encode(welcome).decode())
        return viewer

    async def _read(self) -> AnyRequest:
        message = await self._socket.receive()
        if message["type"] != "websocket.receive":
            raise WebSocketDisconnect(message.get("code", 1005))
        text = message.get("text")
        if text is None:
            raise RefusedError("messages are text")
        if len(text) > MAX_BYTES:
            raise RefusedError(f"a message has {MAX_BYTES} bytes at most")
        try:
            return decode_request(text)
        except DecodeError as error:
            raise RefusedError(str(error)) from None

    async def _receive(self, viewer: Viewer) -> None:
        while True:
            self._take(viewer, await self._read())
            await self._allowance.wait()

    def _take(self, viewer: Viewer, request: AnyRequest) -> None:
        match request:
            case Ack():
                viewer.take_ack(request)
                self._ready.set()
            case Look():
                viewer.look = request
                self._hub.changed()
            case Watch():
                viewer.take_watch(request)
                self._hub.changed()
            case Unwatch():
                viewer.take_unwatch(request)
                self._hub.changed()
            case Hello():
                raise RefusedError("hello comes once")
            case Drive():
                self._desk.driving.drive(
                    request.robot, viewer.number, Velocity(request.linear, request.angular, request.left)
                )
            case Command():
                self._orders.take(request, viewer)

    def _reply(self, seq: int, error: str) -> None:
        self._replies.put_nowait(msgspec.json.encode({"op": "reply", "seq": seq, "error": error}))

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
            await asyncio.sleep(max(GATHER, viewer.sent + self._hub.period - monotonic()))  # noqa: TID251
            self._news.clear()
            data = self._desk.composer.compose(viewer)
            if viewer.lacks_tiles:
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
