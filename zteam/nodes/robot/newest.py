"""From which step on a message counts, in real time and in lock-step. Pure: it is told the time.

In real time a message counts at once. In lock-step it counts from the tick after the one in which it was sent, whatever
order messages come in.
"""

from typing import Any

import msgspec

from zteam.messages import Message
from zteam.runtime.tick_messages import precedence, tick_of


class Sent(msgspec.Struct, frozen=True):
    """A message of lock-step that does not count yet."""

    tick: int
    """The stamp (ns) of the tick in which it was sent."""
    source: str
    message: Message


class Newest:
    """The newest message of a key that counts, and those that have come and do not count yet."""

    __slots__ = ("_coming", "message", "stamp")

    def __init__(self) -> None:
        self.message: Any = None
        """None until one counts."""
        self.stamp = 0
        """When it came: in lock-step the tick in which it was sent (ns)."""
        self._coming: list[Sent] = []
        """At most one of each sender and tick."""

    def take(self, message: Message, now: int) -> None:
        """A message has come in real time, at `now` (ns)."""
        self._coming.clear()
        self.message, self.stamp = message, now

    def hold(self, message: Message, open_stamp: int, source: str = "") -> None:
        """A message of the session `source` has come in lock-step, while the tick of `open_stamp` is open.

        Of one sender and tick the last one counts; of several senders the one that comes first by `precedence`.
        """
        if self._coming:
            self.settle(open_stamp)
        tick, coming = tick_of(message, open_stamp), self._coming
        if coming:
            # What a sender sent later was not sent in an earlier tick.
            tick = max([tick, *(sent.tick for sent in coming if sent.source == source)])
            self._coming = [sent for sent in coming if (sent.source, sent.tick) != (source, tick)]
        self._coming.append(Sent(tick, source, message))

    def settle(self, now: int) -> None:
        """Let what was sent before the tick of time `now` (ns) count."""
        coming = self._coming
        if not coming:
            return
        if len(coming) == 1:
            # Mostly there is nothing to choose from.
            sent = coming[0]
            if sent.tick < now:
                self.message, self.stamp, self._coming = sent.message, sent.tick, []
            return
        due = [sent for sent in coming if sent.tick < now]
        if due:
            self.stamp = max(sent.tick for sent in due)
            last = [sent.message for sent in due if sent.tick == self.stamp]
            self.message = last[0] if len(last) == 1 else min(last, key=precedence)
            self._coming = [sent for sent in coming if sent.tick >= now]

    @property
    def is_coming(self) -> bool:
        """Whether a message has come that does not count yet."""
        return bool(self._coming)

    def forget(self) -> None:
        """Time jumped back."""
        self._coming.clear()
        self.message, self.stamp = None, 0
