"""Asking sessions for their declarations, with a router in a process of its own."""

import contextlib
import threading
import uuid
from collections.abc import Callable, Iterator

import pytest
import zenoh

import zteam.bus.bus as bus_module
from support.limits import LIMIT
from support.transports import Inbox, RouterProcess, wait_until_true
from zteam.bus import Bus, BusOptions, MemoryHub, connect
from zteam.bus.memory import MemoryTransport
from zteam.bus.options import client_config
from zteam.bus.transport import Declaration
from zteam.errors import BusError
from zteam.messages import Bool, encode, encoding_of
from zteam.names import declarations_key

SESSIONS = 200
"""That open and close while the declarations are asked for; with a router that is asked for them, far fewer do."""
MANY = 100


@pytest.fixture
def options() -> Iterator[BusOptions]:
    """How to reach a router of the test's own, which may stop for ever."""
    router = RouterProcess()
    yield BusOptions(connect=router.endpoint, lease=LIMIT, namespace=f"n{uuid.uuid4().hex}")
    router.kill()


def start(work: Callable[[], object]) -> threading.Thread:
    """Work that may never end: the interpreter's end does not wait for it."""
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    return thread


def open_and_close(options: BusOptions) -> None:
    """Open many sessions, one after the other, as long as the router answers."""
    with contextlib.suppress(zenoh.ZError):
        for _ in range(SESSIONS):
            zenoh.open(client_config(options)).close()  # type: ignore[no-untyped-call]


def reach_another(options: BusOptions, heard: Inbox) -> None:
    """Send a message from a new session to another one, if the router answers."""
    with contextlib.suppress(BusError):
        listening, sending = (connect(options, patience=LIMIT) for _ in range(2))
        listening.subscribe("reached", Bool, heard, latched=True)
        sending.publisher("reached", Bool, latched=True).put(Bool(True))
        heard.wait_for(("reached", Bool(True)))
        for bus in (listening, sending):
            bus.close()


@pytest.mark.ci
def test_asking_for_declarations_while_sessions_come_and_go_stops_no_router(options: BusOptions) -> None:
    """Two new sessions reach each other afterwards: a router that is asked for its declarations may stop for ever."""
    team: list[Bus] = [connect(options, patience=LIMIT) for _ in range(2)]
    for i in range(MANY):
        team[0].publisher(f"lamp/{i}", Bool)
    coming = start(lambda: open_and_close(options))

    def ask() -> None:
        while coming.is_alive():
            team[1].declarations()

    asking = start(ask)
    for thread in (coming, asking):
        thread.join(LIMIT)
    heard = Inbox()
    last = start(lambda: reach_another(options, heard))
    last.join(LIMIT)
    assert heard.items == [("reached", Bool(True))]
    assert not any(thread.is_alive() for thread in (coming, asking, last))
    for bus in team:
        bus.close()


def test_a_plain_zenoh_program_tells_no_declarations(options: BusOptions) -> None:
    """Its publisher and subscriber are not listed, but its messages are heard and its subscriber is noticed."""
    looking, heard = connect(options, patience=LIMIT), Inbox()
    publisher = looking.publisher("bell", Bool)
    looking.subscribe_from("lamp", Bool, lambda _, lamp, source: heard(source, lamp.data))
    with zenoh.open(client_config(BusOptions(connect=options.connect))) as plain:
        lamp = plain.declare_publisher(f"{options.namespace}/lamp", encoding=encoding_of(Bool))
        bell = plain.declare_subscriber(f"{options.namespace}/bell", lambda _: None)
        wait_until_true(lambda: publisher.has_subscribers and lamp.matching_status.matching)
        assert looking.declarations() == []
        lamp.put(encode(Bool(True)))
        ((_, data),) = heard.wait_count(1)
        assert data is True
        bell.undeclare()
    looking.close()


def test_a_session_that_does_not_answer_in_time_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The others are listed all the same; if there is no other one, nothing is."""
    monkeypatch.setattr(bus_module, "_DECLARATIONS_TIMEOUT", 0.0)
    hub, over = MemoryHub(), threading.Event()
    looking, frozen = hub.bus(), MemoryTransport(hub)
    frozen.declare_queryable(declarations_key("frozen"), lambda *_: lambda: b"[]" if over.wait(LIMIT) else b"")
    for buses in ([], [hub.bus()]):
        for bus in buses:
            bus.publisher("lamp", Bool)
        assert looking.declarations() == [Declaration("lamp", bus.instance, True) for bus in buses]
    over.set()


def test_an_unreadable_answer_is_passed_over() -> None:
    """Such as that of a session of another version."""
    hub = MemoryHub()
    looking, odd, good = hub.bus(), MemoryTransport(hub), hub.bus()
    odd.declare_queryable(declarations_key("odd"), lambda *_: b'{"keys": 1}')
    good.publisher("lamp", Bool)
    assert looking.declarations() == [Declaration("lamp", good.instance, True)]
