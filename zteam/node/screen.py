"""Whose messages count in lock-step as they come: those of the simulator and of sessions that the newest tick lists.

What any other session sends comes to all participants in the same tick, in its inputs, and is dropped where it comes
past it. A session that is not listed may be in the next tick, which may be on its way: so its messages wait for that.
A latched one waits until its session is listed.
"""

from collections import deque
from collections.abc import Callable, Iterable, Set
from threading import RLock

from zteam.bus.transport import RawSample, SampleHandler

FROM_TICK = "tick"
"""In place of the session of what a tick carries; no session has this id."""
_MOST = 1000
"""Messages that wait; each further one replaces the oldest."""


class Screen:
    """Admits messages, or keeps them. `admits` is called on the bus's threads, all else under `lock`."""

    def __init__(self, lock: RLock, simulators: Set[str], on_refused: Callable[[str], object]) -> None:
        """`simulators` are the sessions of those in lock-step; `on_refused(key)` is called for a message that is
        dropped."""
        self._lock, self._simulators, self._on_refused = lock, simulators, on_refused
        self.sessions: frozenset[str] | None = None
        """Whose messages count; None where all do."""
        self._waiting = deque[tuple[SampleHandler, RawSample]](maxlen=_MOST)
        self._latched: dict[tuple[SampleHandler, str, str], RawSample] = {}
        """The newest by handler, key and session."""

    def admits(self, sample: RawSample, handler: SampleHandler, latched: bool) -> bool:
        """Whether a message is handled now."""
        sessions = self.sessions
        if sessions is None or sample.source in sessions:
            return True
        with self._lock:
            if self.sessions is not sessions:
                # A tick has come meanwhile.
                return self.admits(sample, handler, latched)
            if latched:
                place = handler, sample.key, sample.source
                self._latched.pop(place, None)
                self._latched[place] = sample
                if len(self._latched) > _MOST:
                    del self._latched[next(iter(self._latched))]
            else:
                self._waiting.append((handler, sample))
        return False

    def open(self, sessions: Iterable[str] | None) -> None:
        """A tick lists these sessions; hand what has waited for one of them to its handler. None: it lists none."""
        if sessions is None:
            self.forget()
            return
        self.sessions = frozenset((*sessions, *self._simulators, FROM_TICK))
        waiting, self._waiting = self._waiting, deque(maxlen=_MOST)
        for handler, sample in waiting:
            if sample.source in self.sessions:
                handler(sample)
            else:
                self._on_refused(sample.key)
        for place in [place for place in self._latched if place[2] in self.sessions]:
            place[0](self._latched.pop(place))

    def forget(self) -> None:
        """There are no ticks any more: all messages count."""
        self.sessions = None
        waiting = [*((handler, sample) for (handler, _, _), sample in self._latched.items()), *self._waiting]
        self._latched.clear()
        self._waiting.clear()
        for handler, sample in waiting:
            handler(sample)
