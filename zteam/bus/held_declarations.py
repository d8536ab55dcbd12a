"""Declarations that wait for the name of their process: other sessions see nothing of it before it holds that."""

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from zteam.bus.transport import Closeable

C = TypeVar("C", bound=Closeable)


class Held(Generic[C]):
    """A declaration that is opened by `open`, unless it was closed before."""

    def __init__(self, declare: Callable[[], C]) -> None:
        self._declare = declare
        self._lock = threading.Lock()
        self._handle: C | None = None
        self._closed = False

    def open(self) -> None:
        with self._lock:
            if not self._closed:
                self._handle = self._opened()

    def _opened(self) -> C:
        return self._declare()

    def close(self) -> None:
        """Take it back; a second call does nothing."""
        with self._lock:
            self._closed = True
            if self._handle is not None:
                self._handle.close()


class Holding:
    """Opens publishers and queries at once, or at the `release` after a `begin`."""

    def __init__(self) -> None:
        self._waiting: list[Callable[[], None]] | None = None
        self._lock = threading.Lock()

    def begin(self) -> None:
        """From now on declarations wait. Messages are dropped; of a latched publisher the release sends the last."""
        self._waiting = []

    def release(self) -> None:
        """Open what waits, in the order in which it came."""
        with self._lock:
            waiting, self._waiting = self._waiting, None
        for open_now in waiting or ():
            open_now()

    def open(self, declared: Held[C]) -> None:
        """Open it now, or at the release."""
        with self._lock:
            if self._waiting is not None:
                self._waiting.append(declared.open)
                return
        declared.open()
