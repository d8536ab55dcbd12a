"""Publish and subscribe, the same over Zenoh and in memory."""

import pytest

from support.limits import LIMIT
from support.log_capture import captured_log
from support.transports import Inbox, Sessions, wait_until_true
from zteam.bus import Bus, Publisher, transport
from zteam.clock import wait_until
from zteam.errors import BusError
from zteam.messages import Bool, Done, encode, encoding_of


def reaching(bus: Bus, key: str, **options: bool) -> Publisher[Done]:
    """A publisher that knows of its subscribers."""
    publisher = bus.publisher(key, Done, **options)
    wait_until_true(lambda: publisher.has_subscribers)
    return publisher


def ticks(bus: Bus, key_expr: str, **options: bool) -> Inbox:
    """Collects the keys and ticks of Done messages."""
    inbox = Inbox()
    bus.subscribe(key_expr, Done, lambda key, message: inbox(key, message.tick), **options)
    return inbox


not_bridged_to_zenoh = pytest.mark.parametrize("sessions", ["memory", "zenoh", "bridge to memory"], indirect=True)
"""Through a bridge to Zenoh nothing is sent outside before the publisher knows of a subscriber there."""


def counted(bus: Bus, key: str) -> tuple[int, int, str]:
    """How many messages on a key the session received and dropped, and why it dropped the last one just now."""
    count = bus.counters.snapshot()[key]
    assert count.last_drop_age is not None
    assert 0.0 <= count.last_drop_age < LIMIT
    return count.received, count.dropped, count.last_drop_reason


@not_bridged_to_zenoh
def test_a_message_reaches_other_sessions_and_its_own(sessions: Sessions) -> None:
    """Each subscriber gets it once, with its key."""
    sender, other = sessions(), sessions()
    inboxes = [ticks(sender, "a/b"), ticks(other, "a/b"), ticks(other, "a/b")]
    # The subscriber of the own session makes the publisher reach something before the others are known.
    last = ticks(other, "z")
    reaching(sender, "z").put(Done(tick=0))
    last.wait_for(("z", 0))
    publisher = reaching(sender, "a/b")
    publisher.put(Done(tick=1))
    publisher.put(Done(tick=2))
    for inbox in inboxes:
        assert inbox.wait_for(("a/b", 2)) == [("a/b", 1), ("a/b", 2)]


@not_bridged_to_zenoh
@pytest.mark.parametrize(
    ("key_expr", "matching"),
    [("a/*/c", ["a/b/c", "a/x/c"]), ("a/**", ["a", "a/b", "a/b/c", "a/x/c"]), ("a/b*/c", []), ("a/b$*/c", ["a/b/c"])],
)
def test_wildcards_match_as_zenoh_says(sessions: Sessions, key_expr: str, matching: list[str]) -> None:
    """`*` is one part of a key, `**` any number of parts, `$*` any part of a name; a bare `b*` is refused."""
    sender, listener = sessions(), sessions()
    if not matching:
        with pytest.raises(BusError, match=r"cannot subscribe to a/b\*/c: Invalid Key Expr"):
            listener.subscribe(key_expr, Done, Inbox())
        return
    inbox, end = ticks(listener, key_expr), ticks(listener, "end")
    ending = reaching(sender, "end")
    for tick, key in enumerate(("a", "a/b", "a/b/c", "a/x/c", "b/b/c")):
        sender.publisher(key, Done).put(Done(tick=tick))
    ending.put(Done(tick=9))
    end.wait_for(("end", 9))
    assert [key for key, _ in inbox.items] == matching


def test_messages_of_a_publisher_come_in_order(sessions: Sessions) -> None:
    """None is lost, doubled or passed by another one."""
    sender, listener = sessions(), sessions()
    inbox = ticks(listener, "a")
    publisher = reaching(sender, "a")
    for tick in range(100):
        publisher.put(Done(tick=tick))
    assert inbox.wait_count(100) == [("a", tick) for tick in range(100)]


def test_messages_on_several_keys_come_in_order(sessions: Sessions) -> None:
    """The order of one session's messages holds across its publishers."""
    sender, listener = sessions(), sessions()
    inbox = ticks(listener, "*")
    publishers = [reaching(sender, key) for key in ("a", "b", "c")]
    for tick in range(60):
        publishers[tick % 3].put(Done(tick=tick))
    assert [tick for _, tick in inbox.wait_count(60)] == list(range(60))


def test_a_publisher_to_others_passes_over_its_own_session(sessions: Sessions) -> None:
    """Its own session's subscribers get nothing and do not count as subscribers."""
    sender, listener = sessions(), sessions()
    own = ticks(sender, "a")
    publisher = sender.publisher("a", Done, to_others=True)
    assert not publisher.has_subscribers
    others = ticks(listener, "a")
    wait_until_true(lambda: publisher.has_subscribers)
    publisher.put(Done(tick=1))
    others.wait_for(("a", 1))
    reaching(sender, "a").put(Done(tick=2))
    own.wait_for(("a", 2))
    assert own.items == [("a", 2)]


def test_has_subscribers_follows_subscriptions(sessions: Sessions) -> None:
    """False without one, true with one, false once it is closed or its session is."""
    sender, listener, leaving = sessions(), sessions(), sessions()
    publisher = sender.publisher("a", Done)

    def wait_until_it_is(expected: bool) -> None:
        wait_until_true(lambda: publisher.has_subscribers is expected)

    assert not publisher.has_subscribers
    subscription = listener.subscribe("*", Done, Inbox())
    wait_until_it_is(True)
    subscription.close()
    wait_until_it_is(False)
    leaving.subscribe("**", Done, Inbox())
    wait_until_it_is(True)
    leaving.close()
    wait_until_it_is(False)


def test_a_late_publisher_knows_its_subscribers_at_once(sessions: Sessions) -> None:
    """A subscriber of the own session is known when the publisher is declared."""
    bus = sessions()
    bus.subscribe("a", Done, Inbox())
    assert bus.publisher("a", Done).has_subscribers


def test_a_latched_publisher_always_has_a_subscriber(sessions: Sessions) -> None:
    """A late subscriber will ask for the message, so it must be made."""
    assert sessions().publisher("a", Done, latched=True).has_subscribers


def test_a_closed_publisher_delivers_nothing(sessions: Sessions) -> None:
    """A message put after the close is not sent, and the publisher has no subscribers."""
    sender, listener = sessions(), sessions()
    inbox = ticks(listener, "a")
    closed, other = reaching(sender, "a"), reaching(sender, "a")
    closed.close()
    closed.close()
    closed.put(Done(tick=1))
    other.put(Done(tick=2))
    assert inbox.wait_for(("a", 2)) == [("a", 2)]
    assert not closed.has_subscribers


def test_a_closed_subscription_hears_nothing(sessions: Sessions) -> None:
    """Its callback is not called once `close` has returned; other subscriptions go on."""
    sender, listener = sessions(), sessions()
    inbox, closed = ticks(listener, "a"), Inbox()
    subscription = listener.subscribe("a", Done, closed)
    publisher = reaching(sender, "a")
    publisher.put(Done(tick=1))
    closed.wait_count(1)
    subscription.close()
    subscription.close()
    publisher.put(Done(tick=2))
    inbox.wait_for(("a", 2))
    assert len(closed.items) == 1


def test_an_error_in_a_callback_ends_nothing(sessions: Sessions) -> None:
    """It is logged with its key; the next message and the other subscribers are served."""
    sender, listener = sessions(), sessions()
    inbox, failing = ticks(listener, "a"), Inbox()

    def fail(_key: str, message: Done) -> None:
        failing(message.tick)
        raise ValueError("a fault")

    listener.subscribe("a", Done, fail)
    publisher = reaching(sender, "a")
    with captured_log() as log:
        publisher.put(Done(tick=1))
        publisher.put(Done(tick=2))
        inbox.wait_for(("a", 2))
        failing.wait_for(2)
        text = "error while handling a message on a"
        with log.changed:
            assert wait_until(log.changed, lambda: log.count(text) == 2, LIMIT), log.lines


def test_a_raw_sample_tells_its_origin(sessions: Sessions) -> None:
    """Key, payload, encoding, the session that sent it, and a time that grows."""
    sender, listener = sessions(), sessions()
    inbox = Inbox()
    listener.subscribe_raw("a", inbox)
    publisher = reaching(sender, "a")
    publisher.put(Done(tick=1))
    publisher.put(Done(tick=2))
    first, second = inbox.wait_count(2)
    assert (first.key, first.payload, first.encoding) == ("a", encode(Done(tick=1)), encoding_of(Done))
    assert first.source == second.source == sender.instance
    assert 0 < first.timestamp < second.timestamp


def test_a_message_on_a_wildcard_is_dropped(sessions: Sessions) -> None:
    """A message that is addressed to every key is counted and not handled."""
    sender, listener = sessions(), sessions()
    inbox = ticks(listener, "a")
    reaching(sender, "*").put(Done(tick=1))
    reaching(sender, "a").put(Done(tick=2))
    assert inbox.wait_for(("a", 2)) == [("a", 2)]
    assert counted(listener, "*") == (0, 1, "its key is a wildcard, not the name of one topic")


def test_a_message_of_another_type_is_dropped(sessions: Sessions) -> None:
    """It is counted and not handled."""
    sender, listener = sessions(), sessions()
    inbox = ticks(listener, "a")
    wrong = sender.publisher("a", Bool)
    wait_until_true(lambda: wrong.has_subscribers)
    wrong.put(Bool(True))
    reaching(sender, "a").put(Done(tick=2))
    assert inbox.wait_for(("a", 2)) == [("a", 2)]
    assert counted(listener, "a") == (1, 1, "wrong type: it is std_msgs/msg/Bool, zteam_msgs/msg/Done is due")


def test_an_oversized_message_is_dropped(sessions: Sessions, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is counted and not decoded, by typed and raw subscribers alike."""
    monkeypatch.setattr(transport, "MAX_PAYLOAD", 100)
    sender, listener = sessions(), sessions()
    inbox, raw = ticks(listener, "a"), Inbox()
    listener.subscribe_raw("a", lambda sample: raw(len(sample.payload)))
    small = reaching(sender, "a")
    sender.transport.declare_publisher("a", encoding_of(Done), False).put(b"\0" * 101)
    small.put(Done(tick=2))
    inbox.wait_for(("a", 2))
    raw.wait_count(1)
    assert inbox.items == [("a", 2)]
    assert raw.items == [len(encode(Done(tick=2)))]
    assert counted(listener, "a") == (1, 2, "its 101 bytes are more than 100")


def test_sessions_have_ids_of_their_own(sessions: Sessions) -> None:
    """No two sessions share an id, and none is empty."""
    ids = {sessions().instance for _ in range(3)}
    assert len(ids) == 3
    assert all(ids)


def test_a_message_that_is_handed_over_comes_as_any_other(sessions: Sessions) -> None:
    """To typed and raw subscribers, in the order in which messages were put and handed over."""
    sender, listener = sessions(), sessions()
    inbox, raw = ticks(listener, "a"), Inbox()
    listener.subscribe_raw("a", lambda sample: raw(sample.payload))
    publisher = reaching(sender, "a")
    publisher.put(Done(tick=1))
    publisher.put_owned(Done(tick=2))
    publisher.put(Done(tick=3))
    assert inbox.wait_for(("a", 3)) == [("a", 1), ("a", 2), ("a", 3)]
    assert raw.wait_count(3) == [encode(Done(tick=tick)) for tick in (1, 2, 3)]


def test_a_subscriber_may_ask_for_the_source(sessions: Sessions) -> None:
    """It gets the session's id with each message; what does not decode is counted and not handled."""
    listener, senders, inbox = sessions(), [sessions(), sessions()], Inbox()
    listener.subscribe_from("a", Done, lambda _, message, source: inbox(source, message.tick))
    for tick, sender in enumerate(senders):
        reaching(sender, "a").put(Done(tick=tick))
        inbox.wait_for((sender.instance, tick))
    senders[0].transport.declare_publisher("a", encoding_of(Done), False).put(b"\0\1")
    reaching(senders[1], "a").put(Done(tick=2))
    inbox.wait_for((senders[1].instance, 2))
    wait_until_true(lambda: listener.counters.snapshot()["a"].dropped == 1)
    assert inbox.items == [*((sender.instance, tick) for tick, sender in enumerate(senders)), (senders[1].instance, 2)]
