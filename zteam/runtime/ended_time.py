"""Which messages are of a time that has ended: the world was reset, or its simulator started anew. Without a bus.

A process that has not heard of the reset yet goes on for a moment. The aggregator sends its last bundle again, and a
robot its last status. Such a message may come after the new time began, and its stamp is far ahead of that. It must
not be taken for a message of the new time.
"""


class EndedTime:
    """The time before the last jump back. Stamps are in ns, and a stream is what one process sends on one key."""

    def __init__(self) -> None:
        self._limit = 0
        """The middle between the old time and the new one: stamps beyond are of the old time. 0 = look at none."""
        self._begun: set[str] = set()
        """The streams on which something of the new time has come. What a process sent before came before."""

    def jump(self, old: int, new: int) -> None:
        """Time jumped back from `old` to `new`."""
        self._limit = (old + new) // 2
        self._begun.clear()

    def may_have(self, stream: str) -> bool:
        """Whether the next message of this stream has to be looked at."""
        return self._limit > 0 and stream not in self._begun

    def has(self, stream: str, stamp: int, now: int) -> bool:
        """Whether a message that comes at time `now` was sent before the jump; a stamp of 0 does not tell."""
        if stamp == 0 or not self.may_have(stream):
            return False
        if now > self._limit:
            # What comes so late is of the new time.
            self._limit = 0
            return False
        if stamp > self._limit:
            return True
        self._begun.add(stream)
        return False
