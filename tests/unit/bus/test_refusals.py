"""Why a process gets no session: one line each, with the way out."""

import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from socketserver import BaseRequestHandler, TCPServer
from typing import NamedTuple

import msgspec
import pytest

from support.certificates import Authority
from support.limits import LIMIT
from support.transports import rogue_router
from zteam.bus import BusOptions, connect, connection
from zteam.bus.connection import Reasons, why_refused
from zteam.bus.options import RouterOptions, TlsFiles
from zteam.bus.router import Router
from zteam.bus.tls import own_fault, own_identity
from zteam.errors import BusError
from zteam.monitor.doctor.examination import check_router


class Files(NamedTuple):
    """Certificates of two authorities."""

    router: TlsFiles
    good: TlsFiles
    expired: TlsFiles
    stranger: TlsFiles
    """Of the other authority."""
    mixed: TlsFiles
    """Of the other authority, with the team's own as authority."""
    swapped: TlsFiles
    """With the key of another certificate."""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    """In a folder of their own."""
    folder = tmp_path_factory.mktemp("certificates")
    team, other = Authority(folder / "team"), Authority(folder / "other")
    router, good = team.issue("router", server=True), team.issue("robot_1")
    stranger = other.issue("robot_1", server=True)
    replace = msgspec.structs.replace
    return Files(
        router,
        good,
        team.issue("old", "robot_1.1", days=-1.0, server=True),
        stranger,
        replace(stranger, ca=good.ca),
        replace(good, key=router.key),
    )


@pytest.mark.parametrize(
    ("which", "words"),
    [
        ("good", ()),
        ("router", ()),
        ("expired", ("ZTEAM_TLS_CERT", "(certificate has expired): ", "zteam certs renew")),
        ("mixed", ("ZTEAM_TLS_CERT", " is not accepted (", "docs/security.md")),
        ("swapped", ("ZTEAM_TLS_KEY", "is not the key of ZTEAM_TLS_CERT")),
    ],
)
def test_each_fault_of_the_files_is_found_without_a_router(files: Files, which: str, words: tuple[str, ...]) -> None:
    """The line names the file, and a process with it ends instead of waiting; a good one has no fault."""
    tls: TlsFiles = getattr(files, which)
    fault = own_fault(tls)
    assert bool(fault) == bool(words)
    assert all(word in fault for word in words), fault
    if words:
        with pytest.raises(BusError) as refused:
            connect(BusOptions("tls/127.0.0.1:1", tls=tls), patience=LIMIT)
        assert str(refused.value) == fault


@pytest.mark.parametrize("field", ["ca", "certificate", "key"])
def test_a_file_that_is_no_certificate_is_named(files: Files, field: str, tmp_path: Path) -> None:
    """Whichever of the three it is; the certificate then has no name."""
    (tmp_path / "text").write_text("no certificate")
    tls = msgspec.structs.replace(files.good, **{field: str(tmp_path / "text")})
    assert f"{tmp_path}/text" in own_fault(tls)
    assert own_identity(tls) == ("", 0.0)
    assert "no PEM file" in own_fault(tls)


@pytest.mark.parametrize("which", ["expired", "stranger", "good"])
def test_a_router_does_not_start_with_a_faulty_certificate(files: Files, which: str) -> None:
    """No client would accept it, nor one that is good for a client only."""
    faulty = msgspec.structs.replace(getattr(files, which), ca=files.router.ca)
    with pytest.raises(BusError, match=r"ZTEAM_TLS_CERT \S+ is not accepted"):
        Router(RouterOptions(("tls/127.0.0.1:0",), tls=faulty))


@pytest.fixture
def endpoint(request: pytest.FixtureRequest, files: Files, tmp_path: Path) -> Iterator[str]:
    """Of what listens: a router with or without certificates, one that asks for a password, or another program."""
    users = {"user": "ann", "password": "secret", "dictionary_file": str(tmp_path / "users")}
    (tmp_path / "users").write_text("ann:secret\n")
    (tmp_path / "router.json5").write_bytes(msgspec.json.encode({"transport": {"auth": {"usrpwd": users}}}))
    with ExitStack() as ends:
        match request.param:
            case "secure":
                router = Router(RouterOptions(("tls/127.0.0.1:0",), tls=files.router))
            case "impostor":
                yield ends.enter_context(rogue_router(files.good))
                return
            case "password":
                router = Router(RouterOptions(("tcp/127.0.0.1:0",), config=str(tmp_path / "router.json5")))
            case "program":
                hangs_up = ends.enter_context(TCPServer(("127.0.0.1", 0), BaseRequestHandler))
                threading.Thread(target=hangs_up.serve_forever, daemon=True).start()
                ends.callback(hangs_up.shutdown)
                yield f"tcp/127.0.0.1:{hangs_up.server_address[1]}"
                return
            case "silence":
                server = ends.enter_context(socket.create_server(("127.0.0.1", 0)))
                yield f"tcp/127.0.0.1:{server.getsockname()[1]}"
                return
        ends.enter_context(closing(router))
        yield router.endpoint


@pytest.mark.parametrize(
    ("endpoint", "which", "words"),
    [
        ("secure", "stranger", ("do not trust each other: its certificate is not accepted (",)),
        ("secure", "expired", ("ZTEAM_TLS_CERT", "certificate has expired")),
        ("secure", "", ("takes certificates only: use --connect tls/127.0.0.1:", "set ZTEAM_TLS_CA")),
        ("impostor", "good", ("do not trust each other: its certificate is not accepted (",)),
        ("password", "", ("refuses this process: use --connect tcp/127.0.0.1:", "--config")),
        ("password", "good", ("has no certificates", "use --connect tcp/127.0.0.1:")),
        ("program", "", ("does not speak Zenoh: ", "--connect")),
        ("silence", "", ("takes connections but does not answer: ", "--connect")),
    ],
    indirect=["endpoint"],
)
def test_each_refusal_has_its_line(
    endpoint: str, which: str, words: tuple[str, ...], files: Files, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The reason and the step: with certificates, a password or another program at the endpoint."""
    monkeypatch.setattr(connection, "ANSWER_WITHIN", 0.5)
    tls = getattr(files, which) if which else None
    line = ": ".join(why_refused(BusOptions(endpoint.replace("tcp/", "tls/") if tls else endpoint, tls=tls)))
    assert all(word in line for word in words), line


@pytest.mark.parametrize("endpoint", ["secure"], indirect=True)
def test_a_tool_and_the_doctor_print_the_same_line(endpoint: str, files: Files) -> None:
    """With a good certificate the tool joins, and the doctor names the router."""
    options = BusOptions(endpoint, tls=files.stranger)
    with pytest.raises(BusError) as refused:
        connect(options, patience=0.0)
    found = check_router(options)
    assert f"{found.text}: {found.next_step}" == str(refused.value) == ": ".join(why_refused(options))
    options = BusOptions(endpoint, tls=files.good)
    connect(options, patience=LIMIT).close()
    assert f"zteam-router at {endpoint}" in check_router(options).text
    assert own_identity(files.good)[0] == "robot_1.1"


def test_a_reason_is_given_once_and_again_when_it_has_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The pause between two looks doubles up to a minute, so that looks do not keep a team out."""
    now, reason = 0.0, "frozen"
    monkeypatch.setattr(connection, "monotonic", lambda: now)
    looked, given = list[float](), list[tuple[float, str | None]]()
    monkeypatch.setattr(connection, "port_accepts", lambda _: looked.append(now) or not 130.0 < now < 190.0)
    monkeypatch.setattr(connection, "why_refused", lambda _options: (reason, "wait"))
    reasons = Reasons(BusOptions(), 1.0)
    for now in (0.5 * half for half in range(500)):
        reason = "frozen" if now < 20.0 else "held"
        if (said := reasons.look()) is not None:
            given.append((now, said))
    assert looked == [1.0, 6.0, 16.0, 36.0, 76.0, 136.0, 196.0]
    assert given == [(1.0, "frozen: wait"), (36.0, "held: wait"), (136.0, ""), (196.0, "held: wait")]


@pytest.mark.parametrize("endpoint", ["udp/127.0.0.1:7459", "unixsock-stream//tmp/zteam-none"])
def test_no_reason_is_given_for_an_endpoint_of_another_protocol(endpoint: str) -> None:
    """Only over TCP it can be seen that another program listens there."""
    assert Reasons(BusOptions(connect=endpoint), 0.0).look() == ""
