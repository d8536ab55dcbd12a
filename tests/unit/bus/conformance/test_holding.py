"""A session whose process does not hold its name yet, the same over Zenoh and in memory."""

import pytest

from support.transports import Inbox, Sessions, wait_until_true
from zteam.bus import NoRequest
from zteam.errors import BusError
from zteam.messages import Done


def test_a_held_session_shows_nothing(sessions: Sessions) -> None:
    """No message, latched or not, reaches a subscriber before the release; then a latched publisher's last one does."""
    held, listener = sessions(), sessions()
    inbox = Inbox()
    listener.subscribe("**", Done, lambda key, message: inbox(key, message.tick), latched=True)
    held.hold()
    latched, plain = held.publisher("latched", Done, latched=True), held.publisher("plain", Done)
    gone = held.publisher("gone", Done, latched=True)
    for tick in (1, 2):
        for publisher in (latched, plain, gone):
            publisher.put(Done(tick=tick))
    gone.close()
    assert (latched.has_subscribers, plain.has_subscribers) == (True, False)
    held.release()
    inbox.wait_for(("latched", 2))
    latched.put_owned(Done(tick=3))
    assert inbox.wait_for(("latched", 3)) == [("latched", 2), ("latched", 3)]
    gone.put(Done(tick=4))
    wait_until_true(lambda: plain.has_subscribers)
    plain.put(Done(tick=5))
    latched.put(Done(tick=6))
    assert inbox.wait_for(("latched", 6))[2:] == [("plain", 5), ("latched", 6)]


def test_a_held_session_answers_nothing(sessions: Sessions) -> None:
    """Its queries are answered from the release on, unless they were closed before; one of them always."""
    held, asker = sessions(), sessions()
    held.hold()
    for key in ("info", "status", "closed"):
        served = held.serve(key, NoRequest, lambda _: "here", at_once=key == "info")
        if key == "closed":
            served.close()
    wait_until_true(lambda: asker.query("*", str) == [("info", "here")])
    held.release()
    wait_until_true(lambda: asker.query("*", str) == [("info", "here"), ("status", "here")])


def test_a_held_publisher_refuses_a_key_at_once(sessions: Sessions) -> None:
    """A key that is no key expression is an error of the caller, and not of the release."""
    held = sessions()
    held.hold()
    with pytest.raises(BusError, match="write 'a/b'"):
        held.publisher("a//b", Done)
