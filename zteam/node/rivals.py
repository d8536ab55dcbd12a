"""Keys that have one publisher at a time, and which sessions publish on each."""

from collections import defaultdict
from typing import Generic, TypeVar

K = TypeVar("K")

RECENT = 5.0
"""Host seconds after its last message for which a session is still a writer."""
_MOST = 64
"""Sessions of a key that are remembered: a sender can invent them."""


class Writers(Generic[K]):
    """The sessions that publish on each key; a key may be the id of a robot that they command. Pure."""

    def __init__(self) -> None:
        self._heard: defaultdict[K, dict[str, float]] = defaultdict(dict)
        """The last host time, by key and session."""

    def take(self, key: K, session: str, now: float) -> None:
        """A message came on `key` from `session` at host time `now`."""
        heard = self._heard[key]
        if session in heard or len(heard) < _MOST:
            heard[session] = now

    def recent(self, now: float) -> dict[K, set[str]]:
        """The sessions that were heard of late, by key."""
        for key, heard in self._heard.items():
            self._heard[key] = {session: at for session, at in heard.items() if now - at <= RECENT}
        return {key: {*heard} for key, heard in self._heard.items() if heard}
