"""Latched keys, the same over Zenoh and in memory (whatever comes and goes: test_subscription_properties.py)."""

import pytest

from support.transports import Inbox, Sessions, wait_until_true
from zteam.bus import Bus
from zteam.messages import Done


def ticks(bus: Bus, key_expr: str, latched: bool = True) -> Inbox:
    """Collects the keys and ticks of Done messages."""
    inbox = Inbox()
    bus.subscribe(key_expr, Done, lambda key, message: inbox(key, message.tick), latched=latched)
    return inbox


def test_late_subscribers_get_the_last_message(sessions: Sessions) -> None:
    """Not those before it, and then what follows, once each: on the same key expression and on others, of other
    sessions and of the publisher's own; those that are closed get nothing more."""
    # Of a bridge, the second and the fourth session are on one side.
    sender, listener, _, witness = (sessions() for _ in range(4))
    publisher, heard, closed = sender.publisher("a", Done, latched=True), ticks(witness, "a"), Inbox()
    for tick in (1, 2):
        publisher.put(Done(tick=tick))
    heard.wait_for(("a", 2))
    for _ in range(3):
        listener.subscribe("a", Done, lambda _, message: closed(message.tick), latched=True).close()
    inboxes = [ticks(*reader) for reader in ((sender, "a"), (listener, "a"), (listener, "*"), (listener, "**"))]
    for inbox in inboxes:
        assert inbox.wait_for(("a", 2)) == [("a", 2)]
    late, before, raw = ticks(listener, "a"), closed.items, Inbox()
    assert late.wait_for(("a", 2)) == [("a", 2)]
    listener.subscribe_raw("a", lambda sample: raw(sample.source, sample.timestamp > 0), latched=True)
    assert raw.wait_count(1) == [(sender.instance, True)]
    publisher.put(Done(tick=3))
    for inbox in (*inboxes, late):
        assert inbox.wait_for(("a", 3)) == [("a", 2), ("a", 3)]
    assert closed.items == before


def test_what_waits_for_latched_messages_comes_after_them(sessions: Sessions) -> None:
    """Also if a handler asks for it, and if there are none; what is called may publish."""
    # Of a bridge, the first session is on one side, the second and the fourth are on the other.
    listener, sender, _, witness = (sessions() for _ in range(4))
    heard, inbox, keys = ticks(witness, "**"), Inbox(), [f"a/{number}" for number in range(10)]
    for key in keys:
        sender.publisher(key, Done, latched=True).put(Done())
        heard.wait_for((key, 0))
    begin, end = (bus.publisher(key, Done, latched=True) for bus, key in ((sender, "begin"), (listener, "end")))

    def read(*_: object) -> None:
        for key in keys:
            listener.subscribe(key, Done, lambda key, _: inbox(key), latched=True)
        listener.transport.when_caught_up(lambda: (inbox("all"), end.put(Done())))

    listener.subscribe("begin", Done, read, latched=True)
    sender.subscribe("none", Done, inbox, latched=True)
    sender.transport.when_caught_up(lambda: begin.put(Done()))
    heard.wait_for(("end", 0))
    assert (sorted(inbox.items[:-1]), inbox.items[-1]) == (keys, "all")


def test_a_wildcard_gets_the_last_message_of_each_key(sessions: Sessions) -> None:
    """One message a key."""
    sender, listener, _, witness = (sessions() for _ in range(4))
    heard = ticks(witness, "**")
    for number, key in enumerate(("a/x", "a/y", "b/x")):
        publisher = sender.publisher(key, Done, latched=True)
        publisher.put(Done(tick=number))
        publisher.put(Done(tick=10 + number))
    heard.wait_for(("b/x", 12))
    assert sorted(ticks(listener, "a/*").wait_count(2)) == [("a/x", 10), ("a/y", 11)]


def test_the_newer_of_two_writers_counts(sessions: Sessions) -> None:
    """Whatever the order of their declarations, the message that a late subscriber gets last is the newest one."""
    first, second, listener = sessions(), sessions(), sessions()
    heard = ticks(listener, "a")
    early, late = first.publisher("a", Done, latched=True), second.publisher("a", Done, latched=True)
    late.put(Done(tick=1))
    heard.wait_for(("a", 1))
    early.put(Done(tick=2))
    heard.wait_for(("a", 2))
    inbox = ticks(listener, "a")
    inbox.wait_for(("a", 2))
    late.put(Done(tick=3))
    assert inbox.wait_for(("a", 3))[-2:] == [("a", 2), ("a", 3)]


def test_without_latching_there_is_no_history(sessions: Sessions) -> None:
    """A plain subscriber of a latched key, and a latched subscriber of a plain one, get what is put from then on."""
    sender, listener, _, witness = (sessions() for _ in range(4))
    heard = ticks(witness, "*")
    latched, plain = sender.publisher("a", Done, latched=True), sender.publisher("b", Done)
    while not plain.has_subscribers:
        latched.put(Done(tick=0))
    plain.put(Done(tick=1))
    latched.put(Done(tick=2))
    heard.wait_for(("a", 2))
    inboxes = ticks(listener, "a", latched=False), ticks(listener, "*")
    inboxes[1].wait_for(("a", 2))
    latched.put(Done(tick=3))
    assert [inbox.wait_for(("a", 3)) for inbox in inboxes] == [[("a", 3)], [("a", 2), ("a", 3)]]


@pytest.mark.parametrize("closes_session", [False, True])
def test_what_is_closed_leaves_no_history(sessions: Sessions, closes_session: bool) -> None:
    """Of a closed publisher or session late subscribers get nothing, nor of a message that is put after the close: not
    even where another subscriber of their session has had its last message."""
    sender, other, listener = sessions(), sessions(), sessions()
    heard = ticks(listener, "*")
    publisher, kept = sender.publisher("a", Done, latched=True), other.publisher("b", Done, latched=True)
    publisher.put(Done(tick=1))
    heard.wait_for(("a", 1))
    (sender if closes_session else publisher).close()
    publisher.put(Done(tick=2))
    assert not publisher.has_subscribers
    kept.put(Done(tick=3))
    heard.wait_for(("b", 3))
    # A session's end may take a moment.
    wait_until_true(lambda: ticks(listener, "*").wait_for(("b", 3)) == [("b", 3)])
    late = ticks(listener, "**")
    assert late.wait_for(("b", 3)) == [("b", 3)]
    other.publisher("a", Done, latched=True).put(Done(tick=5))
    assert late.wait_for(("a", 5)) == [("b", 3), ("a", 5)]
