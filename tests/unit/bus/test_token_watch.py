"""A watch of tokens that misses news."""

from collections.abc import Iterator

import pytest

from support.transports import Inbox, RouterProcess, wait_until_true
from zteam.bus import Bus, BusOptions, connect, zenoh_session
from zteam.bus.zenoh_session import TokenWatch


@pytest.fixture
def router() -> Iterator[RouterProcess]:
    """A router of the test's own."""
    router = RouterProcess()
    yield router
    router.kill()


@pytest.fixture
def bus(router: RouterProcess, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bus]:
    """A session that looks at its tokens often."""
    monkeypatch.setattr(zenoh_session, "LOOK_PERIOD", 0.05)
    bus = connect(BusOptions(connect=router.endpoint))
    yield bus
    bus.close()


def test_an_end_that_was_not_told_is_seen(bus: Bus) -> None:
    """A look at the router's tokens finds the one that has ended, and leaves the one that lives."""
    told = Inbox()
    bus.declare_token("here")
    bus.watch_tokens(["*"], told)
    told.wait_for(("here", True))
    (watch,) = (declared for declared in bus.transport._declared if isinstance(declared, TokenWatch))
    watch.take("gone", True)
    assert ("here", False) not in told.wait_for(("gone", False))


def test_a_lost_router_says_nothing_of_tokens(bus: Bus, router: RouterProcess) -> None:
    """Without a router a look takes no token as gone."""
    told = Inbox()
    watch = TokenWatch(bus.transport._session, "*", told, lambda _: None)
    watch.take("a", True)
    router.kill()
    wait_until_true(lambda: not bus.transport.up)
    watch.look()
    watch.look()
    assert told.items == [("a", True)]
