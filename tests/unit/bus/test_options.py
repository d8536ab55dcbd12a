"""The connection options that the environment gives: certificates."""

from pathlib import Path

import pytest

from zteam.bus import connect
from zteam.bus.options import (
    TLS_VARIABLES,
    BusOptions,
    RouterOptions,
    TlsFiles,
    client_config,
    router_config,
)
from zteam.errors import BusError, UsageError


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
