"""Why mutual TLS fails: Zenoh only says that there is no link. Python reads the same files and asks the router."""

import socket
import ssl
from typing import Any

from zteam.bus.options import TlsFiles

_RENEW = "renew it with 'zteam certs renew NAME'"
_TIMEOUT = 2.0
"""Host seconds for the router's part of a handshake."""
_EXPIRED, _NOT_YET = 10, 9
"""X509_V_ERR_CERT_HAS_EXPIRED, X509_V_ERR_CERT_NOT_YET_VALID."""
_NO_SERVER = 26
"""X509_V_ERR_INVALID_PURPOSE."""
_WRONG_NAME = (62, 64)
"""X509_V_ERR_HOSTNAME_MISMATCH, X509_V_ERR_IP_ADDRESS_MISMATCH."""


def own_fault(tls: TlsFiles, *, routes: bool = False) -> str:
    """What is wrong with a process's own files, without a router; empty if nothing is.

    With `routes` the process is a router itself.
    """
    names = dict(zip(("ca", "certificate", "key"), tls.environment, strict=True))
    try:
        server, client = _sides(tls)
    except ssl.SSLError as error:
        if error.reason == "KEY_VALUES_MISMATCH":
            return f"{names['key']} {tls.key} is not the key of {names['certificate']} {tls.certificate}"
        return f"{tls.ca}, {tls.certificate} or {tls.key} is no PEM file of a certificate or key without a password"
    except OSError as error:
        return f"{error.filename or tls.ca}: {error.strerror}"
    # The certificate is shown to a server that checks it as the router does, and to a client.
    client.verify_mode = ssl.CERT_REQUIRED if routes else ssl.CERT_NONE
    try:
        _shake_hands(client, server)
    except ssl.SSLCertVerificationError as error:
        return f"{names['certificate']} {tls.certificate} {_verdict(error, tls)}"
    return ""


def refusal(address: tuple[str, int], tls: TlsFiles) -> str:
    """Why the router at `address` and a process with these files do not come together; empty if they do."""
    try:
        client = _context(tls, ssl.PROTOCOL_TLS_CLIENT)
        link = socket.create_connection(address, timeout=_TIMEOUT)
        with link, client.wrap_socket(link, server_hostname=address[0]) as stream:
            # The router's verdict on this certificate comes behind the handshake. Its silence is consent.
            stream.settimeout(_TIMEOUT / 4)
            stream.recv(1)
    except TimeoutError:
        return ""
    except ssl.SSLCertVerificationError as error:
        if error.verify_code == _NO_SERVER:
            shown, step = _name_at(address), "end the program that has taken the router's port"
            return f"its certificate {shown} {_verdict(error, tls)}: {step} ('ss -ltnp' on its host names it)"
        return f"its certificate {_verdict(error, tls)}"
    except ssl.SSLError as error:
        # Such as TLSV1_ALERT_UNKNOWN_CA, SSLV3_ALERT_CERTIFICATE_EXPIRED.
        words = str(error.reason or error).partition("ALERT_")[2].replace("_", " ").lower()
        return f"it refuses the certificate {tls.certificate}{f' ({words})' if words else ''}"
    except OSError as error:
        return f"the link breaks ({error.strerror or error})"
    return ""


def own_identity(tls: TlsFiles) -> tuple[str, float]:
    """The common name in the process's own certificate, and its end in seconds since the Unix epoch.

    ("", 0.0) if `own_fault` has something to say.
    """
    try:
        server, client = _sides(tls)
        shown = _shake_hands(client, server)
    except OSError:
        return "", 0.0
    name = next((value for each in shown.get("subject", ()) for key, value in each if key == "commonName"), "")
    return name, ssl.cert_time_to_seconds(shown["notAfter"])


def _name_at(address: tuple[str, int]) -> str:
    """The common name of the certificate that is shown at an address, whatever it is worth; `?` if none is."""
    from cryptography import x509

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    try:
        with socket.create_connection(address, timeout=_TIMEOUT) as link, context.wrap_socket(link) as stream:
            shown = x509.load_der_x509_certificate(stream.getpeercert(True) or b"")
    except (OSError, ValueError):
        return "?"
    found = [str(each.value) for each in shown.subject.get_attributes_for_oid(x509.NameOID.COMMON_NAME)]
    # A stranger chose it, and it goes to a terminal.
    return found[0] if found and found[0].isprintable() else "?"


def _context(tls: TlsFiles, protocol: Any) -> ssl.SSLContext:
    context = ssl.SSLContext(protocol)
    # An empty password: without one OpenSSL asks at the terminal.
    context.load_cert_chain(tls.certificate, tls.key, password="")
    context.load_verify_locations(tls.ca)
    context.verify_mode = ssl.CERT_REQUIRED
    return context


def _sides(tls: TlsFiles) -> tuple[ssl.SSLContext, ssl.SSLContext]:
    """A server, and a client that trusts any."""
    client = _context(tls, ssl.PROTOCOL_TLS_CLIENT)
    client.check_hostname, client.verify_mode = False, ssl.CERT_NONE
    return _context(tls, ssl.PROTOCOL_TLS_SERVER), client


def _shake_hands(client: ssl.SSLContext, server: ssl.SSLContext) -> dict[str, Any]:
    """A handshake in memory; what the client has shown. Raises ssl.SSLError where the server does not take that."""
    up, down = ssl.MemoryBIO(), ssl.MemoryBIO()
    sides = [client.wrap_bio(down, up), server.wrap_bio(up, down, server_side=True)]
    # TLS 1.3 takes two rounds.
    for _ in range(8):
        for side in sides:
            try:
                side.do_handshake()
            except ssl.SSLWantReadError:
                continue
    return sides[1].getpeercert() or {}


def _verdict(error: ssl.SSLCertVerificationError, tls: TlsFiles) -> str:
    if error.verify_code == _EXPIRED:
        return f"has expired: {_RENEW}"
    if error.verify_code == _NOT_YET:
        return "is not valid yet: compare the clocks of the machines"
    if error.verify_code == _NO_SERVER:
        return "is not that of a router"
    if error.verify_code in _WRONG_NAME:
        return f"is not for this address: {error.verify_message}"
    return f"is not of the authority in {tls.ca} ({error.verify_message})"
