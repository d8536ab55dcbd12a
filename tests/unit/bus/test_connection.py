"""A link to the router that came back: whether it carries both ways."""

from collections.abc import Iterator
from contextlib import closing

import pytest

from support.limits import LIMIT
from support.transports import Inbox, RouterProcess, wait_until_true
from zteam.bus import Bus, BusOptions, connect, connection
from zteam.bus.connection import LinkCheck


@pytest.fixture(scope="module")
def router() -> Iterator[RouterProcess]:
    """One router for both tests."""
    process = RouterProcess()
    yield process
    process.kill()


@pytest.fixture
def bus(router: RouterProcess, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bus]:
    """A session of the test's own. The next question follows an answer soon."""
    monkeypatch.setattr(connection, "_LINK_PERIOD", 0.01)
    with closing(connect(BusOptions(connect=router.endpoint, lease=LIMIT))) as bus:
        yield bus


def test_a_link_on_which_nothing_comes_is_ended_once_more(
    bus: Bus, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """After a flood a router may take what a session sends and send it nothing. After three questions without an answer
    the session has another link, on which all is well; a whole link is kept."""
    told, asked = Inbox(), list[bool | None]()
    answers: Iterator[bool | None] = iter([True, False, False, None, False, False, False])
    is_reached = connection._is_reached

    def ask(*given: object) -> bool | None:
        asked.append(next(answers, None) if len(asked) < 7 else is_reached(*given))  # type: ignore[arg-type]
        return asked[-1]

    monkeypatch.setattr(connection, "_is_reached", ask)
    bus.watch_link(told)
    check = LinkCheck(bus.transport._session, bus.options)  # type: ignore[attr-defined, arg-type]
    check.run(lambda: len(asked) < 3)
    assert asked == [True, False, False]
    check.run(lambda: True)
    assert asked[:7] == [True, False, False, None, False, False, False]
    told.wait_for(True)
    assert told.items[:2] == [False, True]
    assert caplog.text.count("no query reaches this process") == 1
    # The session's own check follows, and finds the new link whole.
    wait_until_true(lambda: True in asked[7:])


def test_links_are_not_ended_for_ever(
    bus: Bus, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Where an access control lets no query through, none is answered on any link: after three new ones an error says
    so. A whole link in between begins the count anew."""
    ended = list[object]()
    monkeypatch.setattr(connection, "cut", ended.append)
    check = LinkCheck(bus.transport._session, bus.options)  # type: ignore[attr-defined, arg-type]
    for reached in (False, False, True, *4 * [False]):
        monkeypatch.setattr(connection, "_is_reached", lambda *_, reached=reached: reached)
        check.run(lambda: True)
    assert len(ended) == 5
    assert caplog.text.count("opening another link") == 5
    assert caplog.text.count("after 3 new links") == 1
