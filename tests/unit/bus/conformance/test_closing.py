"""The end of a session, the same over Zenoh and in memory."""

import gc
import itertools
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest

from support.limits import LIMIT
from support.transports import Inbox, RouterProcess, Sessions, wait_until_true, zenoh_sessions
from zteam.bus import Bus, NoRequest, Publisher
from zteam.errors import BusError
from zteam.messages import Done


def test_a_session_closes_twice(sessions: Sessions) -> None:
    """As often as one likes, with everything open on it."""
    bus = sessions()
    bus.publisher("a", Done, latched=True)
    bus.subscribe("a", Done, Inbox(), latched=True)
    bus.serve("a", NoRequest, lambda _: NoRequest())
    bus.declare_token("a")
    bus.watch_tokens(["a"], Inbox())
    bus.watch_link(Inbox())
    for _ in range(3):
        bus.close()


def test_declarations_may_close_after_their_session(sessions: Sessions) -> None:
    """It does nothing, and neither does a message that is put."""
    bus = sessions()
    publisher = bus.publisher("a", Done)
    closeables = [
        publisher,
        bus.publisher("b", Done, latched=True),
        bus.subscribe("a", Done, Inbox()),
        bus.serve("a", NoRequest, lambda _: NoRequest()),
        bus.declare_token("a"),
        *bus.watch_tokens(["a"], Inbox()),
    ]
    bus.close()
    publisher.put(Done(tick=1))
    assert not publisher.has_subscribers
    for closeable in closeables:
        closeable.close()


def publish(publisher: Publisher[Done], tick: int, begun: threading.Barrier, ended: threading.Event) -> None:
    """Put messages until the end."""
    begun.wait(LIMIT)
    while not ended.is_set():
        publisher.put(Done(tick=tick))


def test_a_publisher_closes_while_other_threads_publish(sessions: Sessions) -> None:
    """It waits for the messages that are under way; neither those threads nor the one that closes it get an error."""
    bus, heard = sessions(), [threading.Event() for _ in range(3)]
    sessions().subscribe("a", Done, lambda _, message: heard[message.tick].set())
    for tick in range(3):
        publisher, begun, ended = bus.publisher("a", Done), threading.Barrier(3), threading.Event()
        with ThreadPoolExecutor(2) as threads:
            works = [threads.submit(publish, publisher, tick, begun, ended) for _ in range(2)]
            try:
                begun.wait(LIMIT)
                assert heard[tick].wait(LIMIT)
                publisher.close()
            finally:
                ended.set()
        assert [work.exception() for work in works] == [None, None]


@pytest.mark.few(1)
def test_closed_declarations_are_forgotten(sessions: Sessions) -> None:
    """However often a session declares and closes, it holds as many objects as before."""
    bus = sessions()

    def declare_and_close() -> None:
        for declared in (
            bus.publisher("a", Done),
            bus.publisher("b", Done, latched=True),
            bus.subscribe("c", Done, Inbox()),
            bus.serve("d", NoRequest, lambda _: NoRequest()),
            bus.declare_token(f"e/{next(numbers)}"),
            *bus.watch_tokens(["e/*"], Inbox()),
        ):
            declared.close()

    def held() -> int:
        gc.collect()
        return len(gc.get_objects())

    numbers = itertools.count()
    declare_and_close()
    before = held()
    for _ in range(100):
        declare_and_close()
    wait_until_true(lambda: held() < before + 100)


USES: dict[str, Callable[[Bus], object]] = {
    "publisher": lambda bus: bus.publisher("a", Done),
    "latched publisher": lambda bus: bus.publisher("a", Done, latched=True),
    "subscribe": lambda bus: bus.subscribe("a", Done, Inbox()),
    "latched subscribe": lambda bus: bus.subscribe("a", Done, Inbox(), latched=True),
    "serve": lambda bus: bus.serve("a", NoRequest, lambda _: NoRequest()),
    "query": lambda bus: bus.query("a", NoRequest),
    "declare_token": lambda bus: bus.declare_token("a"),
    "watch_tokens": lambda bus: bus.watch_tokens(["a"], Inbox()),
}


def test_a_closed_session_refuses_to_be_used(sessions: Sessions) -> None:
    """Threads that outlive the session get an error of the bus that names the key."""
    bus = sessions()
    bus.close()
    for use in USES.values():
        with pytest.raises(BusError, match=r"cannot \w+ .*a\b.*clos"):
            use(bus)


@pytest.mark.parametrize("name", sorted(USES))
def test_an_impossible_key_is_an_error_of_the_bus(sessions: Sessions, name: str) -> None:
    """Every way to use a key refuses one that Zenoh could not carry."""
    bus = sessions()
    uses: dict[str, Callable[[], object]] = {
        "publisher": lambda: bus.publisher("a//b", Done),
        "latched publisher": lambda: bus.publisher("a//b", Done, latched=True),
        "subscribe": lambda: bus.subscribe("a//b", Done, Inbox()),
        "latched subscribe": lambda: bus.subscribe("a//b", Done, Inbox(), latched=True),
        "serve": lambda: bus.serve("a//b", NoRequest, lambda _: NoRequest()),
        "query": lambda: bus.query("a//b", NoRequest),
        "declare_token": lambda: bus.declare_token("a//b"),
        "watch_tokens": lambda: bus.watch_tokens(["a//b"], Inbox()),
    }
    with pytest.raises(BusError, match="a//b"):
        uses[name]()


def test_a_closed_session_hears_nothing(sessions: Sessions) -> None:
    """Its subscribers are gone before `close` returns."""
    sender, leaving, listener = sessions(), sessions(), sessions()
    inbox, silent = Inbox(), Inbox()
    leaving.subscribe("a", Done, lambda key, message: silent(message.tick))
    leaving.close()
    listener.subscribe("a", Done, lambda key, message: inbox(message.tick))
    publisher = sender.publisher("a", Done)
    ticks = itertools.count(1)

    def is_heard() -> bool:
        publisher.put(Done(tick=next(ticks)))
        return bool(inbox.items)

    wait_until_true(is_heard)
    assert silent.items == []


def test_the_link_to_a_memory_hub_does_not_go(sessions: Sessions) -> None:
    """A live session tells of no loss, and a closed one does not either."""
    bus, inbox = sessions(), Inbox()
    bus.watch_link(inbox)
    bus.close()
    assert inbox.items == []


def test_a_lost_router_is_told_and_its_return_too() -> None:
    """Every watcher hears it, also after one that raises; a closed session hears nothing."""
    router = RouterProcess()
    again = None
    try:
        with zenoh_sessions(router.endpoint) as sessions:
            bus, closed = sessions(), sessions()
            inbox, silent = Inbox(), Inbox()
            bus.watch_link(lambda up: 1 / 0)
            bus.watch_link(inbox)
            closed.watch_link(silent)
            closed.close()
            router.kill()
            inbox.wait_for(False)
            again = RouterProcess(router.endpoint)
            assert inbox.wait_for(True) == [False, True]
            assert silent.items == []
    finally:
        router.kill()
        if again is not None:
            again.kill()
