"""What a session publishes and subscribes to: it keeps a list, and tells it to those that ask.

The router knows the declarations of all sessions, those of foreign programs too, but zteam never asks it for them. A
router that answers such a query of its admin space, such as `@/*/router/publisher/**`, takes the lock of its tables a
second time. If a session opens in between, the router stands still for ever, and with it the whole team
(https://github.com/eclipse-zenoh/zenoh/pull/2619). Its own record, `@/*/router`, needs no such lock.
"""

import itertools
import threading
from collections.abc import Callable
from typing import TypeVar

from zteam.bus.transport import Closeable, Declaration

C = TypeVar("C", bound=Closeable)


class OpenDeclarations:
    """The open publishers and subscribers of one session."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._numbers = itertools.count()
        self._open: dict[int, Declaration] = {}

    def keep(self, declaration: Declaration, declare: Callable[[], C]) -> tuple[C, Callable[[], None]]:
        """What `declare()` opens, and the call that takes it off the list again.

        It is listed before it is opened: when others notice it, they find it in the list.
        """
        number = next(self._numbers)

        def forget() -> None:
            with self._lock:
                self._open.pop(number, None)

        with self._lock:
            self._open[number] = declaration
        try:
            return declare(), forget
        except BaseException:
            forget()
            raise

    def read(self) -> list[Declaration]:
        """The list now."""
        with self._lock:
            return list(self._open.values())


class Subscription:
    """A subscriber that leaves the list when it is closed."""

    def __init__(self, handle: Closeable, forget: Callable[[], None]) -> None:
        self._handle = handle
        self._forget = forget

    def close(self) -> None:
        """Take it back; a second call does nothing."""
        self._forget()
        self._handle.close()
