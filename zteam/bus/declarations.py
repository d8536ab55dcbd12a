"""What a session declares: it waits for the name of its process, and is listed for those that ask.

The router knows the declarations of all sessions, those of foreign programs too, but zteam never asks it for them. A
router that answers such a query of its admin space, such as `@/*/router/publisher/**`, takes the lock of its tables a
second time. If a session opens in between, the router stands still for ever, and with it the whole team
(https://github.com/eclipse-zenoh/zenoh/pull/2619). Its own record, `@/*/router`, needs no such lock.
"""

import threading
from collections.abc import Callable
from typing import Any, Generic, TypeVar

from zteam.bus.transport import Closeable, Declaration, RawPublisher, check_use
from zteam.messages import Message, encode

C = TypeVar("C", bound=Closeable)


class OpenDeclarations:
    """The open publishers and subscribers of one session."""

    def __init__(self) -> None:
        self._open: dict[object, Declaration] = {}

    def keep(self, declaration: Declaration, declare: Callable[[], C]) -> tuple[C, Callable[[], object]]:
        """What `declare()` opens, and the call that takes it off the list again.

        It is listed before it is opened: when others notice it, they find it in the list.
        """
        place = object()
        self._open[place] = declaration
        try:
            return declare(), lambda: self._open.pop(place, None)
        except BaseException:
            del self._open[place]
            raise

    def read(self) -> list[Declaration]:
        """The list now."""
        return list(self._open.values())


class Subscription:
    """A subscriber that leaves the list when it is closed."""

    def __init__(self, handle: Closeable, forget: Callable[[], object]) -> None:
        self._handle = handle
        self._forget = forget

    def close(self) -> None:
        """Take it back; a second call does nothing."""
        self._forget()
        self._handle.close()


class Holding:
    """Declares publishers and queries at once, or at the `release` after a `begin`.

    So other sessions see nothing of a process before it holds its name.
    """

    def __init__(self) -> None:
        self.releases = 0
        self._active = False
        self._waiting: list[_Held[Any]] = []
        self._lock = threading.Lock()

    def begin(self) -> None:
        """From now on declarations wait. Messages are dropped; of a latched publisher the release sends the last."""
        self._active = True

    def release(self) -> None:
        """Declare what waits, in the order in which it came."""
        with self._lock:
            waiting, self._waiting, self._active = self._waiting, [], False
        for held in waiting:
            held.release()
        self.releases += 1

    def publisher(self, key: str, latched: bool, declare: Callable[[], RawPublisher]) -> RawPublisher:
        """What `declare()` opens, now or later. Raises BusError for a `key` that is no key expression."""
        check_use("publish on", key, False)
        held = _HeldPublisher(declare, latched)
        return held if self._waits(held) else declare()

    def declaration(self, declare: Callable[[], Closeable], at_once: bool) -> Closeable:
        """What `declare()` opens, now or later."""
        held = _Held(declare)
        return held if not at_once and self._waits(held) else declare()

    def _waits(self, held: "_Held[Any]") -> bool:
        """Whether it is kept for the release."""
        with self._lock:
            if self._active:
                self._waiting.append(held)
            return self._active


class _Held(Generic[C]):
    """A declaration that waits, unless it was closed before."""

    def __init__(self, declare: Callable[[], C]) -> None:
        self._declare = declare
        self._lock = threading.Lock()
        self._handle: C | None = None
        self._closed = False

    def release(self) -> None:
        """Declare it."""
        with self._lock:
            if not self._closed:
                self._handle = self._open()

    def _open(self) -> C:
        return self._declare()

    def close(self) -> None:
        with self._lock:
            self._closed = True
            if self._handle is not None:
                self._handle.close()


class _HeldPublisher(_Held[RawPublisher]):
    """A publisher that waits. From its release on it passes all on."""

    def __init__(self, declare: Callable[[], RawPublisher], latched: bool) -> None:
        super().__init__(declare)
        self._latched = latched
        self._kept: bytes | None = None

    def _open(self) -> RawPublisher:
        raw = self._declare()
        if self._latched and self._kept is not None:
            raw.put(self._kept)
        return raw

    @property
    def has_subscribers(self) -> bool:
        raw = self._handle
        return self._latched and not self._closed if raw is None else raw.has_subscribers

    def find_subscribers(self) -> bool:
        raw = self._handle
        return self.has_subscribers if raw is None else raw.find_subscribers()

    def put(self, payload: bytes) -> None:
        with self._lock:
            raw = self._handle
            if raw is None:
                self._kept = payload
                return
        raw.put(payload)

    def put_message(self, message: Message) -> None:
        raw = self._handle
        # A release in between: `put` looks again.
        self.put(encode(message)) if raw is None else raw.put_message(message)

    def hand_over(self, message: Message) -> None:
        raw = self._handle
        self.put(encode(message)) if raw is None else raw.hand_over(message)
