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
from threading import get_ident
from typing import Any

from zteam.bus.memory import HubReceiver
from zteam.bus.transport import QueryHandler
from zteam.node.working import CALLS, WORK, Work, working_for

log = logging.getLogger("zteam")


class Delivery:
    """Brings what is put on a hub to the handlers of the nodes."""

    def __init__(self) -> None:
        self.direct = 0
        """The thread that calls handlers itself; 0 = none."""
        self._work: Work
        """Of that thread."""
        self._posted: deque[tuple[Sequence[HubReceiver], Any]] = deque()
        """What the other threads put. The first one is being handled."""
        self._following: deque[tuple[Sequence[HubReceiver], Any]] = deque()
        """What the direct thread put, and handlers that it called."""
        self._changed = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._handle_posted, name="messages", daemon=True)
        self._thread.start()

    def deliver_in_this_thread(self) -> None:
        """From now on this thread calls the handlers of what it puts."""
        self.direct = get_ident()
        self._work = WORK[self.direct]

    def deliver(self, receivers: Sequence[HubReceiver], news: Any) -> None:
        """Call the receivers, or have them called. The hub calls this in the thread that puts a message."""
        following = self._following
        if get_ident() != self.direct:
            self._post([(receivers, news)])
        elif self._posted:
            # This one may be newer than one of the same publisher that waits, and those that follow are older.
            self._post([*following, (receivers, news)])
            following.clear()
        else:
            following.append((receivers, news))
            work = self._work
            if work.call:
                # A handler has put this.
                return
            node = work.node
            try:
                while following:
                    receivers, news = following.popleft()
                    work.call = next(CALLS)
                    for work.node, receive in receivers:
                        receive(news)
            finally:
                work.node, work.call = node, 0

    def _post(self, news: list[tuple[Sequence[HubReceiver], Any]]) -> None:
        with self._changed:
            self._posted += news
            self._changed.notify()

    def _handle_posted(self) -> None:
        work = WORK[get_ident()]
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._posted or self._closed)
                if self._closed:
                    return
            receivers, news = self._posted[0]
            for work.node, receive in receivers:
                work.call = next(CALLS)
                try:
                    receive(news)
                except BaseException:
                    # As over Zenoh: it does not end the thread, which serves all nodes.
                    log.exception("error in a callback of the bus")
            work.node, work.call = "", 0
            self._posted.popleft()

    def close(self) -> None:
        """Forget what is not handled yet."""
        with self._changed:
            self._closed = True
            self._changed.notify()


def answering_as(owner: str, handler: QueryHandler) -> QueryHandler:
    """Calls `handler(asked, payload)` as the node `owner`, and what it returns if that takes its time."""
    as_owner = working_for(owner)

    def answer(asked: str, payload: bytes) -> bytes | Callable[[], bytes]:
        made = as_owner(handler)(asked, payload)
        return as_owner(made) if callable(made) else made

    return answer
