"""The routers of this machine."""

import json
import logging
import select
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from itertools import count
from pathlib import Path

import msgspec
import pytest
import zenoh

from support.certificates import Authority
from support.limits import LIMIT
from support.transports import wait_until_true
from zteam.bus import Bus, BusOptions, NoRequest, connect, transport
from zteam.bus.options import RELEASE, Owner, RouterOptions, client_config, host_port, open_session, port_accepts
from zteam.bus.router import PortInUseError, ReleaseRequest, Router, find_local_routers, open_team_router, read_admin
from zteam.names import token_key


@pytest.mark.parametrize("folder", ["there", "missing", "closed"])
def test_a_router_is_found_as_long_as_it_runs(folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the endpoint at which it listens; what a killed one has left behind is removed. Without a folder for its state
    it makes one if it can, else it works all the same."""
    (tmp_path / "there").mkdir()
    (tmp_path / "closed").write_text("no folder")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / folder))
    with closing(Router(RouterOptions(("tcp/127.0.0.1:0",)))) as router:
        connect(BusOptions(connect=router.endpoint), patience=LIMIT).close()
        assert find_local_routers() == ([] if folder == "closed" else [router.endpoint])
        if folder != "closed":
            (tmp_path / folder / "zteam" / "router-1.endpoint").write_text("tcp/127.0.0.1:1")
            assert find_local_routers() == [router.endpoint]
    assert find_local_routers() == []
    assert not list(tmp_path.glob("*/*/router-*"))


def _session(router: Router, namespace: str | None = None) -> Bus:
    return connect(BusOptions(connect=router.endpoint, namespace=namespace), patience=LIMIT)


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


@pytest.mark.gate
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


@contextmanager
def on_demand(endpoint: str = "tcp/127.0.0.1:0") -> Iterator[Router]:
    """A router on demand in this process. It ends with the test, or when it has given its port up."""
    router, stop = Router(RouterOptions((endpoint,), idle_exit=LIMIT)), threading.Event()

    def run() -> None:
        router.run(stop.is_set)
        router.close()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield router
    finally:
        stop.set()
        router.wake()
        thread.join(LIMIT)
        assert not thread.is_alive()


def sessions_at(endpoint: str) -> set[str]:
    """The sessions of the clients of a router."""
    record = read_admin(BusOptions(connect=endpoint))
    return {each.peer for each in record.sessions} if record else set()


def show(client: Bus, name: str, other: Bus) -> None:
    """Hold a name, and wait until the router has shown its token to another session."""
    seen = threading.Event()
    other.watch_tokens([f"**/{token_key(name, client.instance)}"], lambda _key, _alive: seen.set())
    client.declare_token(token_key(name, client.instance))
    assert seen.wait(LIMIT)


@pytest.mark.few(4)
@pytest.mark.parametrize("namespace", [None, "lab/mine"])
@pytest.mark.parametrize(
    ("name", "is_team"),
    [
        *((name, False) for name in ("", "crowd", "monitor", "view_12ab34", "goals", "map", "robot_x", "simulation")),
        *((name, True) for name in ("robot_3", "sim", "nav_0", "base_1", "tf", "up")),
    ],
)
def test_a_team_gets_the_port_from_a_router_without_a_team(name: str, is_team: bool, namespace: str | None) -> None:
    """Its clients have come over when the team's router is open; beside a team that router takes another port."""
    with on_demand() as router, closing(_session(router, namespace)) as client, closing(_session(router)) as other:
        if name:
            show(client, name, other)
        with closing(open_team_router(RouterOptions((router.endpoint,)))) as team:
            assert (team.endpoint == router.endpoint) is not is_team
            assert client.instance in sessions_at(router.endpoint)


@pytest.mark.parametrize("holder", ["a program", "a router that was started by hand"])
def test_another_programs_port_is_not_taken(holder: str) -> None:
    """The team's router takes another port. The program that holds the default port keeps it, used or not."""
    with ExitStack() as ends:
        if holder == "a program":
            server = ends.enter_context(socket.create_server(("127.0.0.1", 0)))
            endpoint = f"tcp/127.0.0.1:{server.getsockname()[1]}"
        else:
            endpoint = ends.enter_context(closing(Router(RouterOptions(("tcp/127.0.0.1:0",))))).endpoint
        with closing(open_team_router(RouterOptions((endpoint,)))) as team:
            assert team.endpoint != endpoint
        assert port_accepts(endpoint)


@pytest.mark.parametrize("is_idle", [True, False])
def test_a_secure_team_gets_the_port_only_where_no_client_is(is_idle: bool, tmp_path: Path) -> None:
    """A client without a certificate could not come over."""
    tls = Authority(tmp_path).issue("router", server=True)
    with on_demand() as router, ExitStack() as stack:
        if not is_idle:
            client = stack.enter_context(closing(_session(router)))
            wait_until_true(lambda: client.instance in sessions_at(router.endpoint))
        endpoint = router.endpoint.replace("tcp/", "tls/")
        with closing(open_team_router(RouterOptions((endpoint,), tls=tls))) as team:
            assert (team.endpoint == endpoint) is is_idle


@pytest.mark.gate
def test_of_two_teams_at_once_one_gets_the_port() -> None:
    """The other one's router takes another port, and both run."""
    opened: list[Router] = []
    with on_demand() as router, closing(_session(router)) as client:
        options = RouterOptions((router.endpoint,))
        threads = [threading.Thread(target=lambda: opened.append(open_team_router(options))) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(LIMIT)
        try:
            assert [team.endpoint == router.endpoint for team in opened].count(True) == 1
            assert all(read_admin(BusOptions(connect=team.endpoint)) for team in opened)
            wait_until_true(lambda: client.instance in sessions_at(router.endpoint))
        finally:
            for team in opened:
                team.close()


_REQUEST = ReleaseRequest(Owner.of_this_process(), "0", secure=False)
_LONG = msgspec.structs.replace(_REQUEST, session="0" * 200)
_FOREIGN = msgspec.structs.replace(_REQUEST, owner=Owner(uid=12345, pid_namespace=_REQUEST.owner.pid_namespace))


@pytest.mark.parametrize(
    "request_",
    [b"", b"7", b'{"uid": "0", "session": "\xff", "secure": 1}', *map(msgspec.json.encode, (_LONG, _FOREIGN))],
)
def test_a_router_keeps_its_port_from_nonsense_and_from_other_users(
    request_: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither what cannot be read nor what is too long ends it; a team that is answered nonsense goes on, too."""
    with on_demand() as router, closing(_session(router)) as client, ExitStack() as ends:
        config = client_config(BusOptions(connect=router.endpoint))
        stranger = ends.enter_context(open_session(config, "usual"))
        with monkeypatch.context() as patched:
            patched.setattr(transport, "MAX_PAYLOAD", len(msgspec.json.encode(_FOREIGN)))
            (reply,) = stranger.get(RELEASE, payload=request_)
        assert reply.ok is not None and reply.ok.payload.to_bytes() == b"null"
        assert client.instance in sessions_at(router.endpoint)

        def answer(query: zenoh.Query) -> None:
            with query:
                query.reply(RELEASE, request_)

        ends.callback(stranger.declare_queryable(RELEASE, answer).undeclare)
        with closing(open_team_router(RouterOptions((router.endpoint,)))) as team:
            assert read_admin(BusOptions(connect=team.endpoint)) is not None


def test_a_teams_router_that_returns_gets_its_port_back() -> None:
    """A client may have started one on demand at its port, where the team's own processes are; all else keeps it."""
    with on_demand() as router, closing(_session(router)) as simulator, closing(_session(router)) as other:
        show(simulator, "sim", other)
        options = RouterOptions((router.endpoint,))
        with closing(open_team_router(msgspec.structs.replace(options, for_team="returns"))) as team:
            assert team.endpoint == router.endpoint
            wait_until_true(lambda: simulator.instance in sessions_at(team.endpoint))
            with pytest.raises(PortInUseError):
                open_team_router(msgspec.structs.replace(options, for_team="returns"))


def test_the_routers_process_needs_no_numpy() -> None:
    """It is on the way of every first command, and starts twice as fast without."""
    script = "import sys, zteam.node.router; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], timeout=LIMIT, check=False).returncode == 0
