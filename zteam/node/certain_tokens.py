"""Presence tokens whose loss means that a process has ended, and not that this process has lost the router."""

import logging
import threading
from collections.abc import Callable

from zteam.bus import Bus
from zteam.clock import monotonic
from zteam.errors import BusError
from zteam.node.tokens import GRACE, TokenLossFilter

log = logging.getLogger("zteam")


class CertainTokens:
    """Calls `take(key, alive)` for tokens: when one comes at once, and for a loss when it is certain.

    Zenoh reports the lost tokens before the lost link. So a loss is held back until it is clear which of them it was.
    Each `take` is over before the next one.
    """

    def __init__(self, bus: Bus, key_expr: str, take: Callable[[str, bool], None]) -> None:
        self._take = take
        self._losses = TokenLossFilter()
        self._lock = threading.RLock()
        self._waits = False
        """Whether a timer runs: one serves all tokens that are held back."""
        bus.watch_link(self._on_link)
        bus.watch_tokens([key_expr], self._on_token)

    def _on_token(self, key: str, alive: bool) -> None:
        with self._lock:
            self._losses.take_token(key, alive, monotonic())
            if alive:
                self._take(key, True)
            self._look_later()

    def _on_link(self, up: bool) -> None:
        with self._lock:
            self._losses.take_link(up, monotonic())
            self._look_later()

    def _look_later(self) -> None:
        seconds = None if self._waits else self._losses.due_in(monotonic(), GRACE)
        if seconds is not None:
            self._waits = True
            # Host time: the world may be held for the process that is gone.
            timer = threading.Timer(seconds, self._look)  # noqa: TID251
            timer.name, timer.daemon = "tokens", True
            timer.start()

    def _look(self) -> None:
        with self._lock:
            self._waits = False
            for key in self._losses.take_due(monotonic(), GRACE):
                try:
                    self._take(key, False)
                except BusError as error:
                    # The session was closed meanwhile.
                    log.debug("%s", error)
            self._look_later()
