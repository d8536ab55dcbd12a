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


def ticks(bus: Bus, key_expr: str) -> Inbox:
    """Collects the keys and ticks of Done messages."""
    inbox = Inbox()
    bus.subscribe(key_expr, Done, lambda key, message: inbox(key, message.tick))
    return inbox


not_bridged_to_zenoh = pytest.mark.parametrize("sessions", ["memory", "zenoh", "bridge to memory"], indirect=True)
"""Through a bridge to Zenoh nothing is sent outside before the publisher knows of a subscriber there."""


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
        with pytest.raises(BusError, match=r"a/b\*/c' is not a key expression"):
            listener.subscribe(key_expr, Done, Inbox())
        return
    inbox, end = ticks(listener, key_expr), ticks(listener, "end")
    ending = reaching(sender, "end")
    for tick, key in enumerate(("a", "a/b", "a/b/c", "a/x/c", "b/b/c")):
        sender.publisher(key, Done).put(Done(tick=tick))
    ending.put(Done(tick=9))
    end.wait_for(("end", 9))
    assert [key for key, _ in inbox.items] == matching


def test_messages_come_in_their_order(sessions: Sessions) -> None:
    """That of one session holds across its publishers and for messages that it keeps or gives away; none is lost or
    doubled. A raw subscriber gets key, bytes, encoding, the session that sent them, and a time that grows."""
    sender, listener = sessions(), sessions()
    inbox, raw = ticks(listener, "*"), Inbox()
    listener.subscribe_raw("a", raw)
    publishers = [reaching(sender, key) for key in ("a", "b", "c")]
    for tick in range(60):
        publisher = publishers[tick % 3]
        (publisher.put_owned if tick % 2 else publisher.put)(Done(tick=tick))
    assert [tick for _, tick in inbox.wait_count(60)] == list(range(60))
    samples = raw.wait_count(20)
    told = [(sample.key, sample.payload, sample.encoding, sample.source) for sample in samples]
    assert told == [("a", encode(Done(tick=tick)), encoding_of(Done), sender.instance) for tick in range(0, 60, 3)]
    times = [sample.timestamp for sample in samples]
    assert times[0] > 0
    assert times == sorted(set(times))


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
    """False without one, true with one, false once it is closed or its session is. One of the own session is known at
    once; a latched publisher always has one, because a late subscriber will ask for its message."""
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
    sender.subscribe("b", Done, Inbox())
    assert sender.publisher("b", Done).has_subscribers
    assert sender.publisher("c", Done, latched=True).has_subscribers


def test_what_is_closed_sends_and_gets_nothing(sessions: Sessions) -> None:
    """A message put after the close is not sent, and the publisher has no subscribers; a closed subscription's callback
    is not called once `close` has returned. Other publishers and subscriptions go on."""
    sender, listener = sessions(), sessions()
    inbox, gone = ticks(listener, "a"), Inbox()
    subscription = listener.subscribe("a", Done, gone)
    closed, other = reaching(sender, "a"), reaching(sender, "a")
    closed.put(Done(tick=1))
    gone.wait_count(1)
    for _ in range(2):
        subscription.close()
        closed.close()
    closed.put(Done(tick=2))
    other.put(Done(tick=3))
    assert inbox.wait_for(("a", 3)) == [("a", 1), ("a", 3)]
    assert not closed.has_subscribers
    assert len(gone.items) == 1


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


DROPPED = {
    "*": (encode(Done(tick=1)), encoding_of(Done), "its key is a wildcard, not the name of one topic"),
    "type": (encode(Bool(True)), encoding_of(Bool), "wrong type: it is std_msgs/msg/Bool, zteam_msgs/msg/Done is due"),
    "size": (b"\0" * 101, encoding_of(Done), "its 101 bytes are more than 100"),
    "cdr": (b"{}", encoding_of(Done), "2 bytes are too few for Done"),
}
"""By key: what is put on it, and why it is dropped."""


@pytest.mark.parametrize("key", DROPPED)
def test_what_is_no_message_is_dropped(sessions: Sessions, key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is counted with its reason and not handled, by each kind of subscriber; what follows is, with its source."""
    monkeypatch.setattr(transport, "MAX_PAYLOAD", 100)
    sender, listener, raw = sessions(), sessions(), Inbox()
    payload, encoding, reason = DROPPED[key]
    inbox, sources = ticks(listener, "*"), Inbox()
    listener.subscribe_from("*", Done, lambda _, message, source: sources(source, message.tick))
    listener.subscribe_raw("*", lambda sample: raw(len(sample.payload)))
    good = reaching(sender, "good")
    bad = sender.transport.declare_publisher(key, encoding, False)
    wait_until_true(lambda: bad.has_subscribers)
    bad.put(payload)
    good.put(Done(tick=2))
    assert inbox.wait_for(("good", 2)) == [("good", 2)]
    assert sources.wait_count(1) == [(sender.instance, 2)]
    sizes = [] if key == "size" else [len(payload)]
    assert raw.wait_count(len(sizes) + 1) == [*sizes, len(encode(Done()))]
    count = listener.counters.snapshot()[key]
    assert (count.received, count.dropped, count.last_drop_reason) == (0, 3 if key == "size" else 2, reason)
    assert count.last_drop_age is not None and 0.0 <= count.last_drop_age < LIMIT
