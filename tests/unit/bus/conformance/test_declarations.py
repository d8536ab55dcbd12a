"""What sessions learn of each other's publishers and subscribers."""

import pytest

from support.transports import Inbox, Sessions, wait_until_true
from zteam.bus import NoRequest
from zteam.bus.transport import Declaration, RawSample
from zteam.errors import BusError
from zteam.messages import Bool


def ignore(_sample: RawSample) -> None:
    """Take a sample."""


def test_a_session_sees_the_publishers_and_subscribers_of_the_others(sessions: Sessions) -> None:
    """Each declaration is listed with its key expression and session, latched ones once; its own ones are not."""
    looking, other = sessions(), sessions()
    looking.publisher("mine", Bool)
    other.publisher("robot_0/stall", Bool)
    other.publisher("lamp", Bool, latched=True)
    other.subscribe_raw("robot_$*/cmd_vel", ignore)
    other.subscribe_raw("map", ignore, latched=True)
    expected = {
        Declaration("robot_0/stall", other.instance, True),
        Declaration("lamp", other.instance, True),
        Declaration("robot_$*/cmd_vel", other.instance, False),
        Declaration("map", other.instance, False),
    }
    wait_until_true(lambda: expected <= set(looking.declarations()))
    found = looking.declarations()
    assert found is not None
    assert sorted(found) == sorted(expected)


def test_closed_declarations_are_gone(sessions: Sessions) -> None:
    """A publisher and a subscriber that were closed are not listed."""
    looking, other = sessions(), sessions()
    handles = [
        other.publisher("lamp", Bool),
        other.publisher("map", Bool, latched=True),
        other.subscribe_raw("lamp", ignore),
        other.subscribe("map", Bool, Inbox(), latched=True),
    ]
    wait_until_true(lambda: len(looking.declarations()) == 4)
    for handle in handles:
        handle.close()
        handle.close()
    wait_until_true(lambda: looking.declarations() == [])


def test_what_cannot_be_declared_is_not_listed(sessions: Sessions) -> None:
    """A key that is no key expression is refused, and leaves no declaration."""
    looking, other = sessions(), sessions()
    for declare in (lambda: other.publisher("a//b", Bool), lambda: other.subscribe_raw("a//b", ignore)):
        with pytest.raises(BusError, match="a//b"):
            declare()
    other.publisher("lamp", Bool)
    wait_until_true(lambda: bool(looking.declarations()))
    assert looking.declarations() == [Declaration("lamp", other.instance, True)]


def test_a_closed_session_has_no_declarations_and_cannot_ask(sessions: Sessions) -> None:
    """Its own are gone for others, and its question is an error."""
    looking, other = sessions(), sessions()
    other.publisher("lamp", Bool)
    wait_until_true(lambda: len(looking.declarations()) == 1)
    other.close()
    wait_until_true(lambda: looking.declarations() == [])
    with pytest.raises(BusError, match="closed"):
        other.declarations()


def test_a_query_on_every_key_does_not_reach_declarations(sessions: Sessions) -> None:
    """They are told only to those that ask for them: the answers to `**` are those of processes."""
    looking, other = sessions(), sessions()
    other.publisher("lamp", Bool)
    other.serve("box/count", NoRequest, lambda _: NoRequest())
    wait_until_true(lambda: bool(looking.query("box/count", NoRequest)))
    assert [key for key, _ in looking.query("**", NoRequest)] == ["box/count"]
    assert len(looking.declarations()) == 1
