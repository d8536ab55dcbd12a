"""The two transports of the bus, Zenoh and memory, behind one way to open sessions."""

import contextlib
import itertools
import os
import subprocess
import sys
import threading
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import zenoh

from support.limits import LIMIT
from zteam.bus import Bus, BusOptions, MemoryHub, connect
from zteam.bus.options import RouterOptions, TlsFiles, router_config
from zteam.bus.router import read_record
from zteam.clock import monotonic, pause, wall_ns
from zteam.team.in_process.bridge import NodeSessions


class RouterProcess:
    """A router in a process of its own, on loopback."""

    def __init__(self, listen: str = "tcp/127.0.0.1:0", *arguments: str, tls: TlsFiles | None = None) -> None:
        command = [sys.executable, "-m", "zteam", "zteam-router", "--listen", listen, "--announce"]
        # A busy machine that lets a router or session wait for its turn ends no link.
        command += ["--lease", str(LIMIT), *arguments]
        environment = {**os.environ, **(tls.environment if tls is not None else {})}
        self._process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment
        )
        assert self._process.stdout is not None
        self.endpoint = self._process.stdout.readline().strip()
        if not self.endpoint:
            self.kill()
            raise AssertionError("the router did not start")

    def kill(self) -> None:
        """End it at once, as a crash does."""
        self._process.kill()
        self._process.communicate(timeout=LIMIT)


@contextmanager
def rogue_router(tls: TlsFiles, listen: str = "tls/127.0.0.1:0") -> Iterator[str]:
    """A router of plain Zenoh, whose certificate nothing checks and that lets everyone do everything; its endpoint."""
    with zenoh.open(router_config(RouterOptions((listen,), tls=tls))) as session:
        record = read_record(session, str(session.zid()))
        assert record is not None
        yield record.locators[0]


class Sessions:
    """Opens sessions that see each other, and no other ones; closes them at the end."""

    def __init__(self, open_bus: Callable[[], Bus]) -> None:
        self._open_bus = open_bus
        self._opened = contextlib.ExitStack()

    def __call__(self) -> Bus:
        """A new session."""
        bus = self._open_bus()
        self._opened.callback(bus.close)
        return bus

    def close(self) -> None:
        """Close all sessions."""
        self._opened.close()


class ZenohTimes:
    """The host's time as Zenoh's timestamps, for several threads."""

    def __init__(self) -> None:
        self._last = 0

    def __iter__(self) -> "ZenohTimes":
        return self

    def __next__(self) -> int:
        self._last = max(self._last + 8, (wall_ns() << 32) // 10**9)
        return self._last


@contextmanager
def memory_sessions() -> Iterator[Sessions]:
    """Sessions on one hub, whose samples have Zenoh's timestamps."""
    hub = MemoryHub()
    hub.timestamps = ZenohTimes()
    yield Sessions(hub.bus)


@contextmanager
def zenoh_sessions(*endpoints: str) -> Iterator[Sessions]:
    """Sessions on routers, on each in its turn, in a namespace of their own."""
    namespace, turns = f"n{uuid.uuid4().hex}", itertools.cycle(endpoints)

    def open_bus() -> Bus:
        return connect(BusOptions(connect=next(turns), lease=LIMIT, namespace=namespace), patience=LIMIT)

    sessions = Sessions(open_bus)
    try:
        yield sessions
    finally:
        sessions.close()


def wait_until_true(condition: Callable[[], bool]) -> None:
    """Wait for what the transport does by itself."""
    end = monotonic() + LIMIT
    while not condition():
        assert monotonic() < end, "the condition did not become true"
        pause(0.005)


@contextmanager
def bridged_sessions(outside: Sessions) -> Iterator[Sessions]:
    """Sessions of which every other one is that of a node of a team in one process, and the rest are outside."""
    hub, numbers = NodeSessions(outside()), itertools.count()

    def open_bus() -> Bus:
        number = next(numbers)
        return outside() if number % 2 else hub.bus(f"node_{number}")

    sessions = Sessions(open_bus)
    try:
        yield sessions
    finally:
        sessions.close()
        hub.close()


class Inbox:
    """Collects what callbacks are called with, from any thread: an argument alone, or a tuple of several."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._items: list[Any] = []

    def __call__(self, *arguments: Any) -> None:
        with self._changed:
            self._items.append(arguments[0] if len(arguments) == 1 else arguments)
            self._changed.notify_all()

    @property
    def items(self) -> list[Any]:
        """A copy."""
        with self._changed:
            return list(self._items)

    def wait_for(self, item: Any) -> list[Any]:
        """Everything collected once `item` is there."""
        with self._changed:
            found = self._changed.wait_for(lambda: item in self._items, LIMIT)
            assert found, f"{item!r} did not come: {self._items!r}"
            return list(self._items)

    def wait_count(self, count: int) -> list[Any]:
        """Everything collected once there are `count` items."""
        with self._changed:
            found = self._changed.wait_for(lambda: len(self._items) >= count, LIMIT)
            assert found, f"no {count} items: {self._items!r}"
            return list(self._items)
