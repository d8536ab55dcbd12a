"""Asking sessions for their declarations, with a router in a process of its own."""

import threading
import uuid
from collections.abc import Iterator

import pytest
import zenoh

import zteam.bus.bus as bus_module
from support.limits import LIMIT
from support.transports import Inbox, RouterProcess, wait_until_true
from zteam.bus import BusOptions, MemoryHub, connect
from zteam.bus.memory import MemoryTransport
from zteam.bus.options import client_config
from zteam.bus.transport import Declaration
from zteam.messages import Bool, encode, encoding_of
from zteam.names import declarations_key


@pytest.fixture
def options() -> Iterator[BusOptions]:
    """How to reach a router of the test's own, which may stop for ever."""
    router = RouterProcess()
    yield BusOptions(connect=router.endpoint, lease=LIMIT, namespace=f"n{uuid.uuid4().hex}")
    router.kill()


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


def test_a_session_without_a_readable_answer_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """One of another version, and one that does not answer in time; the others are listed all the same."""
    monkeypatch.setattr(bus_module, "_DECLARATIONS_TIMEOUT", 0.0)
    hub, over = MemoryHub(), threading.Event()
    looking, frozen, odd = hub.bus(), MemoryTransport(hub), MemoryTransport(hub)
    frozen.declare_queryable(declarations_key("frozen"), lambda *_: lambda: b"[]" if over.wait(LIMIT) else b"")
    odd.declare_queryable(declarations_key("odd"), lambda *_: b'{"keys": 1}')
    for buses in ([], [hub.bus()]):
        for bus in buses:
            bus.publisher("lamp", Bool)
        assert looking.declarations() == [Declaration("lamp", bus.instance, True) for bus in buses]
    over.set()
