"""A condition that wakes a waiting thread only if what it waits for is there."""

import threading
from collections.abc import Callable

from zteam.clock import wait_until


class Change(threading.Condition):
    """A condition whose waits are looked at by the thread that changes something.

    A thread that is woken for nothing waits for the interpreter's lock. Until it gets it, each numpy call of the other
    threads that gives the lock away has to signal it: with four robots in one process that took a fifth of a tick.
    """

    def __init__(self, lock: threading.RLock) -> None:
        super().__init__(lock)
        self._awaited: list[Callable[[], bool]] = []
        """What the threads wait for that wait."""

    def wait_until(self, ready: Callable[[], bool], timeout: float) -> None:
        """Wait until `ready()`, for at most `timeout` host seconds, under the lock. `look` calls `ready` too."""
        self._awaited.append(ready)
        try:
            wait_until(self, ready, timeout)
        finally:
            self._awaited.remove(ready)

    def look(self) -> None:
        """Something has changed: wake the threads in `wait_until` if one of them is ready. Call it under the lock."""
        if any(ready() for ready in self._awaited):
            self.notify_all()
