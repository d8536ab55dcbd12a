"""Latched keys, the same over Zenoh and in memory."""

from support.transports import Inbox, Sessions
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
