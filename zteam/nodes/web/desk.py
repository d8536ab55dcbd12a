"""What all pages share, on the thread of the pages."""

import asyncio
import contextlib
import itertools

from zteam.nodes.web.commands import Commands
from zteam.nodes.web.composing import Composer
from zteam.nodes.web.driving import Driving
from zteam.nodes.web.hub import Hub

GATHER = 0.01
"""Host seconds from the first message of a tick until a frame is made: the tick's other messages come within them."""


class Desk:
    """What all pages share, on the thread of the pages."""

    def __init__(self, hub: Hub, token: str) -> None:
        self.hub, self.token = hub, token
        self.composer = Composer(hub)
        self.numbers = itertools.count(1)
        self.news: set[asyncio.Event] = set()
        """One for each page, set when something came."""
        self._came = self._armed = False
        self._loop = asyncio.get_running_loop()
        self.driving = Driving(hub.node.bus)
        self.commands = Commands(hub)
        hub.lease_of = self.driving.leases.holder
        hub.on_news = self._on_news

    def _on_news(self) -> None:
        # Waking this thread for each message of lock-step would take longer than the frames.
        self._came = True
        if not self._armed:
            self._armed = True
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._tell)

    def _tell(self) -> None:
        self._came = False
        for event in self.news:
            event.set()
        self._loop.call_later(GATHER, self._rest)

    def _rest(self) -> None:
        self._armed = False
        if self._came:
            self._armed = True
            self._tell()
