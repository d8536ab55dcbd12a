"""What is said where mutual TLS fails: one line each, with the way out."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import msgspec
import pytest

from support.certificates import Authority
from support.transports import RouterProcess, rogue_router
from zteam.bus.connection import connect
from zteam.bus.options import BusOptions, RouterOptions, TlsFiles, try_open
from zteam.bus.router import Router
from zteam.bus.tls import own_fault
from zteam.errors import BusError, ZteamError


class Files(NamedTuple):
    """Certificates of two authorities."""

    router: TlsFiles
    good: TlsFiles
    expired: TlsFiles
    stranger: TlsFiles
    """Of the other authority."""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    """In a folder of their own."""
    folder = tmp_path_factory.mktemp("certificates")
    team, other = Authority(folder / "team"), Authority(folder / "other")
    return Files(
        team.issue("router", server=True),
        team.issue("robot_1"),
        team.issue("old", "robot_1.1", days=-1.0, server=True),
        other.issue("robot_1", server=True),
    )


def test_a_good_certificate_has_no_fault(files: Files) -> None:
    """Nothing is said of it."""
    assert own_fault(files.good) == ""


def test_each_fault_of_the_files_has_its_line(files: Files, tmp_path: Path) -> None:
    """It needs no router, and names the file."""
    good, replace = files.good, msgspec.structs.replace
    (tmp_path / "text").write_text("no certificate")
    text = str(tmp_path / "text")
    assert own_fault(files.expired) == (
        f"ZTEAM_TLS_CERT {files.expired.certificate} has expired: renew it with 'zteam certs renew NAME'"
    )
    mixed = replace(files.stranger, ca=good.ca)
    assert f"{mixed.certificate} is not of the authority in {good.ca}" in own_fault(mixed)
    swapped = replace(good, key=files.router.key)
    assert own_fault(swapped) == f"ZTEAM_TLS_KEY {swapped.key} is not the key of ZTEAM_TLS_CERT {good.certificate}"
    for fault in (own_fault(replace(good, **{field: text})) for field in ("ca", "certificate", "key")):
        assert text in fault
        assert "is no PEM file" in fault


@pytest.mark.parametrize(
    ("which", "text"),
    [("expired", "has expired"), ("stranger", "is not of the authority"), ("good", "is not that of a router")],
)
def test_a_router_does_not_start_with_a_faulty_certificate(files: Files, which: str, text: str) -> None:
    """No client would accept it."""
    faulty = msgspec.structs.replace(getattr(files, which), ca=files.router.ca)
    with pytest.raises(BusError, match=rf"ZTEAM_TLS_CERT \S+ {text}"):
        Router(RouterOptions(("tls/127.0.0.1:0",), tls=faulty))


@pytest.mark.few(1)
@pytest.mark.parametrize("host", ["127.0.0.1", "localhost"])
def test_no_process_joins_a_router_with_the_certificate_of_another_process(files: Files, host: str) -> None:
    """Whether it names the router by address or by name; the line names the certificate, and the way out."""
    with rogue_router(files.good) as endpoint:
        endpoint = endpoint.replace("127.0.0.1", host)
        assert try_open(BusOptions(connect=endpoint, tls=files.good)) is None
        assert refusal(endpoint, files.good) == (
            f"the router at {endpoint} and this process do not trust each other: its certificate robot_1.1 is not that "
            "of a router: end the program that has taken the router's port ('ss -ltnp' on its host names it)"
        )


@pytest.fixture(scope="module")
def endpoint(files: Files) -> Iterator[str]:
    """Of a router that takes certificates only."""
    router = RouterProcess("tls/127.0.0.1:0", tls=files.router)
    yield router.endpoint
    router.kill()


def refusal(endpoint: str, tls: TlsFiles | None) -> str:
    """The line that a tool prints."""
    with pytest.raises(ZteamError) as refused:
        connect(BusOptions(connect=endpoint, tls=tls), patience=0.0)
    return str(refused.value)


@pytest.mark.ci
def test_each_refusal_has_its_line(files: Files, endpoint: str) -> None:
    """Another authority, an expired certificate, none, no TLS, and TLS where there is none; a good one joins."""
    trust = f"the router at {endpoint} and this process do not trust each other"
    assert f"{trust}: its certificate is not of the authority" in refusal(endpoint, files.stranger)
    assert "has expired: renew it" in refusal(endpoint, files.expired)
    assert "takes certificates only, and this process has none: set ZTEAM_TLS_CA" in refusal(endpoint, None)
    plain = endpoint.replace("tls/", "tcp/")
    assert f"takes TLS only: use --connect {endpoint}, and set ZTEAM_TLS_CA" in refusal(plain, None)
    assert f"with ZTEAM_TLS_CA it must be {endpoint}" in refusal(plain, files.good)
    without = RouterProcess()
    try:
        line = refusal(without.endpoint.replace("tcp/", "tls/"), files.good)
    finally:
        without.kill()
    assert f"does not speak TLS: use --connect {without.endpoint}, without ZTEAM_TLS_CA" in line
    connect(BusOptions(connect=endpoint, tls=files.good), patience=10.0).close()
