"""The end of a session, the same over Zenoh and in memory."""

import gc
import itertools
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import pytest

from support.limits import LIMIT
from support.transports import Inbox, RouterProcess, Sessions, wait_until_true, zenoh_sessions
from zteam.bus import Bus, NoRequest, Publisher
from zteam.bus.transport import Closeable
from zteam.errors import BusError
from zteam.messages import Done

USES: dict[str, Callable[[Bus, str], object]] = {
    "publisher": lambda bus, key: bus.publisher(key, Done),
    "latched publisher": lambda bus, key: bus.publisher(key, Done, latched=True),
    "subscribe": lambda bus, key: bus.subscribe(key, Done, Inbox()),
    "latched subscribe": lambda bus, key: bus.subscribe(key, Done, Inbox(), latched=True),
    "serve": lambda bus, key: bus.serve(key, NoRequest, lambda _: NoRequest()),
    "declare_token": lambda bus, key: bus.declare_token(key),
    "watch_tokens": lambda bus, key: bus.watch_tokens([key], Inbox()),
    "query": lambda bus, key: bus.query(key, NoRequest),
}
"""Every way to use a key; the last one declares nothing."""


def declare_all(bus: Bus, key: str) -> list[Closeable]:
    """A declaration of each kind."""
    declared = [use(bus, key) for name, use in USES.items() if name != "query"]
    return [each for one in declared for each in (one if isinstance(one, Sequence) else [one])]  # type: ignore[list-item]


def test_a_closed_session_and_an_impossible_key_are_refused(sessions: Sessions) -> None:
    """Threads that outlive the session, and callers with a key that Zenoh could not carry, get an error of the bus that
    names the key."""
    bus = sessions()
    for use in USES.values():
        with pytest.raises(BusError, match="a//b"):
            use(bus, "a//b")
    bus.close()
    for use in USES.values():
        with pytest.raises(BusError, match=r"cannot \w+ .*a\b.*clos"):
            use(bus, "a")


def test_closing_again_does_nothing(sessions: Sessions) -> None:
    """Neither does a message that is put after its session's end, nor the end of a declaration; no loss of the link is
    reported."""
    bus, links = sessions(), Inbox()
    bus.watch_link(links)
    declared = declare_all(bus, "a")
    for _ in range(3):
        bus.close()
    publisher = declared[0]
    assert isinstance(publisher, Publisher)
    publisher.put(Done(tick=1))
    assert not publisher.has_subscribers
    for closeable in declared:
        closeable.close()
    assert links.items == []


def test_a_publisher_closes_while_other_threads_publish(sessions: Sessions) -> None:
    """It waits for the messages that are under way; neither those threads nor the one that closes it get an error."""
    bus, heard = sessions(), [threading.Event() for _ in range(3)]
    sessions().subscribe("a", Done, lambda _, message: heard[message.tick].set())

    def publish(publisher: Publisher[Done], tick: int, begun: threading.Barrier, ended: threading.Event) -> None:
        begun.wait(LIMIT)
        while not ended.is_set():
            publisher.put(Done(tick=tick))

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
    bus, numbers = sessions(), itertools.count()

    def declare_and_close() -> None:
        for declared in declare_all(bus, "a"):
            declared.close()
        bus.declare_token(f"e/{next(numbers)}").close()

    def held() -> int:
        gc.collect()
        return len(gc.get_objects())

    declare_and_close()
    before = held()
    for _ in range(30):
        declare_and_close()
    wait_until_true(lambda: held() < before + 30)


def test_a_closed_session_hears_nothing(sessions: Sessions) -> None:
    """Its subscribers are gone before `close` returns."""
    sender, leaving, listener = sessions(), sessions(), sessions()
    inbox, silent = Inbox(), Inbox()
    leaving.subscribe("a", Done, silent)
    leaving.close()
    listener.subscribe("a", Done, inbox)
    publisher = sender.publisher("a", Done)
    wait_until_true(lambda: publisher.put(Done()) or bool(inbox.items))
    assert silent.items == []


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
