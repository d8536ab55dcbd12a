"""Messages of a lock-step team in every order in which they may come to one process.

What is sent in tick k comes after the receiver's answer to tick k - 1 and before anything of tick k + 1: each process
answers after it has sent, and one link keeps its order. With the stamp of its tick it may come before what the
simulator sends to this receiver in that tick, else after it; always before or after the tick itself.
"""

from collections.abc import Sequence
from random import Random
from typing import Any, Literal, NamedTuple

from hypothesis import strategies as st

TICK = 100_000_000
"""Nanoseconds."""
FIRST, LAST = 2, 6
"""Ticks in which messages are sent."""
TICKS = range(FIRST - 1, LAST + 5)
"""All ticks."""


class Sent(NamedTuple):
    """A message, whose meaning is left to the test."""

    tick: int
    source: int
    topic: int
    value: int
    stamp: Literal["own", "none", "earlier", "later"]
    """Which tick its header tells: its own, none, the one before, or the one after the next."""

    @property
    def stamp_ns(self) -> int:
        """The stamp in its header."""
        shift = {"own": 0, "earlier": -1, "later": 2}
        return 0 if self.stamp == "none" else TICK * (self.tick + shift[self.stamp])


class Data(NamedTuple):
    """What the simulator sends to the receiver in a tick comes."""

    tick: int


class Opened(NamedTuple):
    """A tick itself comes."""

    tick: int


STAMPED = ("own", "later")
"""The stamps with which a message may come before the data of its tick."""
Event = Sent | Data | Opened


def sent_messages(topics: int, sources: int = 3) -> st.SearchStrategy[list[Sent]]:
    """Messages of several senders, in the order in which each of them sends."""
    stamps: st.SearchStrategy[Literal["own", "none", "earlier", "later"]]
    stamps = st.sampled_from(["own", "none", "earlier", "later"])
    one = st.builds(
        Sent,
        st.integers(FIRST, LAST),
        st.integers(0, sources - 1),
        st.integers(0, topics - 1),
        st.integers(0, 9),
        stamps,
    )
    return st.lists(one, min_size=1, max_size=25).map(lambda found: sorted(found, key=lambda sent: sent.tick))


def orders() -> st.SearchStrategy[list[Random]]:
    """Two sources of orders."""
    return st.lists(st.randoms(use_true_random=False), min_size=2, max_size=2)


def arrive(sent: Sequence[Sent], random: Random, *, early: bool = True) -> list[Event]:
    """The messages in one order in which they may come, with the data and the ticks of TICKS.

    Without `early` all of them come after the data of their tick.
    """
    events: list[Event] = []
    for tick in TICKS:
        queues = [[s for s in sent if s.tick == tick and s.source == source] for source in {s.source for s in sent}]
        milestones: list[Event] = [Data(tick), Opened(tick)]
        has_data = False
        while milestones or any(queues):
            ready = [queue for queue in queues if queue and (has_data or (early and queue[0].stamp in STAMPED))]
            chosen: list[Any] = random.choice([*ready, milestones] if milestones else ready)
            event = chosen.pop(0)
            has_data = has_data or isinstance(event, Data)
            events.append(event)
    return events
