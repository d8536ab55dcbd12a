"""In which thread a message is handled when all nodes of a team are in one process.

Over Zenoh a message is handled on a thread of the bus, so `put` never waits for a lock of the receiver. Here the nodes
have threads too. If each of them called the handlers of what it puts, two threads that hold the locks of two nodes
could wait for each other. So only one thread, the simulator's, calls handlers in `put`. What the others put is handled
by one more thread, in the order in which it came.

As with a router, a message reaches all its receivers before anything that one of them sends because of it: a node that
answers a tick is not heard in that tick by a node that has not got it yet.
"""

import logging
import threading
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from threading import get_ident
from types import CodeType, FrameType
from typing import Any, TypeVar

from zteam.bus.memory import HubReceiver
from zteam.bus.transport import QueryHandler

log = logging.getLogger("zteam")

F = TypeVar("F", bound=Callable[..., Any])

T = TypeVar("T")

_MARKED: set[CodeType] = set()
"""The code of functions whose variable `owner` names the node that works in them."""


def marks_owner(function: F) -> F:
    """Let `current_owner` find the variable `owner` of this function."""
    _MARKED.add(function.__code__)
    return function


def current_owner(frame: FrameType | None, default: str) -> str:
    """The node that works in this frame, as the functions below it tell: nothing is noted for each message."""
    while frame is not None:
        if frame.f_code in _MARKED and "owner" in frame.f_locals:
            return str(frame.f_locals["owner"])
        frame = frame.f_back
    return default


class Delivery:
    """Brings what is put on a hub to the handlers of the nodes."""

    def __init__(self) -> None:
        self.direct = 0
        """The thread that calls handlers itself; 0 = none."""
        self._posted: deque[tuple[Sequence[HubReceiver], Any]] = deque()
        """What the other threads put. The first one is being handled."""
        self._following: deque[tuple[Sequence[HubReceiver], Any]] = deque()
        """What handlers put that the direct thread called."""
        self._delivering = False
        """Whether the direct thread calls handlers."""
        self._changed = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._work, name="messages", daemon=True)
        self._thread.start()

    def deliver_in_this_thread(self) -> None:
        """From now on this thread calls the handlers of what it puts."""
        self.direct = get_ident()

    @marks_owner
    def deliver(self, receivers: Sequence[HubReceiver], news: Any) -> None:
        """Call the receivers, or have them called. The hub calls this in the thread that puts a message."""
        following = self._following
        if get_ident() != self.direct:
            self._post([(receivers, news)])
        elif self._posted:
            # This one may be newer than one of the same publisher that waits, and those that follow are older.
            self._post([*following, (receivers, news)])
            following.clear()
        elif self._delivering:
            following.append((receivers, news))
        else:
            self._delivering = True
            try:
                for owner, take in receivers:  # noqa: B007
                    take(news)
                while following:
                    receivers, news = following.popleft()
                    for owner, take in receivers:  # noqa: B007
                        take(news)
            finally:
                self._delivering = False

    def _post(self, news: list[tuple[Sequence[HubReceiver], Any]]) -> None:
        with self._changed:
            self._posted += news
            self._changed.notify()

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._posted or self._closed)
                if self._closed:
                    return
            receivers, news = self._posted[0]
            for owner, take in receivers:
                try:
                    call_as(owner, take, news)
                except BaseException:
                    # As over Zenoh: it does not end the thread, which serves all nodes.
                    log.exception("error in a callback of the bus")
            self._posted.popleft()

    def close(self) -> None:
        """Forget what is not handled yet."""
        with self._changed:
            self._closed = True
            self._changed.notify()


@marks_owner
def call_as(owner: str, function: Callable[..., T], *arguments: Any) -> T:
    """Call a function as the node `owner`."""
    return function(*arguments)


def answering_as(owner: str, handler: QueryHandler) -> QueryHandler:
    """Calls `handler(asked, payload)` as the node `owner`, and what it returns if that takes its time."""

    def answer(asked: str, payload: bytes) -> bytes | Callable[[], bytes]:
        made = call_as(owner, handler, asked, payload)
        return partial(call_as, owner, made) if callable(made) else made

    return answer
