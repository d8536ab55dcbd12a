"""Keys that have one publisher at a time, and on which several publish: two bases of one robot, two teleops."""

import logging
import threading
from collections import defaultdict
from collections.abc import Mapping
from typing import Generic, TypeVar

from zteam.bus import Bus
from zteam.bus.graph import tell_rivals
from zteam.clock import monotonic

log = logging.getLogger("zteam")

K = TypeVar("K")

RECENT = 5.0
"""Host seconds after its last message for which a session is still a writer."""
_MOST = 64
"""Sessions of a key that are remembered: a sender can invent them."""


class Writers(Generic[K]):
    """The sessions that publish on each key; a key may be the id of a robot that they command. Pure."""

    def __init__(self) -> None:
        self._newest: dict[K, str] = {}
        self._heard: defaultdict[K, dict[str, float]] = defaultdict(dict)
        """The last host time, by key and session."""
        self._turned: dict[K, float] = {}
        """By key: when last a session was heard again after another."""

    def take(self, key: K, session: str, now: float) -> None:
        """A message came on `key` from `session` at host time `now`."""
        heard = self._heard[key]
        if self._newest.get(key, session) != session and now - heard.get(session, -RECENT) < RECENT:
            self._turned[key] = now
        self._newest[key] = session
        if session in heard or len(heard) < _MOST:
            heard[session] = now

    def recent(self, now: float) -> dict[K, set[str]]:
        """The sessions that were heard of late, by key."""
        for key, heard in self._heard.items():
            self._heard[key] = {session: at for session, at in heard.items() if now - at <= RECENT}
        return {key: {*heard} for key, heard in self._heard.items() if heard}

    def rivals(self, now: float) -> dict[K, set[str]]:
        """The sessions that took turns on a key of late, by key: one of them was heard again after another.

        A process that was started anew has another session, and the one before is not heard again.
        """
        return {key: found for key, found in self.recent(now).items() if now - self._turned.get(key, -RECENT) < RECENT}


class RivalWatch:
    """Says once in the log, and to the processes themselves, that several publish on a key that this process takes."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._writers = Writers[str]()
        self._told: dict[str, list[str]] = {}
        self._asking: threading.Thread | None = None

    def take(self, key: str, session: str) -> None:
        """A message has come on a key that has one publisher (under the node's lock)."""
        if session:
            self._writers.take(key, session, monotonic())

    def look(self) -> None:
        """Log what has changed (under the node's lock). A thread of its own asks the sessions: a robot drives on."""
        if self._asking is not None and self._asking.is_alive():
            return
        found = {key: sorted(sessions) for key, sessions in self._writers.rivals(monotonic()).items()}
        new = {key: sessions for key, sessions in found.items() if self._told.get(key) != sessions}
        for key in self._told.keys() - found.keys():
            log.info("%s has one publisher again", key)
        self._told = found
        if new:
            self._asking = threading.Thread(target=self._tell, args=[new], name="rivals", daemon=True)
            self._asking.start()

    def _tell(self, found: Mapping[str, list[str]]) -> None:
        for key, sessions in found.items():
            writers = tell_rivals(self._bus, key, sessions)
            if len(writers) > 1:
                log.warning("%s has %d publishers: %s: end all but one", key, len(writers), ", ".join(writers))
