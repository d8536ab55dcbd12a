"""Opening a session: what is said where it cannot be opened, and a link that came back."""

import shutil
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import msgspec
import pytest

from support.limits import LIMIT
from support.transports import Inbox, RouterProcess, wait_until_true
from zteam.bus import Bus, BusOptions, NoRequest, connect, connection
from zteam.errors import BusError
from zteam.monitor.doctor.examination import check_router

_REQUEST = "req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -keyout {0}.key -subj /CN={0}"
_SIGN = "x509 -req -in {0}.csr -CA ca.pem -CAkey ca.key -CAcreateserial -out {0}.pem -extfile names"


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an authority and the certificates of a router and of a client."""
    if shutil.which("openssl") is None:
        pytest.skip("openssl is missing: it makes the certificates")
    folder = tmp_path_factory.mktemp("certificates")
    (folder / "names").write_text("subjectAltName=IP:127.0.0.1\nextendedKeyUsage=serverAuth,clientAuth\n")
    steps = [f"{_REQUEST.format('ca')} -x509 -out ca.pem"]
    for name in ("router", "client"):
        steps += [f"{_REQUEST.format(name)} -out {name}.csr", _SIGN.format(name)]
    for step in steps:
        subprocess.run(["openssl", *step.split()], cwd=folder, check=True, capture_output=True)
    _configure(folder, "router", {"listen_private_key": "router.key", "listen_certificate": "router.pem"})
    _configure(folder, "client", {"connect_private_key": "client.key", "connect_certificate": "client.pem"})
    _configure(folder, "stranger", {})
    return folder


def _configure(folder: Path, name: str, files: dict[str, str]) -> None:
    tls = {key: str(folder / file) for key, file in {"root_ca_certificate": "ca.pem", **files}.items()}
    config = {"transport": {"link": {"tls": {"enable_mtls": bool(files), **tls}}}}
    (folder / f"{name}.json5").write_bytes(msgspec.json.encode(config))


@pytest.fixture
def start() -> Iterator[Callable[..., RouterProcess]]:
    """Starts routers that end with the test."""
    with ExitStack() as ends:

        def start(*arguments: str) -> RouterProcess:
            router = RouterProcess(*arguments)
            ends.callback(router.kill)
            return router

        yield start


Start = Callable[..., RouterProcess]


def refusal(endpoint: str, config: Path | None = None) -> str:
    """Why a tool cannot join. The doctor says the same."""
    options = BusOptions(connect=endpoint, config=str(config) if config else None)
    with pytest.raises(BusError) as refused:
        connect(options, patience=0.0)
    found = check_router(options)
    assert f"{found.text}: {found.next_step}" == str(refused.value)
    return str(refused.value)


@pytest.mark.gate
@pytest.mark.parametrize("config", ["stranger", None])
def test_tls_without_a_certificate_has_its_own_line(start: Start, certificates: Path, config: str | None) -> None:
    """A router that takes known certificates only says so to a tool that has none; with one a tool joins."""
    router = start("tls/127.0.0.1:0", "--config", str(certificates / "router.json5"))
    text = refusal(router.endpoint, certificates / f"{config}.json5" if config else None)
    assert ("do not trust each other's certificates" if config else "takes certificates only, and this") in text
    assert "set ZTEAM_TLS_CA, ZTEAM_TLS_CERT, ZTEAM_TLS_KEY" in text
    good = BusOptions(connect=router.endpoint, namespace="n", config=str(certificates / "client.json5"))
    connect(good, patience=10.0).close()
    found = check_router(good)
    assert found.good
    assert f"zteam-router at {router.endpoint}" in found.text


@pytest.mark.gate
def test_plain_tcp_to_a_tls_port_has_its_own_line(start: Start, certificates: Path) -> None:
    """It names the endpoint that is right."""
    router = start("tls/127.0.0.1:0", "--config", str(certificates / "router.json5"))
    assert f"takes TLS only: use --connect {router.endpoint}" in refusal(router.endpoint.replace("tls/", "tcp/"))


@pytest.mark.ci
def test_tls_to_a_plain_port_has_its_own_line(start: Start) -> None:
    """It names the endpoint that is right."""
    router = start()
    text = refusal(router.endpoint.replace("tcp/", "tls/"))
    assert f"does not speak TLS: use --connect {router.endpoint}" in text


def test_a_router_that_wants_a_password_has_its_own_line(start: Start, tmp_path: Path) -> None:
    """A tool without one does not take the router for another program."""
    (tmp_path / "users").write_text("ann:secret\n")
    users = {"user": "ann", "password": "secret", "dictionary_file": str(tmp_path / "users")}
    (tmp_path / "router.json5").write_bytes(msgspec.json.encode({"transport": {"auth": {"usrpwd": users}}}))
    router = start("tcp/127.0.0.1:0", "--config", str(tmp_path / "router.json5"))
    assert "refuses this process: name in --config" in refusal(router.endpoint)


@pytest.mark.ci
def test_a_frozen_router_has_its_own_line(start: Start) -> None:
    """It is not taken for another program."""
    router = start()
    router.freeze()
    assert "takes connections but does not answer: a router there is frozen" in refusal(router.endpoint)


def test_connections_that_say_nothing_keep_no_tool_out(start: Start) -> None:
    """A tool joins a router that holds more of them than Zenoh's default of 100, while it holds them."""
    router = start()
    address = "127.0.0.1", int(router.endpoint.rpartition(":")[2])
    with ExitStack() as ends:
        links = [ends.enter_context(socket.create_connection(address)) for _ in range(200)]
        connect(BusOptions(connect=router.endpoint), patience=20.0).close()
        for link in links:
            link.setblocking(False)
            with pytest.raises(BlockingIOError):
                link.recv(1)


_KEEP_ALIVE = 4
_KIND = 0x1F


class HalfLink:
    """A wire to a router: its first link can be ended, and the next one is half, as a router makes it after a flood. Of
    the links in `half`, counted from 0, it passes only the handshake and signs of life to the client.
    """

    def __init__(self, endpoint: str, half: frozenset[int]) -> None:
        self._router = "127.0.0.1", int(endpoint.rpartition(":")[2])
        self._half = half
        self._server = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"tcp/127.0.0.1:{self._server.getsockname()[1]}"
        self._links: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        self._start(self._serve)

    def _start(self, work: Callable[..., None], *args: Any) -> None:
        thread = threading.Thread(target=work, args=args, daemon=True)
        self._threads.append(thread)
        thread.start()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._server.accept()
                router = socket.create_connection(self._router)
                is_half = len(self._links) in self._half
                self._links.append(client)
                self._start(self._link, client, router, is_half)

    def _link(self, client: socket.socket, router: socket.socket, is_half: bool) -> None:
        with client, router:
            up = threading.Thread(target=self._pass, args=(client, router, False), daemon=True)
            up.start()
            self._pass(router, client, is_half)
            up.join()

    @staticmethod
    def _pass(source: socket.socket, target: socket.socket, is_half: bool) -> None:
        """Pass batches, each behind its length, until one end closes."""
        with suppress(OSError, struct.error), source.makefile("rb") as stream:
            passed = 0
            while head := stream.read(2):
                batch = stream.read(struct.unpack("<H", head)[0])
                # The first two answer the handshake.
                if not is_half or passed < 2 or batch[0] & _KIND == _KEEP_ALIVE:
                    target.sendall(head + batch)
                passed += 1
        for end in (source, target):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def cut(self) -> None:
        """End the newest link."""
        with suppress(OSError):
            self._links[-1].shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """End all links, and accept no more."""
        self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        for client in self._links:
            with suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join()


@pytest.fixture
def router() -> Iterator[RouterProcess]:
    """A router of the test's own."""
    router = RouterProcess()
    yield router
    router.kill()


def answers(asker: Bus) -> bool:
    """Whether the session behind the wire answers a query."""
    try:
        return bool(asker.query("lamp/info", NoRequest, timeout=0.5))
    except BusError:
        return False


@pytest.fixture(autouse=True)
def _asks_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """The next question follows an answer soon."""
    monkeypatch.setattr(connection, "_LINK_PERIOD", 0.1)


@pytest.mark.gate
def test_a_link_that_came_back_half_is_ended_once_more(router: RouterProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    """The session answers queries again, over another link, after one on which nothing reached it."""
    monkeypatch.setattr(connection, "ROUTER_ANSWER", 0.5)
    wire = HalfLink(router.endpoint, half=frozenset({1}))
    asker, session = (
        connect(BusOptions(connect=endpoint, lease=LIMIT)) for endpoint in (router.endpoint, wire.endpoint)
    )
    told = Inbox()
    session.watch_link(told)
    try:
        session.serve("lamp/info", NoRequest, lambda _: NoRequest())
        wait_until_true(lambda: answers(asker))
        wire.cut()
        told.wait_for(True)
        wait_until_true(lambda: answers(asker))
        # Its listener may hear of the link a moment after the first answer.
        wait_until_true(lambda: len(told.items) >= 4)
        # A busy machine may fail to answer in time on the next link too, which is ended then as well.
        assert told.items[:4] == [False, True, False, True]
    finally:
        session.close()
        asker.close()
        wire.close()


ENDS = """
import sys, threading
from zteam.bus import BusOptions, connect, connection
options, asked, opened = BusOptions(connect=sys.argv[1]), threading.Event(), connection.open_session
def open_session(*arguments):
    asked.set()
    return opened(*arguments)
bus = connect(options)
connection.open_session = open_session
check = connection.LinkCheck(bus.transport, bus.transport._session, options)
bus.transport.before_close(check.wait)
threading.Thread(target=check.run, args=[lambda: not bus.transport.closed], daemon=True).start()
asked.wait()
bus.close()
"""


@pytest.mark.ci
def test_a_process_may_end_while_its_link_is_looked_at(router: RouterProcess) -> None:
    """Just after its link came back; the interpreter would end the thread within Zenoh, which aborts the process."""
    command = [sys.executable, "-c", ENDS, router.endpoint]
    assert [subprocess.run(command, timeout=LIMIT, check=False).returncode for _ in range(4)] == [0] * 4


@pytest.mark.gate
def test_a_whole_link_is_kept(
    router: RouterProcess, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A link that came back whole is not ended."""
    ended: list[object] = []
    monkeypatch.setattr(connection, "cut", ended.append)
    wire = HalfLink(router.endpoint, half=frozenset())
    session, told = connect(BusOptions(connect=wire.endpoint, lease=LIMIT)), Inbox()
    try:
        session.watch_link(told)
        wire.cut()
        # A router that still holds the last link ends the next one by itself, and then Zenoh opens a third.
        told.wait_for(True)
        wait_until_true(lambda: "link" not in [thread.name for thread in threading.enumerate()])
        assert told.items[:2] == [False, True]
        assert ended == []
        assert "no query" not in caplog.text
    finally:
        session.close()
        wire.close()
