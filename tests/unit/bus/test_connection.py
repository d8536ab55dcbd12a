"""What is said of a router, or of another program, with which no session can be opened."""

import shutil
import socket
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import msgspec
import pytest

from support.transports import RouterProcess
from zteam.bus import BusOptions, connect
from zteam.cli.doctor import check_router
from zteam.errors import BusError

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


@pytest.mark.parametrize("config", ["stranger", None])
def test_tls_without_a_certificate_has_its_own_line(start: Start, certificates: Path, config: str | None) -> None:
    """A router that takes known certificates only says so to a tool that has none; with one a tool joins."""
    router = start("tls/127.0.0.1:0", "--config", str(certificates / "router.json5"))
    text = refusal(router.endpoint, certificates / f"{config}.json5" if config else None)
    assert "do not trust each other's certificates" in text
    assert "--config" in text
    good = BusOptions(connect=router.endpoint, namespace="n", config=str(certificates / "client.json5"))
    connect(good, patience=10.0).close()
    found = check_router(good)
    assert found.good
    assert f"zteam-router at {router.endpoint}" in found.text


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
