"""What sessions learn of each other's publishers and subscribers."""

import pytest

from support.transports import Inbox, Sessions, wait_until_true
from zteam.bus import NoRequest
from zteam.bus.transport import Declaration
from zteam.errors import BusError
from zteam.messages import Bool


def test_a_session_sees_the_publishers_and_subscribers_of_the_others(sessions: Sessions) -> None:
    """Each declaration is listed with its key expression and session, latched ones once, until it is closed. Its own
    ones are not, nor what could not be declared. A query on every key does not reach them."""
    looking, other = sessions(), sessions()
    looking.publisher("mine", Bool)
    for declare in (lambda: other.publisher("a//b", Bool), lambda: other.subscribe_raw("a//b", Inbox())):
        with pytest.raises(BusError, match="a//b"):
            declare()
    handles = [
        other.publisher("robot_0/stall", Bool),
        other.publisher("lamp", Bool, latched=True),
        other.subscribe_raw("robot_$*/cmd_vel", Inbox()),
        other.subscribe("map", Bool, Inbox(), latched=True),
    ]
    keys = ("robot_0/stall", "lamp", "robot_$*/cmd_vel", "map")
    expected = sorted(Declaration(key, other.instance, number < 2) for number, key in enumerate(keys))
    wait_until_true(lambda: sorted(looking.declarations()) == expected)
    other.serve("box/count", NoRequest, lambda _: NoRequest())
    wait_until_true(lambda: bool(looking.query("box/count", NoRequest)))
    assert [key for key, _ in looking.query("**", NoRequest)] == ["box/count"]
    for handle in handles:
        handle.close()
        handle.close()
    wait_until_true(lambda: looking.declarations() == [])


def test_a_closed_session_has_no_declarations_and_cannot_ask(sessions: Sessions) -> None:
    """Its own are gone for others, and its question is an error."""
    looking, other = sessions(), sessions()
    other.publisher("lamp", Bool)
    wait_until_true(lambda: len(looking.declarations()) == 1)
    other.close()
    wait_until_true(lambda: looking.declarations() == [])
    with pytest.raises(BusError, match="closed"):
        other.declarations()
