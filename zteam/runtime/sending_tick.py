"""In which tick of lock-step a message was sent, and which of two senders is heard. Pure.

A message counts from the tick after the one in which it was sent, whatever order messages come in: its stamp tells
that tick. A message without the stamp of a tick was sent in the tick that is open when it comes.
"""

from zteam.clock import to_ns
from zteam.messages import Message, encode, ns_from_time

MAX_AHEAD = to_ns(10.0)
"""A stamp that is farther ahead of the open tick is of another clock: as far as the aggregator takes transforms."""


def stamp_of(message: Message) -> int:
    """The stamp in the header of a message in ns; 0 without a header."""
    header = getattr(message, "header", None)
    return 0 if header is None else ns_from_time(header.stamp)


def tick_of(message: Message, open_stamp: int) -> int:
    """The stamp (ns) of the tick in which a message was sent that comes while the tick of `open_stamp` is open.

    A message of the coming tick may overtake that tick itself. A stamp of an earlier tick does not tell whether the
    message was sent in it: it is late, and counts as sent in the open tick.
    """
    header = getattr(message, "header", None)
    if header is None:
        return open_stamp
    # As `stamp_of`: each message of a large team comes through here, once for each listener.
    stamp: int = header.stamp.sec * 1_000_000_000 + header.stamp.nanosec
    return stamp if open_stamp < stamp <= open_stamp + MAX_AHEAD else open_stamp


def precedence(message: Message) -> tuple[int, bytes]:
    """Which message comes first of several that different senders sent in one tick, on one key: the smallest.

    The newest stamp, and else the content, decides: neither the order in which they come nor the sessions' ids, which
    are other ones in each run.
    """
    return -stamp_of(message), encode(message)
