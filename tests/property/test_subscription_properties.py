"""Subscriptions of one session that come and go, over a router: their readers miss nothing and get nothing twice."""

from collections.abc import Callable, Iterator
from itertools import count
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from support.examples import examples
from support.transports import Inbox, RouterProcess, Sessions, wait_until_true, zenoh_sessions
from zteam.bus import Bus, NoRequest, Publisher
from zteam.bus.transport import Closeable, matches
from zteam.messages import Done, decode
from zteam.node.node import Node
from zteam.node.shutdown import Stop

ROBOTS, TOPICS = ("robot_0", "robot_1"), ("status", "base_scan", "base_scan_1", "navigation/status")
LATCHED = ("map", "robot_0/plan", "robot_1/plan", "robot_1/navigation/plan")
PLAIN = ("tf", *(f"{robot}/{topic}" for robot in ROBOTS for topic in TOPICS))
END = "end"
WIDE = ("**", "**/plan", "robot_1/**", "*/$*scan$*", "robot_$*/plan", "*/*/*")
FIRST, REST = ("*", "robot_$*", *ROBOTS), ("*", "status", "base_scan$*", "*/status")
EXPRESSIONS = (*WIDE, *(f"{first}/{rest}" for first in FIRST for rest in REST), *LATCHED, *PLAIN)

Take = Callable[[str, Done], None]
READERS: dict[str, Callable[[Bus, Node, str, Take], Closeable]] = {
    "messages": lambda bus, _, key, take: bus.subscribe(key, Done, take),
    "latched messages": lambda bus, _, key, take: bus.subscribe(key, Done, take, latched=True),
    "with source": lambda bus, _, key, take: bus.subscribe_from(key, Done, lambda k, m, _: take(k, m)),
    "bytes": lambda bus, _, key, take: bus.subscribe_raw(
        key, lambda s: take(s.key, decode(Done, s.payload)), only=Done
    ),
    "latched samples": lambda bus, _, key, take: bus.subscribe_raw(
        key, lambda s: take(s.key, decode(Done, s.payload)), latched=True
    ),
    "a node's": lambda _, node, key, take: node.subscribe(key, Done, take),
    "a node's latched": lambda _, node, key, take: node.subscribe(key, Done, take, latched=True),
}


class Open(NamedTuple):
    """A reader comes."""

    key_expr: str
    kind: str


class Close(NamedTuple):
    """One of the readers goes."""

    number: int


class Switch(NamedTuple):
    """The latched publisher of a key goes, or another one comes."""

    key: str


STEPS = st.lists(
    st.one_of(
        st.builds(Open, st.sampled_from(EXPRESSIONS), st.sampled_from(sorted(READERS))),
        st.builds(Close, st.integers(0, 99)),
        st.builds(Switch, st.sampled_from(LATCHED)),
    ),
    min_size=20,
    max_size=40,
)


class Desk:
    """A session that publishes on all keys, and one whose readers come and go."""

    def __init__(self, sessions: Sessions) -> None:
        self.sender, self.bus, witness = (sessions() for _ in range(3))
        self.node = Node("reading", self.bus, Stop())
        self.plain = {key: self.sender.publisher(key, Done) for key in (*PLAIN, END)}
        self.latched: dict[str, Publisher[Done]] = {}
        self.said: dict[str, int] = {}
        """The last message of each latched publisher that is there."""
        self.readers: list[tuple[str, Inbox, Closeable]] = []
        self.numbers, self.end = count(1), Inbox()
        self.sender.serve("sender/sync", NoRequest, lambda _: NoRequest())
        self.bus.subscribe(END, Done, lambda _, message: self.end(message.tick))
        # So that publishers send in any case: whether they know of the readers is another question.
        witness.subscribe_raw("**", lambda _: None)
        wait_until_true(lambda: all(publisher.has_subscribers for publisher in self.plain.values()))

    def take(self, step: Open | Close | Switch) -> None:
        """Make a change, and check all that comes of it and after it."""
        if isinstance(step, Open):
            self.open(step)
        elif isinstance(step, Close) and self.readers:
            self.readers.pop(step.number % len(self.readers))[-1].close()
        elif isinstance(step, Switch):
            self.switch(step.key)
        # Behind the declaration, and back behind what it brings.
        self.bus.query("sender/sync", NoRequest)
        self.say()

    def open(self, step: Open) -> None:
        inbox = Inbox()

        def take(key: str, message: Done) -> None:
            if key != END:
                inbox(key, message.tick)

        handle = READERS[step.kind](self.bus, self.node, step.key_expr, take)
        self.readers.append((step.key_expr, inbox, handle))
        kept = [each for each in self.said.items() if "latched" in step.kind and matches(step.key_expr, each[0])]
        assert sorted(inbox.wait_count(len(kept))) == sorted(kept), step

    def switch(self, key: str) -> None:
        if key in self.latched:
            self.latched.pop(key).close()
            self.said.pop(key)
        else:
            self.latched[key] = self.sender.publisher(key, Done, latched=True)

    def say(self) -> None:
        """Each publisher sends a message: each reader gets those of its keys, once."""
        tick, before = next(self.numbers), [len(inbox.items) for _, inbox, _ in self.readers]
        for publisher in (*self.latched.values(), *self.plain.values()):
            publisher.put(Done(tick=tick))
        self.said = dict.fromkeys(self.latched, tick)
        self.end.wait_for(tick)
        for (key_expr, inbox, _), had in zip(self.readers, before, strict=True):
            due = [(key, tick) for key in (*self.latched, *PLAIN) if matches(key_expr, key)]
            assert sorted(inbox.items[had:]) == sorted(due), key_expr


@pytest.fixture(scope="module")
def router() -> Iterator[RouterProcess]:
    """One router for all examples."""
    process = RouterProcess()
    yield process
    process.kill()


@examples(100)
@given(STEPS)
def test_readers_miss_nothing_whatever_comes_and_goes(
    router: RouterProcess, steps: list[Open | Close | Switch]
) -> None:
    """After each change each reader gets every message on its keys once, whatever its kind; a latched one has had the
    last message of each publisher that is there, and of no other."""
    with zenoh_sessions(router.endpoint) as sessions:
        desk = Desk(sessions)
        for step in steps:
            desk.take(step)
