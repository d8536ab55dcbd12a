"""Why mutual TLS fails: Zenoh only says that there is no link. Python reads the same files and asks the router."""

import socket
import ssl
from typing import Any

from zteam.bus.options import TlsFiles

_TIMEOUT = 2.0
"""Host seconds for the router's part of a handshake."""
_WAY_OUT = "docs/security.md lists the causes, and 'zteam certs renew NAME' makes a new certificate"


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
        return f"{names['certificate']} {tls.certificate} is not accepted ({error.verify_message}): {_WAY_OUT}"
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
        return f"its certificate is not accepted ({error.verify_message}): {_WAY_OUT}"
    except OSError as error:
        reason = getattr(error, "reason", None) or error.strerror or error
        return f"it does not accept the certificate {tls.certificate} ({reason}): {_WAY_OUT}"
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
