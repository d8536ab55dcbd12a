"""Keys and certificates as PEM (X.509, EC P-256): made, signed and read."""

import ipaddress
from collections.abc import Iterable, Sequence
from datetime import datetime  # noqa: TID251 - of certificates
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey, EllipticCurvePublicKey
from cryptography.x509 import Certificate, CertificateBuilder, GeneralName
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from zteam.errors import UsageError, ZteamError

Span = tuple[datetime, datetime]
"""From when and until when a certificate is valid."""


def unreadable(path: Path, error: OSError) -> ZteamError:
    """The error of a file that cannot be read."""
    return ZteamError(f"{path}: {error.strerror or error}: make it readable for this user")


def new_key() -> EllipticCurvePrivateKey:
    """Of an authority or a process."""
    return ec.generate_private_key(ec.SECP256R1())


def key_bytes(key: EllipticCurvePrivateKey) -> bytes:
    """PEM, without a password."""
    encoding, kind = serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8
    return key.private_bytes(encoding, kind, serialization.NoEncryption())


def sign_authority(name: str, key: EllipticCurvePrivateKey, span: Span) -> bytes:
    """The certificate of a new authority, PEM."""
    return _signed(_builder(name, name, key, span), key)


def sign_process(
    common_name: str,
    key: EllipticCurvePrivateKey,
    span: Span,
    issuer: tuple[EllipticCurvePrivateKey, Certificate],
    places: Sequence[GeneralName],
) -> bytes:
    """The certificate of a process, which is a client, PEM. With `places` it may also be a server there: clients check
    both."""
    issuer_key, own = issuer
    builder, uses = _builder(common_name, name_in(own), key, span, own), [ExtendedKeyUsageOID.CLIENT_AUTH]
    if places:
        uses.append(ExtendedKeyUsageOID.SERVER_AUTH)
        builder = builder.add_extension(x509.SubjectAlternativeName(dict.fromkeys(places)), critical=False)
    return _signed(builder.add_extension(x509.ExtendedKeyUsage(uses), critical=False), issuer_key)


def _builder(
    common_name: str, issuer_name: str, key: EllipticCurvePrivateKey, span: Span, issuer: Certificate | None = None
) -> CertificateBuilder:
    """What all certificates have. Without `issuer` it is that of an authority."""

    def named(text: str) -> x509.Name:
        return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])

    is_authority, public = issuer is None, key.public_key()
    signer = public if issuer is None else issuer.public_key()
    assert isinstance(signer, EllipticCurvePublicKey)
    usage = x509.KeyUsage(
        digital_signature=not is_authority,
        key_cert_sign=is_authority,
        crl_sign=is_authority,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )
    return (
        x509.CertificateBuilder()
        .subject_name(named(common_name))
        .issuer_name(named(issuer_name))
        .public_key(public)
        .serial_number(x509.random_serial_number())
        .not_valid_before(span[0])
        .not_valid_after(span[1])
        .add_extension(x509.BasicConstraints(is_authority, 0 if is_authority else None), critical=True)
        .add_extension(usage, critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(public), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(signer), critical=False)
    )


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


def _signed(builder: CertificateBuilder, key: EllipticCurvePrivateKey) -> bytes:
    return builder.sign(key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM)


def load_certificate(path: Path) -> Certificate:
    """The one in a PEM file. Raises ZteamError."""
    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except OSError as error:
        raise unreadable(path, error) from None
    except ValueError:
        raise ZteamError(f"{path}: this is no certificate in PEM form: restore it, or issue the next one") from None


def name_in(certificate: Certificate) -> str:
    """Its common name; empty if it has none."""
    found = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(found[0].value) if found else ""
