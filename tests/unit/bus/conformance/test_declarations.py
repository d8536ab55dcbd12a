"""What sessions learn of each other's publishers and subscribers."""

from support.transports import Sessions, wait_until_true
from zteam.bus.transport import Declaration, RawSample
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
    wait_until_true(lambda: expected <= set(looking.declarations() or ()))
    found = looking.declarations()
    assert found is not None
    assert sorted(found) == sorted(expected)


def test_closed_declarations_are_gone(sessions: Sessions) -> None:
    """A publisher and a subscriber that were closed are not listed."""
    looking, other = sessions(), sessions()
    handles = [other.publisher("lamp", Bool), other.subscribe_raw("lamp", ignore)]
    wait_until_true(lambda: len(looking.declarations() or ()) == 2)
    for handle in handles:
        handle.close()
    wait_until_true(lambda: looking.declarations() == [])
