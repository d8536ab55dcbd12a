"""The connection options: endpoints, namespaces, files of Zenoh's settings, and the certificates of the environment."""

import re
from pathlib import Path

import pytest

from zteam.bus import connect, connection
from zteam.bus.options import (
    TLS_VARIABLES,
    BusOptions,
    RouterOptions,
    TlsFiles,
    check_endpoint,
    check_namespace,
    client_config,
    router_config,
)
from zteam.bus.router import Router
from zteam.bus.transport import problem_of
from zteam.errors import BusError, UsageError, ZteamError

LOCAL = "tcp/127.0.0.1:7447"


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> TlsFiles:
    """Named in the environment."""
    found = TlsFiles(*(str(tmp_path / name) for name in ("ca.pem", "a.pem", "a.key")))
    for variable, path in found.environment.items():
        Path(path).write_text("PEM")
        monkeypatch.setenv(variable, path)
    return found


def test_three_variables_make_a_client_speak_tls_only(files: TlsFiles) -> None:
    """Client and router take no other protocol, and both show a certificate and ask for one."""
    options = BusOptions.from_environment()
    assert options == BusOptions(tls=files)
    assert options.endpoint == "tls/127.0.0.1:7447"
    for config in (client_config(options), router_config(RouterOptions(("tls/127.0.0.1:0",), tls=files))):
        assert config.get_json("transport/link/protocols") == '["tls"]'
        assert config.get_json("transport/link/tls/enable_mtls") == "true"
        assert config.get_json("transport/link/tls/verify_name_on_connect") == "true"


def test_some_of_the_variables_are_a_mistake(files: TlsFiles, monkeypatch: pytest.MonkeyPatch) -> None:
    """Half a configuration would be no protection; none of them is a plain process."""
    monkeypatch.delenv(TLS_VARIABLES[2])
    monkeypatch.setenv(TLS_VARIABLES[0], "")
    with pytest.raises(UsageError, match=r"ZTEAM_TLS_CA and ZTEAM_TLS_KEY: set .* or none of them"):
        BusOptions.from_environment()
    monkeypatch.delenv(TLS_VARIABLES[1])
    assert BusOptions.from_environment() == BusOptions()


def test_a_client_with_certificates_refuses_what_cannot_be(files: TlsFiles) -> None:
    """Another protocol, to which Zenoh would only not find the router, and a file that cannot be read, with its
    variable."""
    for endpoint in ("tcp/10.0.0.1:7447", "quic/10.0.0.1:7447"):
        with pytest.raises(UsageError, match=r"with ZTEAM_TLS_CA it must be tls/10\.0\.0\.1:7447"):
            client_config(BusOptions(connect=endpoint, tls=files))
    Path(files.key).unlink()
    with pytest.raises(UsageError, match=r"ZTEAM_TLS_KEY .*a\.key: No such file"):
        client_config(BusOptions.from_environment())


def test_a_process_may_give_up_without_a_router(monkeypatch: pytest.MonkeyPatch) -> None:
    """After the seconds that ZTEAM_GIVE_UP names, by default never; what is no time is refused."""
    assert BusOptions.from_environment().give_up is None
    monkeypatch.setenv("ZTEAM_GIVE_UP", "2.5")
    assert BusOptions.from_environment().give_up == 2.5
    with pytest.raises(BusError, match=r"no Zenoh router answers at tcp/127\.0\.0\.1:1"):
        connect(BusOptions(connect="tcp/127.0.0.1:1", give_up=0.1))
    monkeypatch.setenv("ZTEAM_GIVE_UP", "soon")
    with pytest.raises(UsageError, match=r"^ZTEAM_GIVE_UP "):
        BusOptions.from_environment()


@pytest.mark.parametrize(
    "endpoint",
    [
        LOCAL, "tls/my-host.lan:7447", "tcp/[::1]:7447", "tcp/[fe80::1%eth0]:0", "udp/Host:1", "ws/10.0.0.1:80",
        "tcp/10.0.0.1:7447?a=B#iface=Eth0", "unixsock-stream//tmp/x y",
        "vsock/2:7447", "unixpipe//tmp/x", "serial//dev/ttyUSB0#baudrate=9600",
    ],
)  # fmt: skip
def test_an_endpoint_of_zenoh_is_taken(endpoint: str) -> None:
    """As it is."""
    assert check_endpoint(endpoint) == endpoint


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("tcp://127.0.0.1:7447", LOCAL), ("http://127.0.0.1:7447", LOCAL), ("zenoh://127.0.0.1:7447/", LOCAL),
        ("TCP/127.0.0.1:7447", LOCAL), (" tcp/127.0.0.1:7447", LOCAL), ("tcp/127.0.0.1:7447\n", LOCAL),
        ("'tcp/127.0.0.1:7447'", LOCAL), ("tcp/127.0.0.1: 7447", LOCAL), (r"tcp\127.0.0.1:7447", LOCAL),
        ("tcp:127.0.0.1:7447", LOCAL), ("127.0.0.1:7447", LOCAL), ("127.0.0.1", LOCAL), ("7447", LOCAL),
        (":7447", LOCAL),
        ("localhost", "tcp/localhost:7447"), ("localhost:7448", "tcp/localhost:7448"), ("tcp/Pc", "tcp/Pc:7447"),
        ("tcp/::1:7447", "tcp/[::1]:7447"), ("[::1]", "tcp/[::1]:7447"), ("fe80::1", "tcp/[fe80::1]:7447"),
        ("TLS://pc:1?a=B#c=D", "tls/pc:1?a=B#c=D"), ("udp://pc:1", "udp/pc:1"), ("", LOCAL), ("tcp//", LOCAL),
        ("tcp:7447", LOCAL), ("tls", "tls/127.0.0.1:7447"), ("tcp:pc", "tcp/pc:7447"), ("tcp/pc:", "tcp/pc:7447"),
        ("pc:x", "tcp/pc:7447"), ("tcp/pc:99999", "tcp/pc:7447"), ("tcp/[::1]:", "tcp/[::1]:7447"),
        ("pc 7448", "tcp/pc:7448"), ("http://me@pc:1", "tcp/pc:1"), ("tcp/pc:1/x/y", "tcp/pc:1"),
        ("tcp/pc:7447:", "tcp/pc:7447"), ("pc:7448:", "tcp/pc:7448"), ("tls://pc:1:x", "tls/pc:1"),
    ],
)  # fmt: skip
def test_an_endpoint_as_people_write_it_is_refused_with_the_right_form(written: str, meant: str) -> None:
    """Which is one that is taken."""
    with pytest.raises(UsageError) as refused:
        check_endpoint(written)
    assert str(refused.value).endswith(f" {check_endpoint(meant)}")


@pytest.mark.parametrize(
    ("written", "place"),
    [
        ("tcp/127.0.0.1:99999", "port '99999'"), ("tcp/127.0.0.1:x", "port 'x'"),
        ("wss://pc:1", "one PROTOCOL/ADDRESS"), ("vsock:2:1", "one PROTOCOL/ADDRESS"),
        ("/tmp/x", "one PROTOCOL/ADDRESS"), ("tcp/a b c", "one PROTOCOL/ADDRESS"),
        ("tcp/my host:7447", "one PROTOCOL/ADDRESS"), ("tcp/http://pc:1", "one PROTOCOL/ADDRESS"),
        ("tcp/a:1,tcp/b:1", "one PROTOCOL/ADDRESS"), ('["tcp/a:1"]', "one PROTOCOL/ADDRESS"),
    ],
)  # fmt: skip
def test_an_endpoint_that_cannot_be_read_names_the_place(written: str, place: str) -> None:
    """In one line, with a form that is taken."""
    with pytest.raises(UsageError, match=place) as refused:
        check_endpoint(written)
    assert "\n" not in str(refused.value)


def test_a_host_that_nothing_knows_is_named() -> None:
    """And not taken for one without a router."""
    for host in ("no.such.host.invalid", "x" * 100):
        with pytest.raises(BusError, match=f"no host has the name '{re.escape(host)}'"):
            connect(BusOptions(connect=f"tcp/{host}:7447"), patience=0.0)
    for endpoint in ("tcp/127.0.0.1:9", "tcp/[::1]:9", "unixsock-stream//tmp/no/such"):
        with pytest.raises(BusError) as refused:
            connect(BusOptions(connect=endpoint), patience=0.0)
        assert "no host" not in str(refused.value)
    with pytest.raises(BusError, match=r"cannot listen at tcp/no\.such\.host\.invalid:7447"):
        Router(RouterOptions(("tcp/no.such.host.invalid:7447",)))


@pytest.mark.parametrize(
    ("written", "namespace"),
    [
        ("lab", "lab"),
        ("lab/", "lab"),
        ("/lab", "lab"),
        ("lab//a", "lab/a"),
        ("/", ""),
        ("", ""),
        ("lab/a-1_b", "lab/a-1_b"),
    ],
)
def test_a_namespace_loses_slashes_that_separate_nothing(
    written: str, namespace: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the command line and from the environment: the processes of a team meet, however it is written."""
    assert check_namespace(written, "--namespace") == namespace
    monkeypatch.setenv("ZTEAM_NAMESPACE", written)
    options = BusOptions.from_environment()
    assert client_config(options).get_json("namespace") == (f'"{namespace}"' if namespace else "null")


@pytest.mark.parametrize(
    "written", [" lab", "lab ", "lab/*", "a$b", "a?", "a#b", "@lab", "lab/@a", "lab\\", "..", "a\x07"]
)
def test_a_namespace_that_no_key_can_have_is_refused(written: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Before there is a session; a part that begins with @ would hide the team from a router that looks for it."""
    monkeypatch.setenv("ZTEAM_NAMESPACE", written)
    with pytest.raises(UsageError, match="namespace "):
        client_config(BusOptions.from_environment())


@pytest.mark.parametrize(
    ("name", "text", "place"),
    [
        ("a.json5", '{\n  mode: "nonsense"}', "line 2, column "), ("a.json5", "{\n\n  mode: [}", "line 3, column "),
        ("a.json5", "{nosuch: 1}", "line 1, column 2: unknown field"), ("a.json5", "", "Empty"),
        ("a.yaml", "a: b\nmode: [", "line 1, column 1: unknown field"),
        ("a.yaml", "connect:\n  endpoints: 5", "line 2, column 14: connect.endpoints: invalid"),
        ("a.yaml", "mode: client\n\tx: 1", "line 2, column 1: found a tab"), ("a.txt", "{}", "Unsupported file type"),
    ],
)  # fmt: skip
def test_what_zenoh_says_of_a_file_has_the_place_in_it(tmp_path: Path, name: str, text: str, place: str) -> None:
    """And not the one in Zenoh's source, on one line."""
    (tmp_path / name).write_text(text)
    with pytest.raises(UsageError) as refused:
        client_config(BusOptions(connect=LOCAL, config=str(tmp_path / name)))
    told = str(refused.value)
    assert f"{name}: {place}" in told
    assert not any(part in told for part in (".rs", ".cargo", "\n", "Message {", "Error("))


def test_no_word_of_zenoh_has_a_place_in_its_source(files: TlsFiles, tmp_path: Path) -> None:
    """Of a key, an endpoint of the file, a place to listen at, and settings that fit no file."""
    told = [problem_of("a//b"), problem_of("a/*b"), problem_of("#")]
    for fails in (
        lambda: Router(RouterOptions(("tcp/192.0.2.1:7447",))),
        lambda: connect(BusOptions(connect=LOCAL, namespace="a//b"), patience=0.0),
        lambda: Router(RouterOptions(("tls/127.0.0.1:0",), tls=files)),
    ):
        with pytest.raises(ZteamError) as refused:
            fails()
        told.append(str(refused.value))
    assert all(told)
    assert not [text for text in told if ".rs" in text or ".cargo" in text or "\n" in text]


def test_a_file_that_names_a_router_is_not_passed_over(tmp_path: Path) -> None:
    """The router on demand would be another one. With --connect that is the router; where the file listens never
    counts."""
    path = tmp_path / "a.json5"
    path.write_text('{connect: {endpoints: ["tcp/10.0.0.1:7447"]}, listen: {endpoints: ["tcp/127.0.0.1:7448"]}}')
    with pytest.raises(UsageError, match="--connect"):
        client_config(BusOptions(config=str(path)))
    config = client_config(BusOptions(connect=LOCAL, config=str(path)))
    assert [config.get_json(f"{way}/endpoints") for way in ("connect", "listen")] == [f'["{LOCAL}"]', "[]"]


def test_a_mistake_in_the_options_starts_no_router(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """None that stays behind when the process is refused."""
    path = tmp_path / "a.json5"
    path.write_text('{connect: {endpoints: ["tcp/10.0.0.1:7447"]}}')
    started: list[str] = []
    monkeypatch.setattr(connection, "port_accepts", lambda _endpoint: False)
    monkeypatch.setattr(connection, "spawn_router", lambda endpoint, _lease: started.append(endpoint))
    with pytest.raises(UsageError, match="--connect"):
        connect(BusOptions(config=str(path)))
    assert not started
