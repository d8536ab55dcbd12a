"""The router on demand: on a port of the test's own, never the machine's default one."""

import os
import random
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from support.freezing import freeze
from support.limits import LIMIT
from zteam.bus import Bus, BusOptions, connect, router
from zteam.bus.options import LEASE
from zteam.bus.router import RouterMetadata, read_admin, router_log_path, spawn_router
from zteam.clock import HOST_FACTOR, monotonic, pause
from zteam.errors import BusError
from zteam.messages import Bool
from zteam.team.launch import run as running
from zteam.team.launch.run import ANY_PORT, choose_endpoint

pytestmark = pytest.mark.team


@pytest.fixture
def endpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A free port in place of the default one. A router there ends a second after its last client, or with the test."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(router, "IDLE_EXIT", HOST_FACTOR)
    while True:
        # Outside the range of ephemeral ports.
        port = random.randint(21000, 31000)
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) != 0:
                break
    chosen = f"tcp/127.0.0.1:{port}"
    monkeypatch.setattr("zteam.bus.options.DEFAULT_ENDPOINT", chosen)
    yield chosen
    info = router_metadata(chosen)
    if info is not None and info.pid is not None:
        wait_for_end(info.pid)


def router_metadata(endpoint: str) -> RouterMetadata | None:
    """What the router at `endpoint` says of its process; None if there is none."""
    record = read_admin(BusOptions(connect=endpoint))
    return record.metadata if record else None


def wait_for_end(pid: int) -> None:
    """Wait until a process that is no child of this one has ended."""
    try:
        handle = os.pidfd_open(pid)
    except ProcessLookupError:
        return
    readable, _, _ = select.select([handle], [], [], LIMIT)  # noqa: TID251
    if not readable:
        signal.pidfd_send_signal(handle, signal.SIGKILL)
    os.close(handle)
    assert readable, "the router did not end by itself"


def router_pid(endpoint: str) -> int:
    """Process id of the router at `endpoint`."""
    info = router_metadata(endpoint)
    assert info is not None
    assert info.pid is not None
    return info.pid


ENDING = """
from zteam.bus import options, router
options.DEFAULT_ENDPOINT, router.IDLE_EXIT = {!r}, 1.0
from zteam.bus import BusOptions, connect
from zteam.messages import Bool
bus = connect(BusOptions())
bus.subscribe("flag", Bool, print)
{}
"""


@pytest.mark.parametrize(("last", "code"), [("", 0), ("1 / 0", 1)])
def test_a_script_that_does_not_close_ends(endpoint: str, last: str, code: int) -> None:
    """A script without `bus.close()` ends with its own exit code."""
    script = ENDING.format(endpoint, last)
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == code, done.stderr


class Listener:
    """Counts the messages on one key."""

    def __init__(self, bus: Bus, key: str) -> None:
        self._arrived = threading.Condition()
        self.count = 0
        bus.subscribe(key, Bool, self._take)

    def _take(self, _key: str, _message: Bool) -> None:
        with self._arrived:
            self.count += 1
            self._arrived.notify_all()

    def hears(self, send: Callable[[], None]) -> bool:
        """Whether a message arrives while `send` is called repeatedly."""
        with self._arrived:
            start = self.count
            for _ in range(int(LIMIT / 0.02)):
                send()
                if self._arrived.wait_for(lambda: self.count > start, 0.02):
                    return True
        return False


def test_the_first_client_starts_it_and_the_others_join(endpoint: str) -> None:
    """Both clients use one router, which runs in a session of its own."""
    first = connect(BusOptions())
    second = connect(BusOptions())
    try:
        pid = router_pid(endpoint)
        assert os.getsid(pid) != os.getsid(0)
        listener, publisher = Listener(second, "a"), first.publisher("a", Bool)
        assert listener.hears(lambda: publisher.put(Bool(True)))
    finally:
        first.close()
        second.close()


def test_it_ends_when_its_last_client_has_gone(endpoint: str) -> None:
    """It lives as long as it is used, and its log says why it ended."""
    bus = connect(BusOptions())
    pid = router_pid(endpoint)
    bus.close()
    wait_for_end(pid)
    assert "the router ends" in router_log_path(endpoint).read_text()
    assert router_metadata(endpoint) is None


def test_a_router_that_dies_is_started_again(endpoint: str) -> None:
    """Both clients reconnect, and their subscribers and publishers work again."""
    first, second = connect(BusOptions()), connect(BusOptions())
    try:
        listener, publisher = Listener(second, "a"), first.publisher("a", Bool)
        assert listener.hears(lambda: publisher.put(Bool(True)))
        pid = router_pid(endpoint)
        os.kill(pid, signal.SIGKILL)
        wait_for_end(pid)
        assert listener.hears(lambda: publisher.put(Bool(True)))
        assert router_pid(endpoint) != pid
    finally:
        first.close()
        second.close()


def test_processes_that_start_at_once_share_a_router(endpoint: str) -> None:
    """Six processes start at once: one router gets the port, and all six connect to it."""
    code = (
        "import zteam.bus.options, sys\n"
        "from zteam.bus import BusOptions, connect, router\n"
        f"zteam.bus.options.DEFAULT_ENDPOINT = {endpoint!r}\n"
        "router.IDLE_EXIT = 1.0\n"
        "bus = connect(BusOptions())\n"
        "print(*bus.transport._session.info.routers_zid(), flush=True)\n"
        "sys.stdin.read()\n"
        "bus.close()"
    )
    started = [
        subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(6)
    ]
    try:
        routers = {each.stdout.readline() for each in started if each.stdout}
        assert len(routers) == 1
        assert routers != {""}
    finally:
        for each in started:
            each.communicate(timeout=LIMIT)
    assert [each.returncode for each in started] == [0] * 6


def test_a_router_on_demand_has_the_lease_of_the_process_that_starts_it(endpoint: str) -> None:
    """Frozen for longer than the usual lease, it keeps the link to a process that asked for a longer one."""
    changes: list[bool] = []
    bus = connect(BusOptions(lease=15.0))
    try:
        bus.watch_link(changes.append)
        freeze([router_pid(endpoint)], LEASE + 0.5)
        # The router answers, and the link is the old one.
        assert bus.declarations() == []
        assert changes == []
    finally:
        bus.close()


def test_a_router_that_finds_its_port_taken_ends_quietly(endpoint: str) -> None:
    """The loser of the race leaves no process, and its line is in the log, not on a screen."""
    bus = connect(BusOptions())
    try:
        spawn_router(endpoint)
        pid = router_pid(endpoint)
        log = router_log_path(endpoint)
        end = monotonic() + LIMIT
        while "in use" not in log.read_text() and monotonic() < end:
            pause(0.01)
        assert "in use" in log.read_text()
        assert router_pid(endpoint) == pid
    finally:
        bus.close()


@pytest.mark.parametrize("is_given", [False, True], ids=["on demand", "with --connect"])
def test_a_port_of_another_program_is_named(endpoint: str, is_given: bool) -> None:
    """If a program that is no Zenoh router has the port, one line names the port and the way out."""
    port = int(endpoint.rpartition(":")[2])
    with socket.create_server(("127.0.0.1", port)) as server:

        def hang_up() -> None:
            while True:
                try:
                    server.accept()[0].close()
                except OSError:
                    return

        thread = threading.Thread(target=hang_up, daemon=True)
        thread.start()
        with pytest.raises(BusError, match=r"does not speak Zenoh.*--connect"):
            connect(BusOptions(connect=endpoint if is_given else None), patience=0.2)
        server.shutdown(socket.SHUT_RDWR)
        thread.join(LIMIT)


def test_another_users_router_is_not_joined(endpoint: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a shared machine two users' teams must not mix by accident; with --connect they may."""
    bus, owner = connect(BusOptions()), os.getuid()
    try:
        monkeypatch.setattr(os, "getuid", lambda: 12345)
        with pytest.raises(BusError, match=rf"belongs to user id {owner}:.*--connect"):
            connect(BusOptions())
        connect(BusOptions(connect=endpoint)).close()
    finally:
        bus.close()


@pytest.mark.parametrize("held", ["idle", "a client", "another user's"])
def test_a_launcher_gets_the_port_of_an_idle_router(endpoint: str, held: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """An idle router on demand ends at once; one with a client, and another user's, stays and keeps the port."""
    monkeypatch.setattr(router, "IDLE_EXIT", 2 * LIMIT)
    monkeypatch.setattr(running, "DEFAULT_ENDPOINT", endpoint)
    bus = connect(BusOptions())
    pid = router_pid(endpoint)
    with monkeypatch.context() as patched:
        if held == "another user's":
            bus.close()
            patched.setattr(os, "getuid", lambda: 12345)
        if held != "idle":
            assert choose_endpoint() == ANY_PORT
            assert router_pid(endpoint) == pid
    bus.close()
    deadline = monotonic() + LIMIT
    # The router may count the client for a moment after its end.
    while choose_endpoint() != endpoint:
        assert monotonic() < deadline
    wait_for_end(pid)


def test_with_connect_nothing_is_started(endpoint: str) -> None:
    """--connect waits as long as it was told to, then says how to go on; no router appears."""
    with pytest.raises(BusError, match="zteam-router --listen"):
        connect(BusOptions(connect=endpoint), patience=0.2)
    assert router_metadata(endpoint) is None
    assert not router_log_path(endpoint).exists()
