"""Latched subscriptions that readers of one session share."""

import threading
from collections.abc import Callable
from typing import Any

import pytest

from support.limits import LIMIT
from support.transports import Inbox
from zteam.bus.latched import LatchedSubscriptions
from zteam.bus.transport import Handle, RawSample

WRITER = ("map", "f1", "7")
TOKEN = "map/@adv/pub/f1/7/_"


class Desk:
    """Latched subscriptions without a bus: what is asked, and what is open."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, Callable[[RawSample], object]]] = []
        self._ends: list[Callable[[], object]] = []
        self.looks: list[tuple[Callable[[str], object], Callable[[], object]]] = []
        """What each look for publishers calls with those that it finds, and after the last."""
        self.open: dict[str, Any] = {}
        self.all = LatchedSubscriptions("own", self._declare, lambda _, *look: self.looks.append(look), self._ask)

    def _ask(self, token: str, take: Callable[[RawSample], object], done: Callable[[], object]) -> None:
        self.asked.append((token, take))
        self._ends.append(done)

    def _declare(self, key_expr: str, _from_others: bool, subscription: Any) -> Handle:
        self.open[key_expr] = subscription
        return Handle(lambda: self.open.pop(key_expr))

    def read(self) -> Inbox:
        """A reader of `map`, and what it gets."""
        inbox = Inbox()
        inbox.handle = self.all.subscribe("map", lambda sample: inbox(sample.timestamp))
        return inbox

    def answer(self, timestamp: int) -> None:
        """The publisher answers the oldest question."""
        _, take = self.asked.pop(0)
        take(RawSample("other", b"", "", timestamp + 1, "f2"))
        take(sample(timestamp))
        self._ends.pop(0)()


def sample(timestamp: int) -> RawSample:
    """A message of the publisher."""
    return RawSample("map", bytes(10), "", timestamp, "f1")


def test_all_readers_share_one_question() -> None:
    """A publisher is asked once, however many readers there are, and once for each that comes later."""
    desk = Desk()
    early = [desk.read() for _ in range(3)]
    desk.open["map"].on_token(TOKEN, True)
    assert [token for token, _ in desk.asked] == [TOKEN]
    desk.answer(5)
    late = desk.read()
    assert [token for token, _ in desk.asked] == [TOKEN]
    desk.answer(5)
    assert [inbox.items for inbox in (*early, late)] == [[5]] * 4


def test_all_that_were_there_are_waited_for() -> None:
    """Those of each subscription once, also of one that is new meanwhile; a further reader has a question of its own.
    The bus looks for publishers only where there is a subscription and something waits for it."""
    desk, caught_up = Desk(), Inbox()
    desk.all.when_caught_up(lambda: caught_up("none"))
    desk.read()
    desk.open["map"].on_token(TOKEN, True)
    assert (caught_up.items, desk.looks) == (["none"], [])
    desk.all.when_caught_up(lambda: caught_up("first"))
    found, done = desk.looks.pop()
    found(TOKEN)
    found("map/@adv/pub/f1/8/_")
    desk.answer(5)
    done()
    desk.all.subscribe("plan", print)
    desk.answer(6)
    found, done = desk.looks.pop()
    found("plan/@adv/pub/f1/9/_")
    done()
    assert (caught_up.items, len(desk.asked)) == (["none"], 1)
    desk.answer(7)
    desk.read()
    desk.all.when_caught_up(lambda: caught_up("second"))
    desk.answer(5)
    assert caught_up.items == ["none", "first"]
    desk.answer(6)
    assert (caught_up.items, desk.looks) == (["none", "first", "second"], [])


def test_own_publishers_may_be_passed_over() -> None:
    """Where only those of others count."""
    desk = Desk()
    desk.all.subscribe("map", print, from_others=True)
    for session in ("own", "f1"):
        desk.open["map"].on_token(f"map/@adv/pub/{session}/7/_", True)
    assert [token for token, _ in desk.asked] == [TOKEN]


def test_those_that_come_later_are_not_waited_for() -> None:
    """There may always be one more."""
    desk, caught_up = Desk(), Inbox()
    desk.read()
    desk.all.when_caught_up(lambda: caught_up(1))
    desk.looks.pop()[1]()
    assert caught_up.items == [1]
    desk.open["map"].on_token(TOKEN, True)
    desk.all.when_caught_up(lambda: caught_up(2))
    desk.open["map"].on_token("map/@adv/pub/f1/8/_", True)
    assert caught_up.items == [1]
    desk.answer(5)
    assert (caught_up.items, len(desk.asked)) == ([1, 2], 1)


def test_the_last_reader_closes_the_subscription() -> None:
    """Not before; and the next reader opens another one."""
    desk = Desk()
    first, second = desk.read(), desk.read()
    desk.open["map"].on_token(TOKEN, True)
    desk.answer(5)
    first.handle.close()
    assert "map" in desk.open
    second.handle.close()
    second.handle.close()
    assert desk.open == {}
    assert desk.read().items == []


def test_a_publisher_that_comes_back_is_asked_again() -> None:
    """A router that is lost takes all publishers away. A reader that comes meanwhile gets the message when they are
    back, and those that had it get nothing."""
    desk = Desk()
    early = desk.read()
    desk.open["map"].on_token(TOKEN, True)
    desk.answer(5)
    desk.open["map"].on_token(TOKEN, False)
    late = desk.read()
    assert late.items == []
    desk.open["map"].on_token(TOKEN, True)
    desk.answer(5)
    assert early.items == late.items == [5]


@pytest.mark.parametrize(
    ("first", "answer", "heard"),
    [(sample(6), 5, [6, 0, 0]), (RawSample("map", b"", "", 10**6, "f1", -3600.0), 6, [10**6, 6, 0, 0])],
    ids=["an older one", "after one that is ahead"],
)
def test_nothing_older_comes_after_something_newer(first: RawSample, answer: int, heard: list[int]) -> None:
    """An answer that comes after a newer message is left out; a message without a time stamp never is. One whose stamp
    is far ahead hides nothing."""
    desk = Desk()
    reader = desk.read()
    desk.open["map"].on_token(TOKEN, True)
    desk.open["map"].receive(first, WRITER)
    desk.answer(answer)
    for _ in range(2):
        desk.open["map"].receive(sample(0), WRITER)
    assert reader.items == heard


def test_publishers_without_number_are_not_asked() -> None:
    """Any program may hold tokens."""
    desk = Desk()
    desk.read()
    for number in range(1000):
        desk.open["map"].on_token(f"map/@adv/pub/f1/{number}/_", True)
    assert 0 < len(desk.asked) < 100


def test_a_message_that_comes_while_another_is_handled_waits() -> None:
    """A handler runs on one thread at a time, which takes what has come meanwhile; no thread waits for it."""
    desk, handled = Desk(), Inbox()
    begun, may_end = threading.Event(), threading.Event()

    def handle(sample: RawSample) -> None:
        begun.set()
        assert may_end.wait(LIMIT)
        handled(sample.timestamp, threading.current_thread().name)

    desk.all.subscribe("map", handle)
    slow = threading.Thread(target=desk.open["map"].receive, args=(sample(1), WRITER), name="slow")
    slow.start()
    assert begun.wait(LIMIT)
    desk.open["map"].receive(sample(2), WRITER)
    assert handled.items == []
    may_end.set()
    slow.join(LIMIT)
    assert handled.items == [(1, "slow"), (2, "slow")]


def test_an_interrupted_handler_is_called_again() -> None:
    """Ctrl+C in a handler, on the thread that subscribes, leaves the reader as it was."""
    desk, handled = Desk(), Inbox()

    def handle(sample: RawSample) -> None:
        if sample.timestamp == 1:
            raise KeyboardInterrupt
        handled(sample.timestamp)

    desk.all.subscribe("map", handle)
    with pytest.raises(KeyboardInterrupt):
        desk.open["map"].receive(sample(1), WRITER)
    desk.open["map"].receive(sample(2), WRITER)
    assert handled.items == [2]
