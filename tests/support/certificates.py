"""Certificates for tests: authorities of their own, and what is wrong with a certificate."""

import datetime  # noqa: TID251  # the library's own type of time
import ipaddress
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from zteam.bus.options import TlsFiles

_DAY = datetime.timedelta(days=1)


class Authority:
    """Signs certificates, those of servers for loopback, and keeps all files in `folder`."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._key = ec.generate_private_key(ec.SECP256R1())
        self._name = _named(f"authority of {folder.name}")
        builder = self._builder(self._name, self._key, _DAY).add_extension(x509.BasicConstraints(True, 0), True)
        self._write("ca", builder.sign(self._key, hashes.SHA256()), self._key)

    def issue(self, name: str, common_name: str = "", days: float = 1.0, *, server: bool = False) -> TlsFiles:
        """A certificate for `common_name`, by default `NAME.1`, that ends after `days`. As a rule it is a client's."""
        key = ec.generate_private_key(ec.SECP256R1())
        uses = [ExtendedKeyUsageOID.CLIENT_AUTH]
        builder = self._builder(_named(common_name or f"{name}.1"), key, days * _DAY)
        if server:
            place = [x509.DNSName("localhost"), x509.IPAddress(ipaddress.ip_address("127.0.0.1"))]
            builder = builder.add_extension(x509.SubjectAlternativeName(place), False)
            uses.append(ExtendedKeyUsageOID.SERVER_AUTH)
        builder = builder.add_extension(x509.ExtendedKeyUsage(uses), False)
        self._write(name, builder.sign(self._key, hashes.SHA256()), key)
        return TlsFiles(*(str(self._folder / file) for file in ("ca.pem", f"{name}.pem", f"{name}.key")))

    def _builder(
        self, name: x509.Name, key: ec.EllipticCurvePrivateKey, valid: datetime.timedelta
    ) -> x509.CertificateBuilder:
        now = datetime.datetime.now(datetime.UTC)
        builder = x509.CertificateBuilder().subject_name(name).issuer_name(self._name).public_key(key.public_key())
        builder = builder.not_valid_before(now - 2 * _DAY).not_valid_after(now + valid)
        return builder.serial_number(x509.random_serial_number())

    def _write(self, name: str, certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey) -> None:
        pem = serialization.Encoding.PEM
        (self._folder / f"{name}.pem").write_bytes(certificate.public_bytes(pem))
        plain = serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        (self._folder / f"{name}.key").write_bytes(key.private_bytes(pem, *plain))


def _named(text: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])
