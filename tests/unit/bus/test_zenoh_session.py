"""The Zenoh transport on a session without a router."""

import _thread
import threading
from collections.abc import Iterator
from types import FrameType, SimpleNamespace
from typing import Any

import pytest
import zenoh

from support.limits import LIMIT
from support.transports import Inbox, RouterProcess, wait_until_true
from zteam.bus import Bus, BusOptions, connect, zenoh_session
from zteam.bus.transport import RawSample
from zteam.bus.zenoh_session import TokenWatch, ZenohTransport

BEGIN, END = zenoh.SampleKind.PUT, zenoh.SampleKind.DELETE
ALONE = '{mode: "peer", scouting: {multicast: {enabled: false}, delay: 0}, listen: {endpoints: []}}'


def link(kind: zenoh.SampleKind) -> Any:
    """Zenoh's news of a link to a router."""
    return SimpleNamespace(kind=kind, transport=SimpleNamespace(zid="a"))


@pytest.fixture
def transport() -> Iterator[ZenohTransport]:
    """An open session that knows no other."""
    transport = ZenohTransport(zenoh.open(zenoh.Config.from_json5(ALONE)))
    yield transport
    transport.close()


def test_further_queries_cost_no_further_thread(transport: ZenohTransport) -> None:
    """All queries of a session are answered on one thread: a process with twenty would have twenty."""
    threads = set()

    def answer(_asked: str, _payload: bytes) -> bytes:
        threads.add(threading.get_ident())
        return b"here"

    for number in range(3):
        transport.declare_queryable(f"robot_{number}/info", answer)
    for number in range(3):
        assert [reply.payload for reply in transport.get(f"robot_{number}/info", b"", LIMIT)] == [b"here"]
    assert len(threads) == 1


def test_a_handler_of_tokens_holds_up_no_query(transport: ZenohTransport) -> None:
    """While what a token leads to takes its time, queries are answered."""
    may_end, begun = threading.Event(), threading.Event()

    def on_token(_key: str, _is_there: bool) -> None:
        begun.set()
        may_end.wait(LIMIT)

    transport.watch_tokens("robot_1/alive/*", on_token)
    transport.declare_queryable("robot_1/info", lambda *_: b"here")
    transport.declare_token("robot_1/alive/a")
    assert begun.wait(LIMIT)
    assert [reply.payload for reply in transport.get("robot_1/info", b"", LIMIT)] == [b"here"]
    may_end.set()


@pytest.mark.parametrize(
    ("kinds", "told"),
    [
        ([END, BEGIN], [False, True]),
        ([BEGIN, END], [False, True]),
        ([BEGIN, END, END], [False, True, False]),
        ([BEGIN, BEGIN, END, END], [False, True, False, True]),
    ],
)
def test_a_new_link_is_told_also_before_the_end_of_the_last(
    transport: ZenohTransport, kinds: list[zenoh.SampleKind], told: list[bool]
) -> None:
    """Whichever comes first, watchers hear that the link was lost and is back, and the transport is up; it is down only
    when all links have ended."""
    heard = list[bool]()
    transport._on_transport(link(BEGIN))
    transport.watch_link(heard.append)
    for kind in kinds:
        transport._on_transport(link(kind))
    assert heard == told
    assert transport.up is told[-1]


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
    (watch,) = (declared for declared in bus.transport._open if isinstance(declared, TokenWatch))
    watch.receive("gone", True)
    assert ("here", False) not in told.wait_for(("gone", False))


def test_a_lost_router_says_nothing_of_tokens(bus: Bus, router: RouterProcess) -> None:
    """Without a router a look takes no token as gone."""
    told = Inbox()
    watch = TokenWatch(bus.transport._session, "*", told, bus.transport._presence)
    watch.receive("a", True)
    router.kill()
    wait_until_true(lambda: not bus.transport.up)
    watch.look()
    watch.look()
    assert told.items == [("a", True)]


def test_coverage_sees_the_handlers_of_messages() -> None:
    """A thread that Python has not started, as Zenoh's, gets the trace function of Python's threads."""
    seen, done, before = set(), threading.Event(), threading.gettrace()

    def take(_sample: RawSample) -> None:
        done.set()

    def trace(frame: FrameType, _event: str, _arg: object) -> None:
        seen.add(frame.f_code)

    callback = zenoh_session.sample_callback(take)
    sample = SimpleNamespace(kind=BEGIN, key_expr="a", encoding=zenoh.Encoding("b"), payload=zenoh.ZBytes(b""))
    threading.settrace(trace)
    try:
        _thread.start_new_thread(callback, (sample,))
        assert done.wait(LIMIT)
    finally:
        threading.settrace(before)  # type: ignore[arg-type]
    assert take.__code__ in seen
