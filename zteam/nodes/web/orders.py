"""The commands of one page, carried out one after another; and how fast a page may speak."""

import asyncio
from collections.abc import Callable

from zteam.clock import monotonic
from zteam.nodes.web.desk import Desk
from zteam.nodes.web.requests import Command, Release, Take
from zteam.nodes.web.viewer import Viewer

MAX_WAITING = 32
"""Commands of one page that wait for those before them."""
BURST, RATE = 200.0, 100.0
"""Messages that a page may send at once, and a second; more are read later, so they delay no other page."""


class Orders:
    """`take` puts a command into the queue, `carry_out` empties it."""

    def __init__(self, desk: Desk, reply: Callable[[int, str], None]) -> None:
        """`reply(seq, error)` answers a command."""
        self._desk, self._reply = desk, reply
        self._waiting: asyncio.Queue[Command] = asyncio.Queue(MAX_WAITING)

    def take(self, command: Command, viewer: Viewer) -> None:
        """A page commands."""
        if not viewer.may_command:
            self._reply(command.seq, "this page may only watch: open it with its token")
        elif self._waiting.full():
            self._reply(command.seq, f"{MAX_WAITING} commands of this page wait already")
        else:
            self._waiting.put_nowait(command)

    async def carry_out(self, viewer: int) -> None:
        """Carry out the commands of a viewer as they come."""
        desk = self._desk
        while True:
            command = await self._waiting.get()
            match command:
                case Take():
                    error = await desk.driving.take(command.robot, viewer)
                case Release():
                    error = await desk.driving.release(command.robot, viewer)
                case _:
                    error = await asyncio.to_thread(desk.commands.carry_out, command)
            self._reply(command.seq, error)
            desk.hub.on_news()


class Allowance:
    """How many messages a page may still send."""

    def __init__(self) -> None:
        self._left, self._counted = BURST, monotonic()

    async def wait(self) -> None:
        """Count a message, and wait where there were too many."""
        now = monotonic()
        self._left = min(BURST, self._left + RATE * (now - self._counted)) - 1.0
        self._counted = now
        if self._left < 0.0:
            # Host time: a page that says too much is read later.
            await asyncio.sleep(-self._left / RATE)  # noqa: TID251
