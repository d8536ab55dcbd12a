"""Latched keys, the same over Zenoh and in memory."""

from functools import partial

import pytest

from support.transports import Inbox, Sessions, wait_until_true
from zteam.bus import Bus
from zteam.messages import Done


def ticks(bus: Bus, key_expr: str, latched: bool = True) -> Inbox:
    """Collects the keys and ticks of Done messages."""
    inbox = Inbox()
    bus.subscribe(key_expr, Done, lambda key, message: inbox(key, message.tick), latched=latched)
    return inbox


def three(sessions: Sessions) -> tuple[Bus, Bus, Bus]:
    """A sender, a listener, and a witness: what it has heard, the listener could have heard."""
    # Of a bridge, the second and the fourth session are on one side.
    sender, listener, _, witness = (sessions() for _ in range(4))
    return sender, listener, witness


def test_a_late_subscriber_gets_the_last_message(sessions: Sessions) -> None:
    """Not those before it; and then what follows."""
    sender, listener, witness = three(sessions)
    publisher, heard = sender.publisher("a", Done, latched=True), ticks(witness, "a")
    for tick in (1, 2, 3):
        publisher.put(Done(tick=tick))
    heard.wait_for(("a", 3))
    inbox = ticks(listener, "a")
    assert inbox.wait_for(("a", 3)) == [("a", 3)]
    publisher.put(Done(tick=4))
    assert inbox.wait_for(("a", 4)) == [("a", 3), ("a", 4)]


def test_late_subscribers_beside_others_get_the_last_message(sessions: Sessions) -> None:
    """One session has several, on the same key expression and on others: each gets the last message once, and then what
    follows; those that are closed get nothing more."""
    sender, listener, witness = three(sessions)
    publisher, heard = sender.publisher("a", Done, latched=True), ticks(witness, "a")
    publisher.put(Done(tick=1))
    heard.wait_for(("a", 1))
    closed = Inbox()
    for _ in range(3):
        listener.subscribe("a", Done, lambda _, message: closed(message.tick), latched=True).close()
    inboxes = [ticks(listener, "a"), ticks(listener, "*"), ticks(listener, "**")]
    for inbox in inboxes:
        assert inbox.wait_for(("a", 1)) == [("a", 1)]
    late, before = ticks(listener, "a"), closed.items
    assert late.wait_for(("a", 1)) == [("a", 1)]
    publisher.put(Done(tick=2))
    for inbox in (*inboxes, late):
        assert inbox.wait_for(("a", 2)) == [("a", 1), ("a", 2)]
    assert closed.items == before


def test_plain_and_latched_subscribers_stand_side_by_side(sessions: Sessions) -> None:
    """Whichever of one session's on a key is closed, the others go on."""
    sender, listener, witness = three(sessions)
    publisher, heard = sender.publisher("a/b", Done, latched=True), ticks(witness, "a/b")
    publisher.put(Done(tick=0))
    heard.wait_for(("a/b", 0))
    inboxes, handles = [Inbox() for _ in range(4)], []
    for inbox, (key_expr, latched) in zip(
        inboxes, [("a/b", True), ("a/b", False), ("a/*", True), ("**", False)], strict=True
    ):
        take = partial(_take, inbox)
        handles.append(listener.subscribe(key_expr, Done, take, latched=latched))
    for inbox in inboxes[::2]:
        inbox.wait_for(0)
    end = sender.publisher("a/b", Done)
    wait_until_true(lambda: end.has_subscribers)
    for tick in range(1, 5):
        publisher.put(Done(tick=tick))
        for inbox in inboxes[tick - 1 :]:
            inbox.wait_for(tick)
        handles[tick - 1].close()
    assert [inbox.items for inbox in inboxes] == [[0, 1], [1, 2], [0, 1, 2, 3], [1, 2, 3, 4]]


def _take(inbox: Inbox, _key: str, message: Done) -> None:
    inbox(message.tick)


def test_a_late_subscriber_of_the_same_session_gets_the_last_message(sessions: Sessions) -> None:
    """A process may read what it has published itself."""
    bus = sessions()
    bus.publisher("a", Done, latched=True).put(Done(tick=1))
    assert ticks(bus, "a").wait_for(("a", 1)) == [("a", 1)]


def test_an_early_subscriber_gets_each_message_once(sessions: Sessions) -> None:
    """What it heard live is not told again as history."""
    sender, listener = sessions(), sessions()
    inbox = ticks(listener, "a")
    publisher = sender.publisher("a", Done, latched=True)
    publisher.put(Done(tick=1))
    inbox.wait_for(("a", 1))
    publisher.put(Done(tick=2))
    assert inbox.wait_for(("a", 2)) == [("a", 1), ("a", 2)]


def test_a_wildcard_gets_the_last_message_of_each_key(sessions: Sessions) -> None:
    """One message a key."""
    sender, listener, witness = three(sessions)
    heard = ticks(witness, "**")
    for number, key in enumerate(("a/x", "a/y", "b/x")):
        publisher = sender.publisher(key, Done, latched=True)
        publisher.put(Done(tick=number))
        publisher.put(Done(tick=10 + number))
    heard.wait_for(("b/x", 12))
    inbox = ticks(listener, "a/*")
    assert sorted(inbox.wait_count(2)) == [("a/x", 10), ("a/y", 11)]


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


def test_a_plain_subscriber_gets_no_history(sessions: Sessions) -> None:
    """Only what is put from then on."""
    sender, listener, witness = three(sessions)
    heard = ticks(witness, "a")
    publisher, mark = sender.publisher("a", Done, latched=True), sender.publisher("b", Done, latched=True)
    publisher.put(Done(tick=1))
    mark.put(Done(tick=1))
    # Routed before the next session subscribes.
    heard.wait_for(("a", 1))
    plain = ticks(listener, "a", latched=False)
    ticks(listener, "b").wait_for(("b", 1))
    publisher.put(Done(tick=2))
    assert plain.wait_for(("a", 2)) == [("a", 2)]


def test_a_plain_publisher_leaves_no_history(sessions: Sessions) -> None:
    """A latched subscriber hears it live only."""
    sender, listener = sessions(), sessions()
    heard = ticks(listener, "a")
    plain, kept = sender.publisher("a", Done), sender.publisher("b", Done, latched=True)
    while not plain.has_subscribers:
        kept.put(Done(tick=0))
    plain.put(Done(tick=1))
    heard.wait_for(("a", 1))
    kept.put(Done(tick=2))
    inbox = ticks(listener, "*")
    inbox.wait_for(("b", 2))
    kept.put(Done(tick=3))
    assert {key for key, _ in inbox.wait_for(("b", 3))} == {"b"}


def _expect_only_b(sender: Bus, listener: Bus) -> None:
    """A late subscriber of all keys gets the message on `b` and none on `a`."""
    kept = sender.publisher("b", Done, latched=True)
    kept.put(Done(tick=1))
    inbox = ticks(listener, "*")
    inbox.wait_for(("b", 1))
    kept.put(Done(tick=2))
    assert {key for key, _ in inbox.wait_for(("b", 2))} == {"b"}


def test_a_closed_publisher_leaves_no_history(sessions: Sessions) -> None:
    """Late subscribers get nothing of it, nor of a message that is put after the close."""
    sender, listener = sessions(), sessions()
    heard = ticks(listener, "a")
    publisher = sender.publisher("a", Done, latched=True)
    publisher.put(Done(tick=1))
    heard.wait_for(("a", 1))
    publisher.close()
    publisher.put(Done(tick=2))
    assert not publisher.has_subscribers
    _expect_only_b(sender, listener)
    assert heard.items == [("a", 1)]


def test_a_late_subscriber_gets_nothing_of_a_closed_publisher_that_its_session_has_heard(sessions: Sessions) -> None:
    """The last message dies with its writer, also where another subscriber of the session has had it."""
    sender, listener = sessions(), sessions()
    heard = ticks(listener, "*")
    publisher = sender.publisher("a", Done, latched=True)
    publisher.put(Done(tick=1))
    heard.wait_for(("a", 1))
    publisher.close()
    kept = sender.publisher("b", Done, latched=True)
    kept.put(Done(tick=2))
    heard.wait_for(("b", 2))
    late = ticks(listener, "*")
    kept.put(Done(tick=3))
    assert late.wait_for(("b", 3)) == [("b", 2), ("b", 3)]
    again = sender.publisher("a", Done, latched=True)
    again.put(Done(tick=4))
    assert late.wait_for(("a", 4)) == [("b", 2), ("b", 3), ("a", 4)]


@pytest.mark.parametrize("sessions", ["memory", "zenoh"], indirect=True)
def test_a_late_subscriber_gets_two_writers_messages_in_their_order(sessions: Sessions) -> None:
    """Where its session has both it gets them at once, the newer one last, though it takes every sample."""
    first, second, listener = sessions(), sessions(), sessions()
    heard = Inbox()
    listener.subscribe_raw("a", lambda sample: heard(sample.source), latched=True)
    writers = [session.publisher("a", Done, latched=True) for session in (first, second)]
    for count, number in enumerate((0, 1, 0), 1):
        writers[number].put(Done())
        heard.wait_count(count)
    late = Inbox()
    listener.subscribe_raw("a", lambda sample: late(sample.source), latched=True)
    assert late.items == [second.instance, first.instance]


def test_a_closed_session_leaves_no_history(sessions: Sessions) -> None:
    """What its publishers kept is gone with it."""
    sender, other, listener = sessions(), sessions(), sessions()
    heard = ticks(listener, "a")
    sender.publisher("a", Done, latched=True).put(Done(tick=1))
    heard.wait_for(("a", 1))
    sender.close()
    _expect_only_b(other, listener)


def test_raw_subscribers_get_history_too(sessions: Sessions) -> None:
    """With the time and the session of the message."""
    sender, listener = sessions(), sessions()
    sender.publisher("a", Done, latched=True).put(Done(tick=1))
    inbox = Inbox()
    listener.subscribe_raw("a", inbox, latched=True)
    (sample,) = inbox.wait_count(1)
    assert (sample.key, sample.source) == ("a", sender.instance)
    assert sample.timestamp > 0
