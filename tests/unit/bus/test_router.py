"""The routers of this machine."""

import json
import logging
import select
import socket
import threading
from collections.abc import Callable
from contextlib import ExitStack, closing
from itertools import count
from pathlib import Path

import pytest

from support.limits import LIMIT
from support.transports import RouterProcess, wait_until_true
from zteam.bus import Bus, BusOptions, NoRequest, connect
from zteam.bus.options import RouterOptions, host_port
from zteam.bus.router import Router, find_local_routers, read_admin


def test_a_router_is_found_as_long_as_it_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its endpoint is the one at which it listens; what a killed one has left behind is removed."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    router = RouterProcess()
    try:
        assert router.endpoint in find_local_routers()
    finally:
        router.kill()
    assert router.endpoint not in find_local_routers()
    assert not list((tmp_path / "zteam").iterdir())


@pytest.mark.parametrize("folder", ["missing", "closed"])
def test_a_router_works_without_a_folder_for_its_state(
    folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is found by its endpoint only."""
    (tmp_path / "closed").write_text("no folder")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / folder / "below"))
    router = Router(RouterOptions(("tcp/127.0.0.1:0",)))
    try:
        connect(BusOptions(connect=router.endpoint), patience=LIMIT).close()
        assert find_local_routers() == ([router.endpoint] if folder == "missing" else [])
    finally:
        router.close()
    assert find_local_routers() == []


def _session(router: Router) -> Bus:
    return connect(BusOptions(connect=router.endpoint), patience=LIMIT)


_CLOSED = {"enabled": True, "default_permission": "deny", "rules": [], "subjects": [], "policies": []}
_OPEN = {**_CLOSED, "default_permission": "allow"}


@pytest.fixture
def mounted(tmp_path: Path) -> Callable[[str], Path]:
    """Gives the file of settings a new content, as a mounted secret gets one: its folder is a link that moves."""
    versions = count()

    def write(text: str) -> Path:
        folder = tmp_path / f"version-{next(versions)}"
        folder.mkdir()
        (folder / "access.json5").write_text(text)
        link = tmp_path / "new"
        link.symlink_to(folder)
        link.replace(tmp_path / "data")
        return tmp_path / "data" / "access.json5"

    return write


def test_a_router_takes_a_changed_file_of_settings(
    mounted: Callable[[str], Path], caplog: pytest.LogCaptureFixture
) -> None:
    """What it says holds for sessions that are open; one that Zenoh does not take changes nothing, and is told once."""

    def access(section: object) -> str:
        return json.dumps({"access_control": section})

    caplog.set_level(logging.INFO)
    file = mounted(access(_CLOSED))
    router = Router(RouterOptions(("tcp/127.0.0.1:0",), config=str(file)))
    stop = threading.Event()
    thread = threading.Thread(target=router.run, args=(stop.is_set,))
    thread.start()

    def said(text: str) -> int:
        return sum(text in record.message for record in caplog.records)

    try:
        with closing(_session(router)) as server, closing(_session(router)) as client:
            server.serve("word", NoRequest, lambda _: "heard")

            def is_heard() -> bool:
                return client.query("word", str) == [("word", "heard")]

            assert not is_heard()
            mounted(access(_OPEN))
            wait_until_true(is_heard)
            mounted("{")
            wait_until_true(lambda: said("keeps the settings it has") == 1)
            assert is_heard()
            mounted(access({**_OPEN, "policies": None}))
            wait_until_true(lambda: said("keeps the settings it had") == 1)
            wait_until_true(is_heard)
            mounted(access(_CLOSED))
            wait_until_true(lambda: said("has taken it") == 2)
            wait_until_true(lambda: client.transport.up and server.transport.up)
            assert not is_heard()
    finally:
        stop.set()
        router.wake()
        thread.join(LIMIT)
        router.close()


def test_a_router_listens_at_several_endpoints_and_links_itself_to_another(tmp_path: Path) -> None:
    """It routes before the other one is there. Each session reads the record of its own router."""
    socket = f"unixsock-stream/{tmp_path}/link"
    near = Router(RouterOptions(("tcp/127.0.0.1:0", "tcp/[::1]:0"), (socket,)))
    try:
        assert near.endpoint.startswith("tcp/127.0.0.1:")
        with closing(_session(near)) as client:
            far = Router(RouterOptions((socket, "tcp/127.0.0.1:0")))
            try:
                with closing(connect(BusOptions(connect=socket), patience=LIMIT)) as server:
                    server.serve("word", NoRequest, lambda _: "heard")
                    wait_until_true(lambda: client.query("word", str) == [("word", "heard")])
                endpoints = (near.endpoint, socket)
                records = [read_admin(BusOptions(connect=endpoint)) for endpoint in endpoints]
                for endpoint, record in zip(endpoints, records, strict=True):
                    assert record is not None
                    assert endpoint in record.locators
            finally:
                far.close()
    finally:
        near.close()


def test_connections_that_say_nothing_keep_nobody_out() -> None:
    """A session comes in while 300 of them are open, three times as many as Zenoh takes by default."""
    router = Router(RouterOptions(("tcp/127.0.0.1:0",)))
    address = host_port(router.endpoint)
    assert address is not None

    def comes_in_beside_them() -> bool:
        with ExitStack() as silent:
            opened = [silent.enter_context(socket.create_connection(address, LIMIT)) for _ in range(300)]
            _session(router).close()
            # The router ends each after a while. One that it has ended has something to read.
            return not select.select(opened, [], [], 0.0)[0]  # noqa: TID251 - it does not wait

    with closing(router):
        assert any(comes_in_beside_them() for _ in range(5))
