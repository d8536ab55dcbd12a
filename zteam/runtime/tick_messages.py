"""When a user's own node of lock-step handles a message, so that chance has no part in it. Without a bus.

What the simulator sends in a tick is handled in that tick, before the node's step. What other processes send in a tick
is handled at the beginning of the next one. Nothing is handled between the node's answer and its next tick: what it
publishes then could come before that tick or after it.
"""

from collections.abc import Callable
from itertools import groupby
from operator import attrgetter
from typing import Any, NamedTuple

from zteam.messages import Message
from zteam.runtime.sending_tick import precedence, stamp_of, tick_of

MOST = 10_000
"""Messages that are kept; the world may stand still while others send."""

Handle = Callable[[str, Any], None]


class Arrival(NamedTuple):
    """A message that has come."""

    subscription: int
    key: str
    message: Message
    source: str
    """The sender's session."""
    is_data: bool
    """Whether the simulator sent it."""
    due: int | None
    """The stamp (ns) of its tick if the node's step waits for it."""
    handle: Handle


class _Sent(NamedTuple):
    """What another process than the simulator has sent."""

    tick: int
    """The stamp (ns) of the tick in which it was sent."""
    arrival: Arrival


class TickMessages:
    """The messages that a node will handle in a later tick. Stamps are in ns."""

    def __init__(self) -> None:
        self._of_ticks: list[Arrival] = []
        """What belongs to a tick that has not come."""
        self._sent: list[_Sent] = []
        self._ticks: dict[tuple[str, str], int] = {}
        """The newest tick of `_sent`, by sender and key."""
        self._newest: dict[tuple[int, str], int] = {}
        """Stamp of the simulator's newest message, by subscription and key."""
        self._heard = 0
        """The newest stamp of the simulator's data, whose tick may be on its way."""

    def take(self, arrival: Arrival, stamp: int, *, is_open: bool) -> str:
        """A message has come; why it is dropped, empty if it is not.

        `stamp` is that of the newest tick, and `is_open` says whether the node has still to answer it.
        """
        if arrival.is_data and self._is_repeated(arrival):
            return ""
        belongs = arrival.is_data or arrival.due is not None
        if belongs and is_open and (arrival.due or 0) <= stamp:
            arrival.handle(arrival.key, arrival.message)
        elif len(self._of_ticks) + len(self._sent) >= MOST:
            return f"{MOST} messages wait for the next tick already"
        elif belongs:
            # Of the coming tick, or too late for this one.
            self._of_ticks.append(arrival)
        else:
            self._hold(arrival, stamp)
        return ""

    def _is_repeated(self, arrival: Arrival) -> bool:
        """Whether it has come before: a tick that is not answered is sent again with its data."""
        stamp, place = stamp_of(arrival.message), (arrival.subscription, arrival.key)
        self._heard = max(self._heard, stamp)
        known, self._newest[place] = self._newest.get(place, 0), stamp
        return known == stamp > 0

    def _hold(self, arrival: Arrival, stamp: int) -> None:
        sender = arrival.source, arrival.key
        # What a sender sent later on a key is handled later.
        tick = max(tick_of(arrival.message, max(stamp, self._heard)), self._ticks.get(sender, 0))
        self._ticks[sender] = tick
        self._sent.append(_Sent(tick, arrival))

    def handle_due(self, stamp: int | None) -> None:
        """Handle what is due in the tick of `stamp`; everything with None, when there are no ticks any more.

        First what other processes sent before, by tick and key, then what belongs to this tick, in the order in which
        it came. Of several senders of one key, the one that counts (`precedence`) comes last.
        """
        if not (self._of_ticks or self._sent):
            return
        due = [entry for entry in self._of_ticks if stamp is None or (entry.due or 0) <= stamp]
        sent = [entry for entry in self._sent if stamp is None or entry.tick < stamp]
        self._of_ticks = [entry for entry in self._of_ticks if stamp is not None and (entry.due or 0) > stamp]
        self._sent = [entry for entry in self._sent if stamp is not None and entry.tick >= stamp]
        place = attrgetter("tick", "arrival.key", "arrival.subscription")
        for _, group in groupby(sorted(sent, key=place), place):
            for arrival in _in_order([entry.arrival for entry in group]):
                arrival.handle(arrival.key, arrival.message)
        for arrival in due:
            arrival.handle(arrival.key, arrival.message)

    def forget(self) -> None:
        """Time jumped back."""
        self._of_ticks, self._sent = [], []
        self._ticks.clear()
        self._newest.clear()
        self._heard = 0


def _in_order(group: list[Arrival]) -> list[Arrival]:
    """The messages of one key and tick: those of one sender in the order in which they came."""
    by_source: dict[str, list[Arrival]] = {}
    for arrival in group:
        by_source.setdefault(arrival.source, []).append(arrival)
    if len(by_source) == 1:
        return group
    told = sorted(by_source.values(), key=lambda mine: [precedence(arrival.message) for arrival in mine[::-1]])
    return [arrival for mine in told[::-1] for arrival in mine]
