"""When a message counts in lock-step, so that chance has no part in it. Without a bus.

What the simulator sends in a tick is handled in that tick, before the step. What another process sends counts from the
tick after the one in which it was sent, whatever order messages come in: its stamp tells that tick. A message without
the stamp of a tick was sent in the tick that is open when it comes. Nothing is handled between a node's answer and its
next tick: what it publishes then could come before that tick or after it.
"""

from collections import Counter
from collections.abc import Callable, Set
from itertools import count, groupby
from typing import Any, NamedTuple

from zteam import names
from zteam.bus.transport import matches
from zteam.clock import to_ns
from zteam.errors import UsageError
from zteam.messages import Message, TFMessage, Tick, encode, ns_from_time
from zteam.messages.geometry_msgs import bases_stamp
from zteam.messages.topics import is_measured
from zteam.node.screen import FROM_TICK

MAX_AHEAD = to_ns(10.0)
"""A stamp that is farther ahead of the open tick is of another clock: as far as the aggregator takes transforms."""
MOST, MOST_OF_KEY = 10_000, 1000
"""Messages that are kept, of all keys and of one; the world may stand still while others send."""

Handle = Callable[[str, Any, int], None]
"""Takes the key, the message, and the stamp (ns) of the tick in which it was sent; 0 for messages of their tick."""


def stamp_of(message: Message) -> int:
    """The stamp in the header of a message in ns; 0 without a header."""
    header = getattr(message, "header", None)
    return 0 if header is None else ns_from_time(header.stamp)


def tick_of(message: Message, open_stamp: int) -> int:
    """The stamp (ns) of the tick in which a message was sent that comes while the tick of `open_stamp` is open.

    A message of the coming tick may overtake that tick itself. A stamp of an earlier tick does not tell whether the
    message was sent in it: it is late, and counts as sent in the open tick.
    """
    stamp = stamp_of(message)
    return stamp if open_stamp < stamp <= open_stamp + MAX_AHEAD else open_stamp


def precedence(message: Message) -> tuple[int, bytes]:
    """Which message comes first of several that different senders sent in one tick, on one key: by the newest stamp,
    else by content. Neither arrival nor the sessions' ids decide: both differ from run to run."""
    return -stamp_of(message), encode(message)


class HeldMessage(NamedTuple):
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
    newest_only: bool = False
    """Whether it replaces the one before of the same tick, sender and key."""
    latched: bool = False


_Place = tuple[bool, int, str, int, str, int]
"""Where a kept message stands among the others: whether it belongs to the tick in which it is handled, else the stamp
(ns) of the tick in which another process sent it, its key, the subscription, the sender, and a number."""


class TickMessages:
    """The messages that a process will handle in a later tick. Stamps are in ns."""

    def __init__(self) -> None:
        self._numbers = count(1)
        self._kept: dict[_Place, HeldMessage] = {}
        self._ticks: dict[tuple[str, str], int] = {}
        """The newest tick of what other processes sent, by sender and key."""
        self._count = Counter[str]()
        """Of what is kept, by key."""
        self._newest: dict[tuple[int, str], int] = {}
        """Stamp of the simulator's newest message, by subscription and key."""
        self._heard = 0
        """The newest stamp of the simulator's data, whose tick may be on its way."""

    def take(self, arrival: HeldMessage, stamp: int, *, is_open: bool) -> str:
        """A message has come; why it is dropped, empty if it is not.

        `stamp` is that of the newest tick, and `is_open` says whether the process has still to answer it.
        """
        key, due, sender = arrival.key, arrival.due or 0, (arrival.source, arrival.key)
        if not arrival.is_data and arrival.due is None:
            # What a sender sent later on a key is handled later.
            # What a tick carries is of the tick before, whatever its sender's clock says.
            is_carried = arrival.source == FROM_TICK
            sent = stamp if is_carried else tick_of(arrival.message, max(stamp, self._heard))
            tick = max(sent, self._ticks.get(sender, 0))
            number = 0 if arrival.newest_only else next(self._numbers)
            place = False, tick, key, arrival.subscription, arrival.source, number
        elif arrival.is_data and self._is_repeated(arrival, stamp):
            return ""
        elif is_open and due <= stamp:
            arrival.handle(key, arrival.message, 0)
            return ""
        elif due > stamp + MAX_AHEAD:
            return "its stamp is far ahead of the open tick"
        else:
            # Of the coming tick, or too late for this one.
            place = True, 0, "", 0, "", next(self._numbers)
        if place not in self._kept:
            # One key does not keep out the others.
            if self._count[key] >= MOST_OF_KEY:
                return f"{MOST_OF_KEY} messages of this key wait for the next tick already"
            if len(self._kept) >= MOST:
                return f"{MOST} messages wait for the next tick already"
            self._count[key] += 1
        if not place[0]:
            self._ticks[sender] = place[1]
        self._kept[place] = arrival
        return ""

    def _is_repeated(self, arrival: HeldMessage, open_stamp: int) -> bool:
        """Whether it has come before: a tick that is not answered is sent again with its data."""
        stamp, place = stamp_of(arrival.message), (arrival.subscription, arrival.key)
        # The sender chooses the id of its session. So what it sends on its own keys delays no other's messages.
        if is_measured(arrival.key):
            self.hear(stamp, open_stamp)
        known, self._newest[place] = self._newest.get(place, 0), stamp
        return known == stamp > 0

    def hear(self, stamp: int, open_stamp: int) -> None:
        """The simulator's data of `stamp` has come, whose tick may be on its way."""
        if stamp <= open_stamp + MAX_AHEAD:
            self._heard = max(self._heard, stamp)

    def forget_others(self) -> None:
        """Forget what other processes have sent, but for what is latched."""
        self._kept = {place: arrival for place, arrival in self._kept.items() if place[0] or arrival.latched}
        self._count = Counter(arrival.key for arrival in self._kept.values())

    def handle_due(self, stamp: int | None, sessions: Set[str] | None = None) -> None:
        """Handle what is due in the tick of `stamp`; everything with None, when there are no ticks any more.

        With `sessions`, what others than these have sent is dropped: their process has left in the tick in which it
        sent it, and chance says what had come of that.

        First what other processes sent before, by tick and key, then what belongs to this tick, in the order in which
        it came. Of several senders of one key, the one that counts (`precedence`) comes last.
        """
        if stamp is not None:
            # The data of the next tick does not come before this one is answered.
            self._heard = min(self._heard, stamp)
        if not self._kept:
            return
        due = sorted(
            place
            for place, arrival in self._kept.items()
            if stamp is None or ((arrival.due or 0) <= stamp if place[0] else place[1] < stamp)
        )
        # Those of all senders of a subscription together.
        for (is_of_tick, tick, _key, _subscription), group in groupby(due, lambda place: place[:4]):
            arrivals = [self._kept.pop(place) for place in group]
            if sessions is not None and not is_of_tick:
                arrivals = [arrival for arrival in arrivals if arrival.source in sessions]
            for arrival in arrivals if is_of_tick or len(arrivals) == 1 else _in_order(arrivals):
                arrival.handle(arrival.key, arrival.message, tick)
        self._count = Counter(arrival.key for arrival in self._kept.values())
        self._ticks = {(source, key): tick for later, tick, key, _, source, _ in sorted(self._kept) if not later}


def _in_order(group: list[HeldMessage]) -> list[HeldMessage]:
    """The messages of one key and tick: those of one sender in the order in which they came."""
    by_source: dict[str, list[HeldMessage]] = {}
    for arrival in group:
        by_source.setdefault(arrival.source, []).append(arrival)
    if len(by_source) == 1:
        return group
    told = sorted(by_source.values(), key=lambda mine: [precedence(arrival.message) for arrival in mine[::-1]])
    return [arrival for mine in told[::-1] for arrival in mine]


def stamp_of_tick(message: Any) -> int:
    """The stamp (ns) of a message with a header, or of the bases in one of `tf`: in lock-step that of its tick."""
    return bases_stamp(message) if isinstance(message, TFMessage) else ns_from_time(message.header.stamp)


class TickInputs:
    """The keys that are declared with `every_tick`, and what else a node needs of each tick."""

    def __init__(self) -> None:
        self._keys: list[str] = []
        self._needs: list[Callable[[Tick], list[str]]] = []
        self._stamps: dict[str, int] = {}
        """Of the newest message, by key."""

    def declare(self, key_expr: str, message_type: type[Message]) -> None:
        """Each tick needs a message of this key. Raises UsageError for a type whose tick cannot be told."""
        if "header" not in message_type.__struct_fields__ and message_type is not TFMessage:
            raise UsageError(f"{key_expr}: {message_type.__name__} has no header, so its tick cannot be told")
        self._keys.append(key_expr)
        self.need(lambda tick: self._not_come(key_expr, tick))

    def need(self, lacks: Callable[[Tick], list[str]]) -> None:
        """Each tick needs what `lacks(tick)` names."""
        self._needs.append(lacks)

    def take(self, key: str, stamp: int) -> None:
        """A message of this stamp (ns) has come."""
        self._stamps[key] = stamp

    def forget(self) -> None:
        """Time jumped back."""
        self._stamps.clear()

    def declared_without(self, key: str) -> str:
        """The key expression with `key` that is declared with `every_tick`, if nothing has come on it; else empty."""
        heard = self._stamps
        found = (each for each in self._keys if matches(each, key) and not any(matches(each, had) for had in heard))
        return next(found, "")

    def lacking(self, tick: Tick | None) -> list[str]:
        """The keys whose message of the tick has not come; without a tick, those declared on which nothing has come."""
        if tick is None:
            return [key for key in self._keys if not any(matches(key, heard) for heard in self._stamps)]
        return [key for lacks in self._needs for key in lacks(tick)]

    def _not_come(self, key_expr: str, tick: Tick) -> list[str]:
        """The key, or that key of each robot, whose message of the tick has not come."""
        if key_expr == names.TF and names.AGGREGATOR not in tick.participants:
            # Nothing sends the transforms of this tick.
            return []
        keys = [key_expr]
        if key_expr.startswith(names.all_robots_key("")):
            keys = [names.robot_key(robot_id, key_expr.partition("/")[2]) for robot_id in tick.robots.tolist()]
        stamp = ns_from_time(tick.stamp)
        return [key for key in keys if self._stamps.get(key, -1) < stamp]
