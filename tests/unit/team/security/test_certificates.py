"""The folder of a team's certificates. Whether a router heeds them is a matter of tests/team."""

import json
import math
import os
import ssl
import stat
from collections.abc import Callable
from datetime import timedelta  # noqa: TID251 - of certificates
from itertools import count
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import serialization

from zteam.errors import UsageError, ZteamError
from zteam.monitor.doctor import examination
from zteam.team.security import certificates
from zteam.team.security.access import Rights
from zteam.team.security.certificates import (
    ACCESS,
    CA,
    CA_KEY,
    INDEX,
    MAX_DAYS,
    files_of,
    load_certificate,
    name_in,
    now,
    open_authority,
    prepare,
    read_index,
)

RIGHTS = {name: Rights(publishes=(f"{name}/**",)) for name in ("router", "robot_1", "robot_2", "operator")}
DAY_NS = 86_400 * 10**9


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Certificates of a router and three others."""
    place = tmp_path / "certs"
    assert prepare(place, "mine.toml", RIGHTS, "", RIGHTS) == []
    return place


@pytest.fixture
def later(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Lets days pass."""
    begin = certificates.wall_ns()

    def pass_days(days: float) -> None:
        for module in (certificates, examination):
            monkeypatch.setattr(module, "wall_ns", lambda: begin + round(days * DAY_NS))

    return pass_days


def common_names(folder: Path) -> dict[str, list[str]]:
    """Those that the router lets in, by name."""
    section = json.loads((folder / ACCESS).read_text())["access_control"]
    assert section["default_permission"] == "deny"
    return {subject["id"]: subject["cert_common_names"] for subject in section["subjects"]}


def load(folder: Path, name: str) -> x509.Certificate:
    """A certificate; its key fits, and the authority has signed it."""
    found = x509.load_pem_x509_certificate((folder / f"{name}.pem").read_bytes())
    found.verify_directly_issued_by(x509.load_pem_x509_certificate((folder / CA).read_bytes()))
    content = (folder / f"{name}.key").read_bytes()
    assert content.startswith(b"-----BEGIN PRIVATE KEY-----"), "PKCS8"
    assert serialization.load_pem_private_key(content, None).public_key() == found.public_key()
    return found


def common_name(path: Path) -> str:
    """That of a certificate in a file."""
    return name_in(load_certificate(path))


def uses_and_names(folder: Path, name: str) -> tuple[set[str], list[str]]:
    """The extended key usages of a certificate, and the names and addresses for which it stands."""
    extensions, names = load(folder, name).extensions, list[str]()
    uses = extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
    for each in extensions:
        if isinstance(each.value, x509.SubjectAlternativeName):
            addresses = map(str, each.value.get_values_for_type(x509.IPAddress))
            names += [*each.value.get_values_for_type(x509.DNSName), *addresses]
    return {use.dotted_string for use in uses}, names


SERVER, CLIENT = "1.3.6.1.5.5.7.3.1", "1.3.6.1.5.5.7.3.2"


def test_only_the_router_has_a_certificate_of_a_server(folder: Path) -> None:
    """It stands for loopback and the hosts that were named; all others are clients, and stand for no host."""
    with open_authority(folder) as authority:
        authority.issue(["router", "robot_1"], ["machine-b", "10.0.0.2", "::1"])
    assert common_name(folder / "robot_1.pem") == "robot_1.2"
    hosts = ["localhost", "router", "machine-b", "127.0.0.1", "10.0.0.2", "::1"]
    assert uses_and_names(folder, "router") == ({SERVER, CLIENT}, hosts)
    for name in ("robot_1", "robot_2", "operator"):
        assert uses_and_names(folder, name) == ({CLIENT}, [])


def test_a_strict_client_takes_the_certificates(folder: Path) -> None:
    """OpenSSL, asked for all that RFC 5280 demands, agrees with a link between the router and another process."""
    server, client = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER), ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    server.verify_mode = ssl.CERT_REQUIRED
    for context, name in ((server, "router"), (client, "robot_2")):
        files = files_of(folder, name)
        context.verify_flags |= ssl.VERIFY_X509_STRICT
        context.load_verify_locations(files.ca)
        context.load_cert_chain(files.certificate, files.key)
    to_server, to_client = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = [
        client.wrap_bio(to_client, to_server, server_hostname="127.0.0.1"),
        server.wrap_bio(to_server, to_client, server_side=True),
    ]
    for end in (*ends, *ends, ends[0]):
        try:
            end.do_handshake()
        except ssl.SSLWantReadError:
            # The other end has its turn.
            continue
    subjects = [dict(pair for (pair,) in end.getpeercert()["subject"])["commonName"] for end in ends]  # type: ignore[index]
    assert subjects == ["router.1", "robot_2.1"]


def test_only_the_owner_reads_the_folder(folder: Path) -> None:
    """The folder is 0700 and each file 0600, whatever the umask."""
    before = os.umask(0)
    try:
        with open_authority(folder) as authority:
            authority.issue(["robot_1"])
    finally:
        os.umask(before)
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    assert {path.name: stat.S_IMODE(path.stat().st_mode) for path in folder.iterdir()} == dict.fromkeys(
        [CA, CA_KEY, INDEX, ACCESS, *(f"{name}.{ending}" for name in RIGHTS for ending in ("pem", "key"))], 0o600
    )


@pytest.mark.ci
def test_an_interruption_leaves_nothing_half(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever the making of an authority, a certificate and the next one is broken off, going on mends it."""
    write, left = os.fsync, [math.inf]

    def limited(descriptor: int) -> None:
        """As if the process were killed: no file is finished from then on."""
        write(descriptor)
        left[0] -= 1
        if left[0] <= 0:
            raise KeyboardInterrupt

    monkeypatch.setattr(certificates.os, "fsync", limited)
    for number in count(1):
        left[0], place = number, tmp_path / str(number)
        try:
            prepare(place, "", RIGHTS, "", ["robot_1"])
            with open_authority(place) as authority:
                authority.issue(["robot_1"])
            break
        except KeyboardInterrupt:
            left[0] = math.inf
        for path in place.glob("*.pem"):
            common_name(path)
        prepare(place, "", RIGHTS, "", ["robot_1"])
        issued = read_index(place).certificates["robot_1"][-1]
        assert common_name(place / "robot_1.pem") == f"robot_1.{issued.serial}"
        assert f"robot_1.{issued.serial}" in common_names(place)["robot_1"]
        load(place, "robot_1")
    assert number > 10


def test_a_revoked_certificate_is_not_let_in(folder: Path) -> None:
    """The next one is; one of several can be taken back alone."""

    def issue() -> None:
        with open_authority(folder) as authority:
            authority.issue(["robot_1"])

    def revoke(serial: int | None = None) -> list[int]:
        with open_authority(folder) as authority:
            return authority.revoke("robot_1", serial)

    issue()
    assert common_names(folder)["robot_1"] == ["robot_1.1", "robot_1.2"]
    assert revoke(1) == [1]
    assert common_names(folder)["robot_1"] == ["robot_1.2"]
    assert revoke() == [2]
    assert "robot_1" not in common_names(folder)
    assert common_names(folder)["robot_2"] == ["robot_2.1"]
    with pytest.raises(ZteamError, match="zteam certs issue robot_1"):
        prepare(folder, "", RIGHTS, "", ["robot_1"])
    issue()
    assert common_names(folder)["robot_1"] == ["robot_1.3"]


def test_another_team_keeps_the_authority(folder: Path) -> None:
    """Its rights are those of the new team; a name that is left has its certificate still."""
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    rights = {"robot_2": Rights(), "robot_7": Rights()}
    prepare(folder, "other.toml", rights, "fleet", rights)
    after = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert {name for name in after if after[name] != before.get(name)} == {INDEX, ACCESS, "robot_7.pem", "robot_7.key"}
    assert common_names(folder) == {"robot_2": ["robot_2.1"], "robot_7": ["robot_7.1"]}
    assert (read_index(folder).rights, read_index(folder).namespace) == (rights, "fleet")


def test_the_list_of_the_router_changes_only_with_what_it_says(folder: Path) -> None:
    """A router opens all links again when the file is a new one."""
    before = (folder / ACCESS).stat().st_ino
    prepare(folder, "mine.toml", RIGHTS, "", RIGHTS)
    assert (folder / ACCESS).stat().st_ino == before


def test_a_certificate_that_ends_is_told_in_time(folder: Path, later: Callable[[float], None]) -> None:
    """From 14 days before on; then a team does not start with it."""
    issued = read_index(folder).certificates["robot_1"][0]
    later(350)
    assert issued.state == "valid"
    later(352)
    assert issued.state == "expires_soon"
    (line,) = prepare(folder, "", RIGHTS, "", ["robot_1"])
    assert line.startswith("the certificate robot_1.1 expires on ")
    assert line.endswith(f": zteam certs renew robot_1 --folder {folder}")
    later(366)
    assert issued.state == "expired"
    with pytest.raises(ZteamError, match=r"robot_1\.1 has expired on .*: zteam certs renew robot_1"):
        prepare(folder, "", RIGHTS, "", ["robot_1"])


def test_no_certificate_outlives_the_authority(folder: Path, later: Callable[[float], None]) -> None:
    """When that has ended none can be issued."""
    later(MAX_DAYS - 5)
    with open_authority(folder) as authority:
        (issued,) = authority.issue(["robot_1"])
        assert issued.expires - now() < timedelta(days=5)
    later(MAX_DAYS + 1)
    with open_authority(folder) as authority, pytest.raises(ZteamError, match=r"ca.pem has expired on .* remove the "):
        authority.issue(["robot_1"])


def test_a_folder_of_copies_is_enough_to_start(folder: Path) -> None:
    """Without the authority's key nothing is made; what is missing is named."""
    (folder / CA_KEY).unlink()
    assert prepare(folder, "", RIGHTS, "", ["robot_1"]) == []
    (folder / "robot_2.key").unlink()
    with pytest.raises(ZteamError, match=r"copy robot_2.pem and robot_2.key"):
        prepare(folder, "", RIGHTS, "", ["robot_1", "robot_2"])
    with open_authority(folder) as authority, pytest.raises(ZteamError, match=CA_KEY):
        authority.issue(["robot_1"])


@pytest.mark.parametrize(("name", "hosts"), [("robot_9", ()), ("robot_1", ("a b",)), ("robot_1", ("",))])
def test_a_wrong_word_issues_nothing(folder: Path, name: str, hosts: tuple[str, ...]) -> None:
    """A name without rights, and what is no name of a machine."""
    with open_authority(folder) as authority, pytest.raises(UsageError):
        authority.issue([name], hosts)
    assert {name: len(found) for name, found in read_index(folder).certificates.items()} == dict.fromkeys(RIGHTS, 1)


@pytest.mark.parametrize("name", ["n" * 51, "clock", "ca"])
def test_a_name_that_no_certificate_can_have_is_refused(folder: Path, name: str) -> None:
    """A common name has 64 characters at most; a topic's name would give its key, and `ca` the authority's files."""
    with pytest.raises(UsageError):
        prepare(folder, "", {name: Rights()}, "", [name])


@pytest.mark.parametrize(
    ("file", "content"),
    [
        (CA_KEY, None),
        (CA_KEY, b"nonsense"),
        (CA, b"nonsense"),
        (INDEX, b"{"),
        (INDEX, b'{"team": "\xff"}'),
        (INDEX, None),
    ],
)
def test_a_file_that_cannot_be_used_is_named(folder: Path, file: str, content: bytes | None) -> None:
    """A folder stands for a file that this user may not read, for a test of any user."""
    (folder / file).unlink()
    if content is None:
        (folder / file).mkdir()
    else:
        (folder / file).write_bytes(content)
    with pytest.raises(ZteamError, match=file), open_authority(folder) as authority:
        authority.issue(["robot_1"])
