"""Which messages were sent before time jumped back. Pure."""

from collections.abc import Callable


class EndedTime:
    """The time before the last jump back: the world was reset, or its simulator started anew.

    A process that has not heard of that yet goes on for a moment. The aggregator sends its last bundle again, and a
    robot its last status. Such a message may come after the new time began, and its stamp is far ahead of that. It must
    not be taken for a message of the new time. Stamps are in ns, and a stream is what one process sends on one key.
    """

    def __init__(self) -> None:
        self._may_be_heard = False
        """Whether messages have to be looked at at all."""
        self._limit = 0
        """The middle between the old time and the new one: stamps beyond are of the old time."""
        self._begun: set[str] = set()
        """The streams on which something of the new time has come. What a process sent before came before."""

    def jump(self, old: int, new: int) -> None:
        """Time jumped back from `old` to `new`."""
        self._may_be_heard, self._limit = True, (old + new) // 2
        self._begun.clear()

    def has(self, stream: str, find_stamp: Callable[[], int], now: int) -> bool:
        """Whether a message that comes at time `now` was sent before the jump; a stamp of 0 does not tell."""
        if not self._may_be_heard or stream in self._begun:
            return False
        if now > self._limit:
            # What comes so late is of the new time.
            self._may_be_heard = False
            return False
        stamp = find_stamp()
        if 0 < stamp <= self._limit:
            self._begun.add(stream)
        return stamp > self._limit
