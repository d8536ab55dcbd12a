"""A team's authority and its certificates: one folder of files (docs/security.md#certificates).

The common name of a certificate is NAME.SERIAL. The router lets in those that `access.json5` lists, so a certificate is
taken back by writing that file anew. Every file is replaced as a whole, `index.json` first and `access.json5` last: an
interruption leaves a certificate that the index knows and the folder lacks, which counts as missing.
"""

import fcntl
import ipaddress
import os
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta  # noqa: TID251 - of certificates; the time itself is the clock's
from pathlib import Path
from typing import Literal

import msgspec
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
from cryptography.x509 import Certificate, GeneralName
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from zteam.bus.options import TlsFiles
from zteam.clock import wall_ns
from zteam.errors import UsageError, ZteamError, did_you_mean
from zteam.monitor.doctor.examination import check_expiry
from zteam.names import name_problem
from zteam.node.kinds import ROUTER
from zteam.team.security.access import Rights, access_control

FOLDER = "certs"
DAYS = 365
"""For which a certificate is valid, unless told otherwise."""
MAX_DAYS = 3650
"""For which the authority's own is valid."""
SOON = timedelta(days=14)
"""Before its end, in which a certificate is warned of."""
_MARGIN = timedelta(hours=1)
"""By which a certificate is valid earlier: another machine's clock may be late."""
_MAX_NAME = 50
"""Characters; a common name has 64 at most."""

CA, CA_KEY, ACCESS, INDEX = "ca.pem", "ca.key", "access.json5", "index.json"
_LOOPBACK = ("localhost", "127.0.0.1")


class Issued(msgspec.Struct):
    serial: int
    expires: datetime
    hosts: tuple[str, ...] = ()
    """Names and addresses of machines for which it stands, besides loopback. Only the router's has any."""
    revoked: bool = False

    @property
    def state(self) -> Literal["valid", "expires_soon", "expired", "revoked"]:
        """Whether it is of use, by the host's clock."""
        left = self.expires - now()
        if self.revoked:
            return "revoked"
        return "expired" if left <= timedelta() else "expires_soon" if left < SOON else "valid"

    @property
    def left(self) -> str:
        """How long it is valid still: `364 days`, `5 h`."""
        left = self.expires - now()
        if left <= timedelta():
            return "-"
        return f"{left.days} days" if left.days >= 2 else f"{left // timedelta(hours=1)} h"


class Index(msgspec.Struct):
    """What the folder knows of itself."""

    team: str = ""
    """The team file whose rights these are, as it was named."""
    namespace: str = ""
    rights: dict[str, Rights] = {}
    """By the name of the certificate."""
    certificates: dict[str, list[Issued]] = {}
    """By name; the serial grows."""

    def last(self, name: str) -> Issued | None:
        return next(reversed(self.certificates.get(name, [])), None)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ZteamError(f"{path}: {error.strerror or error}: make it readable for this user") from None


def places_of(hosts: Iterable[str]) -> list[GeneralName]:
    """Names and addresses of machines as a certificate has them. Raises UsageError."""
    found: list[GeneralName] = []
    for host in hosts:
        try:
            found.append(x509.IPAddress(ipaddress.ip_address(host)))
        except ValueError:
            if not host or not host.isascii() or any(c.isspace() or c in "/:*" for c in host):
                raise UsageError(f"host {host!r}: give the name or the IP address of a machine") from None
            found.append(x509.DNSName(host))
    return found


def load_certificate(path: Path) -> Certificate:
    """The one in a PEM file. Raises ZteamError."""
    try:
        return x509.load_pem_x509_certificate(_read(path))
    except ValueError:
        raise ZteamError(f"{path}: this is no certificate in PEM form: restore it, or issue the next one") from None


def name_in(certificate: Certificate) -> str:
    """Its common name; empty if it has none."""
    found = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(found[0].value) if found else ""


def now() -> datetime:
    """By the host's clock."""
    return datetime.fromtimestamp(wall_ns() / 1e9, UTC)


def files_of(folder: Path, name: str) -> TlsFiles:
    """What the process `name` is told; absolute paths."""
    place = folder.resolve()
    return TlsFiles(str(place / CA), str(place / f"{name}.pem"), str(place / f"{name}.key"))


def read_index(folder: Path, *, make: bool = False) -> Index:
    """What a folder holds. Raises ZteamError if no authority is there, unless it is to `make` one."""
    path = folder / INDEX
    if not (make or path.exists() or (folder / CA).exists()):
        raise ZteamError(f"{folder}: there are no certificates: make them with 'zteam certs init{_option(folder)}'")
    try:
        return msgspec.json.decode(_read(path), type=Index) if path.exists() else Index()
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        text = f"{path}: {error}: restore it, or make a new folder with 'zteam certs init --folder NEW'"
        raise ZteamError(text) from None


def _option(folder: Path) -> str:
    return "" if folder == Path(FOLDER) else f" --folder {folder}"


class Authority:
    """The folder with the authority's key, while no other process changes it. Use `open_authority`."""

    def __init__(self, folder: Path, index: Index) -> None:
        self.folder, self.index = folder, index

    @property
    def has_key(self) -> bool:
        """Whether certificates can be issued here."""
        return (self.folder / CA).exists() and (self.folder / CA_KEY).exists()

    def make(self) -> datetime:
        """Make the authority's own key and certificate; when that ends."""
        expires = now() + timedelta(days=MAX_DAYS)
        self._write_pair("ca", f"zteam {secrets.token_hex(4)}", expires)
        return expires

    def take_team(self, team: str, rights: Mapping[str, Rights], namespace: str) -> None:
        """The rights of each certificate are those of this team; those of other names end."""
        self.index.team, self.index.rights, self.index.namespace = team, dict(rights), namespace

    def issue(self, names: Sequence[str], hosts: Sequence[str] = (), days: int = DAYS) -> list[Issued]:
        """The next certificate of each name; none of them outlives the authority. Raises ZteamError. That of the router
        stands for loopback and `hosts`; all others stand for no host."""
        for name in names:
            self._check_name(name)
        places, own = places_of([*_LOOPBACK, ROUTER, *hosts]), self._load_authority()
        expires = min(now() + timedelta(days=days), own[1].not_valid_after_utc).replace(microsecond=0)
        found = []
        for name in names:
            earlier = self.index.certificates.setdefault(name, [])
            found.append(Issued(len(earlier) + 1, expires, tuple(hosts) if name == ROUTER else ()))
            earlier.append(found[-1])
        # Before the files: a certificate in the folder is one that the index knows.
        self._write(INDEX, _json(self.index))
        for name, issued in zip(names, found, strict=True):
            self._write_pair(name, f"{name}.{issued.serial}", expires, own, places if name == ROUTER else ())
        return found

    def revoke(self, name: str, serial: int | None = None) -> list[int]:
        """Take back all certificates of a name, or one; the serials of those that were valid. Raises UsageError."""
        if name not in self.index.certificates:
            raise UsageError(f"{name}: no certificate of this name{did_you_mean(name, self.index.certificates)}")
        all_of_them = self.index.certificates[name]
        chosen = [each for each in all_of_them if serial in (None, each.serial)]
        if not chosen:
            raise UsageError(f"{name}.{serial}: no such certificate; the last one is {name}.{all_of_them[-1].serial}")
        taken = [each.serial for each in chosen if not each.revoked]
        for each in chosen:
            each.revoked = True
        return taken

    def is_complete(self, name: str) -> bool:
        """Whether the files hold the newest certificate of this name. Raises ZteamError if they cannot be read."""
        last = self.index.last(name)
        if last is None or not _has_files(self.folder, name):
            return False
        return name_in(load_certificate(self.folder / f"{name}.pem")) == f"{name}.{last.serial}"

    def _check_name(self, name: str) -> None:
        rights = self.index.rights
        if name not in rights:
            raise UsageError(
                f"{name}: the team {self.index.team!r} gives this name no rights{did_you_mean(name, rights)}; "
                f"known: {', '.join(rights)}; for another tool write '{name} = []' below [security.grants] of the team "
                "file, then 'zteam certs init TEAM'"
            )
        if problem := name_problem(name):
            raise UsageError(problem)
        if len(name) > _MAX_NAME:
            raise UsageError(f"{name}: the name of a certificate has {_MAX_NAME} characters at most")

    def _load_authority(self) -> tuple[EllipticCurvePrivateKey, Certificate]:
        path = self.folder / CA_KEY
        if not path.exists():
            raise ZteamError(f"{path}: no such file: issue certificates where 'zteam certs init' made the authority")
        try:
            key = serialization.load_pem_private_key(_read(path), None)
        except (ValueError, TypeError):
            key = None
        own = load_certificate(self.folder / CA)
        if not isinstance(key, EllipticCurvePrivateKey) or key.public_key() != own.public_key():
            raise ZteamError(f"{path}: this is not the key of {CA}: restore it, or {_anew(self.folder)}")
        if (end := own.not_valid_after_utc) <= now():
            raise ZteamError(f"{self.folder / CA} has expired on {end:%Y-%m-%d}: {_anew(self.folder)}")
        return key, own

    def _write_pair(
        self,
        file: str,
        common_name: str,
        expires: datetime,
        issuer: tuple[EllipticCurvePrivateKey, Certificate] | None = None,
        places: Sequence[GeneralName] = (),
    ) -> None:
        """Write a new key, and its certificate: the authority's own without an `issuer`, else that of a process, which
        is a client. With `places` it may also be a server there: clients check both."""
        key, is_authority = ec.generate_private_key(ec.SECP256R1()), issuer is None
        public, name = key.public_key(), x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])
        signer = key if issuer is None else issuer[0]
        others = "content_commitment key_encipherment data_encipherment key_agreement encipher_only decipher_only"
        usages = dict.fromkeys(others.split(), False) | dict.fromkeys(("key_cert_sign", "crl_sign"), is_authority)
        usage = x509.KeyUsage(digital_signature=not is_authority, **usages)
        builder = (
            x509.CertificateBuilder()
            .subject_name(name)
            .issuer_name(name if issuer is None else issuer[1].subject)
            .public_key(public)
            .serial_number(x509.random_serial_number())
            .not_valid_before(now() - _MARGIN)
            .not_valid_after(expires)
            .add_extension(x509.BasicConstraints(is_authority, 0 if is_authority else None), critical=True)
            .add_extension(usage, critical=True)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(public), critical=False)
            .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(signer.public_key()), critical=False)
        )
        uses = [] if is_authority else [ExtendedKeyUsageOID.CLIENT_AUTH]
        if places:
            uses.append(ExtendedKeyUsageOID.SERVER_AUTH)
            builder = builder.add_extension(x509.SubjectAlternativeName(dict.fromkeys(places)), critical=False)
        if uses:
            builder = builder.add_extension(x509.ExtendedKeyUsage(uses), critical=False)
        pem, form = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
        self._write(f"{file}.key", key.private_bytes(pem, form, serialization.NoEncryption()))
        self._write(f"{file}.pem", builder.sign(signer, hashes.SHA256()).public_bytes(pem))

    def save(self) -> None:
        """Save the index, and let routers know, last of all: they then read their own certificate and key too."""
        index, known = self.index, self.index.certificates.items()
        self._write(INDEX, _json(index))
        valid = {name: [f"{name}.{each.serial}" for each in found if not each.revoked] for name, found in known}
        content = _json({"access_control": access_control(index.rights, valid, index.namespace)})
        # A router opens all links again when the file changes.
        if not (self.folder / ACCESS).exists() or (self.folder / ACCESS).read_bytes() != content:
            self._write(ACCESS, content)

    def _write(self, name: str, content: bytes) -> None:
        part = self.folder / ".part"
        part.unlink(missing_ok=True)
        with os.fdopen(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(self.folder / name)


def _json(content: object) -> bytes:
    return msgspec.json.format(msgspec.json.encode(content), indent=1)


def _anew(folder: Path) -> str:
    return f"remove the folder {folder}, make a new authority with 'zteam certs init', and give out what it makes"


@contextmanager
def open_authority(folder: Path, *, make: bool = False) -> Iterator[Authority]:
    """Hold the folder of certificates; with `make` it is made. Raises ZteamError, also for what fails inside."""
    try:
        if make:
            folder.mkdir(parents=True, exist_ok=True)
            folder.chmod(0o700)
        read_index(folder, make=make)
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX)
            authority = Authority(folder, read_index(folder, make=make))
            try:
                yield authority
            finally:
                # Also after an error, or what an earlier command was stopped in.
                authority.save()
        finally:
            os.close(descriptor)
    except OSError as error:
        raise ZteamError(f"{error.filename or folder}: {error.strerror or error}") from None


def prepare(folder: Path, team: str, rights: Mapping[str, Rights], namespace: str, names: Iterable[str]) -> list[str]:
    """Make what is missing for the processes `names` of a team; what the user is to be warned of, one line each. Where
    the authority is elsewhere, and the folder holds copies only, nothing is made. Raises ZteamError if a process has no
    certificate that is valid."""
    names = list(dict.fromkeys(names))
    if (folder / CA).exists() and not (folder / CA_KEY).exists():
        missing = [name for name in names if not _has_files(folder, name)]
        if missing:
            way_out = f"copy {missing[0]}.pem and {missing[0]}.key from where the authority is"
            lack = f"no certificate of {', '.join(missing)}, and no {CA_KEY} to make one"
            raise ZteamError(f"{folder}: {lack}: {way_out}")
    else:
        with open_authority(folder, make=True) as authority:
            if not authority.has_key:
                authority.make()
            authority.take_team(team, rights, namespace)
            revoked = [name for name in names if (last := authority.index.last(name)) and last.revoked]
            if revoked:
                text = f"{folder}: the certificate of {revoked[0]} is revoked: make the next one with"
                raise ZteamError(f"{text} 'zteam certs issue {revoked[0]}{_option(folder)}'")
            authority.issue([name for name in names if not authority.is_complete(name)])
    warnings = []
    for name in names:
        own = load_certificate(folder / f"{name}.pem")
        found = check_expiry(name_in(own), own.not_valid_after_utc.timestamp(), folder)
        if found.level != "ok":
            text = f"{found.text}: {found.next_step}"
            if found.level == "problem":
                raise ZteamError(text)
            warnings.append(text)
    return warnings


def _has_files(folder: Path, name: str) -> bool:
    return all((folder / f"{name}.{ending}").exists() for ending in ("pem", "key"))
