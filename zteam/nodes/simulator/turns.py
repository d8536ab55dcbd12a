"""The main loop's turns: when the next tick may begin, and the changes of the world that are made between two ticks."""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

from zteam.clock import monotonic, wait_until
from zteam.errors import ZteamError
from zteam.nodes.simulator.pacing import Pacer
from zteam.runtime.process_node import ProcessNode

T = TypeVar("T")

_LONGEST_WAIT = 3600.0
"""Host seconds of one wait for the next tick; a condition takes no time-out of centuries."""


class Turns:
    """The main loop calls `wait_for_turn` and `finish`; the threads of queries call the rest."""

    def __init__(self, node: ProcessNode, pacer: Pacer) -> None:
        self._node = node
        self._pacer = pacer
        self._changes: deque[tuple[Future[Any], Callable[[], Any]]] = deque()
        self._begins_anew = False
        """After a reset the first tick is sent even if the world is paused: no process would learn of it otherwise."""
        self._state = threading.Condition(threading.RLock())
        """Guards `finished` and `_standing`, and tells of their changes."""
        self._standing = False
        """Whether the main loop waits here and no tick is due."""
        self.finished = False
        """Whether the time of `--for` is over."""

    def submit(self, change: Callable[[], T]) -> Future[T]:
        """Have the main loop call `change()` between two ticks. The future gets its result or its ZteamError."""
        future: Future[T] = Future()
        with self._node.changed:
            self._changes.append((future, change))
            self._node.changed.notify_all()
        return future

    def set_pace(self, change: Callable[[], None]) -> None:
        """Change the pacer now, during the open tick, and let the main loop look at it."""
        with self._node.changed:
            change()
            self._node.changed.notify_all()

    def step(self, ticks: int) -> None:
        """Take so many more ticks, then stand still."""
        with self._state:
            self._standing = False
            self._pacer.step(ticks)
        self._node.wake()

    def wait_for_steps(self) -> None:
        """Wait until the steps are done, the world is resumed or the process stops, however long that takes."""
        with self._state:
            # There is no time-out: if the client that asked has gone, this thread ends with the process.
            while self._pacer.paused and not (self._standing or self._node.stopping):
                self._state.wait(1.0)

    def wait_until_standing(self, timeout: float) -> bool:
        """Wait `timeout` host seconds at most; whether the world stands still."""
        with self._state:
            wait_until(self._state, lambda: self._stands or self._node.stopping, timeout)
            return self._stands

    def wait_until_finished(self, timeout: float) -> bool:
        """Wait `timeout` host seconds at most; whether the time of `--for` is over."""
        with self._state:
            wait_until(self._state, lambda: self.finished or self._node.stopping, timeout)
            return self.finished

    def finish(self) -> None:
        """The time of `--for` is over: the world stands still."""
        with self._state:
            self.finished = True
            self._pacer.steps = 0
            self._state.notify_all()

    def begin_anew(self) -> None:
        """The world is as at its start: send its first tick, even if the world is paused."""
        with self._state:
            self.finished = False
        self._begins_anew = True

    def wait_for_turn(self) -> bool:
        """Wait until the next tick is due, and make changes meanwhile; False when the process is asked to stop."""
        while not self._node.stopping:
            self._make_changes()
            with self._state:
                remaining = self._remaining()
                self._standing = remaining is None
                if self._standing:
                    self._state.notify_all()
            if remaining == 0.0:
                self._begins_anew = False
                return True
            self._wait_for_news(remaining)
        return False

    def _make_changes(self) -> None:
        while self._changes:
            future, change = self._changes.popleft()
            try:
                future.set_result(change())
            except ZteamError as error:
                future.set_exception(error)

    def _wait_for_news(self, remaining: float | None) -> None:
        """Wait until there is a change to make, the next tick is due, or the pace has changed."""
        due = None if remaining is None else monotonic() + remaining

        def has_news() -> bool:
            if self._changes or (due is not None and monotonic() >= due):
                return True
            now_remaining = self._remaining()
            # The pace may have changed between the last look and this wait: then `_standing` is to be set again.
            return now_remaining == 0.0 or (now_remaining is None) != self._standing

        self._node.wait(has_news, _LONGEST_WAIT if remaining is None else min(remaining, _LONGEST_WAIT))

    def _remaining(self) -> float | None:
        if self._begins_anew:
            return 0.0
        return None if self.finished else self._pacer.remaining(monotonic())

    @property
    def _stands(self) -> bool:
        # After `resume` or `step` the main loop may not have looked at the pacer yet.
        return self._standing and self._remaining() is None
