"""Whose messages count in lock-step as they come: those of the simulator and of sessions that the newest tick lists.

What any other session sends comes to all participants in the same tick, in its inputs, and is dropped where it comes
past it. A session that is not listed may be in the next tick, which may be on its way: so its messages wait for that.
A latched one waits until its session is listed.
"""

from collections.abc import Sequence, Set
from itertools import count
from threading import RLock
from typing import Any

from zteam.bus.receiving import Receiver
from zteam.bus.transport import RawSample, SampleHandler

FROM_TICK = "tick"
"""In place of the session of what a tick carries; no session has this id."""
_MOST, _MOST_BYTES, _MOST_LATCHED_BYTES = 1000, 1 << 20, 16 << 20
"""Messages that wait, and their bytes: each further one replaces the oldest. A large map is latched."""


class Screen:
    """Decides what a bus handles as it comes. `_keep` is called on the bus's threads, all else under `lock`."""

    def __init__(self, received: Receiver, lock: RLock, simulators: Set[str]) -> None:
        """`simulators` are the sessions of those in lock-step."""
        self._received, self._lock, self._simulators = received, lock, simulators
        self._opened: tuple[Sequence[str], int] = (), 0
        """The sessions of the newest tick, and the number of simulators."""
        self._waiting = _Kept(_MOST_BYTES)
        """In the order in which they came."""
        self._latched = _Kept(_MOST_LATCHED_BYTES)
        """The newest by handler, key and session."""
        self._numbers = count()
        received.keep = self._keep

    @property
    def sessions(self) -> Set[str] | None:
        """Whose messages count; None where all do."""
        return self._received.sessions

    def _keep(self, sample: RawSample, handler: SampleHandler, latched: bool) -> bool:
        with self._lock:
            sessions = self._received.sessions
            if sessions is None or sample.source in sessions:
                # A tick has come meanwhile.
                return False
            if latched:
                self._latched.keep((handler, sample.key, sample.source), handler, sample)
            else:
                self._waiting.keep(next(self._numbers), handler, sample)
        return True

    def open(self, sessions: Sequence[str] | None) -> list[str]:
        """A tick lists these sessions; hand what has waited for one of them to its handler. None: it lists none.

        The keys of the messages that are dropped.
        """
        if sessions is None:
            self.forget()
            return []
        now, latched = self.sessions, list[tuple[SampleHandler, RawSample]]()
        opened, count = self._opened, len(self._simulators)
        # The list is the same one in most ticks: to compare its texts takes time in each.
        is_known = now is not None and (sessions is opened[0] or sessions == opened[0]) and count == opened[1]
        if now is None or not is_known:
            self._opened = sessions, count
            now = self._received.sessions = frozenset((*sessions, *self._simulators, FROM_TICK))
            # Those of other sessions wait on, and are not looked at in each tick.
            latched = self._latched.take(now)
        if not (self._waiting or latched):
            return []
        waiting = self._waiting.take()
        listed = [each for each in waiting if each[1].source in now]
        for handler, sample in [*listed, *latched]:
            handler(sample)
        return [sample.key for _, sample in waiting if sample.source not in now]

    def forget(self) -> None:
        """There are no ticks any more: all messages count."""
        self._received.sessions = None
        for handler, sample in [*self._latched.take(), *self._waiting.take()]:
            handler(sample)


class _Kept:
    """Messages that are kept for their handlers, the oldest first."""

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes, self._bytes = most_bytes, 0
        self._kept: dict[Any, tuple[SampleHandler, RawSample]] = {}

    def __len__(self) -> int:
        return len(self._kept)

    def keep(self, place: Any, handler: SampleHandler, sample: RawSample) -> None:
        """Keep a message, in place of the one that had its `place`; forget the oldest ones if these are too many."""
        self._forget(place)
        self._kept[place] = handler, sample.apart()
        self._bytes += _size(sample)
        while len(self._kept) > _MOST or self._bytes > self._most_bytes:
            self._forget(next(iter(self._kept)))

    def _forget(self, place: Any) -> None:
        if (kept := self._kept.pop(place, None)) is not None:
            self._bytes -= _size(kept[1])

    def take(self, sessions: Set[str] | None = None) -> list[tuple[SampleHandler, RawSample]]:
        """The messages of these sessions, or all; they are kept no longer."""
        places = [place for place, (_, sample) in self._kept.items() if sessions is None or sample.source in sessions]
        taken = [self._kept[place] for place in places]
        for place in places:
            self._forget(place)
        return taken


def _size(sample: RawSample) -> int:
    """Bytes; within one process messages are shared, and take no place of their own."""
    return len(sample.content) if isinstance(sample.content, bytes) else 0
