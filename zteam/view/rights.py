"""Which connections are taken, and which of them may command. Pure, but for the names of this machine."""

import hmac
import ipaddress
import re
import secrets
import socket

_HOST = re.compile(r"(?:\[([^\[\]]+)\]|([^:\[\]]+))(?::[0-9]*)?")
"""An address of IPv6 in brackets, or a name or another address; then a port."""
LOOPBACK = ("127.0.0.1", "localhost", "::1")


def make_token() -> str:
    """A token that cannot be guessed: 128 bits. Hexadecimal, as a word that begins with "-" would be an option."""
    return secrets.token_hex(16)


def is_token(given: str, token: str) -> bool:
    """Whether it is the token; it takes the same time wherever they differ."""
    return hmac.compare_digest(given.encode(), token.encode())


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches what listens there."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class Gatekeeper:
    """Knows the names under which a page of this server can be reached.

    A name of another site that leads here (DNS rebinding) is none of them, so a page of that site gets nothing.
    """

    def __init__(self, host: str) -> None:
        """`host` is where the server listens."""
        self._only_here = is_loopback(host)
        names = {host, *LOOPBACK} if self._only_here else {host, *LOOPBACK, socket.gethostname(), socket.getfqdn()}
        self._names = {name.lower() for name in names}

    def takes_host(self, header: str) -> bool:
        """Whether a request with this `Host` is answered; a published port may be another one than the server's."""
        match = _HOST.fullmatch(header)
        if match is None:
            return False
        name = (match[1] or match[2]).lower()
        if name in self._names:
            return True
        try:
            address = ipaddress.ip_address(name)
        except ValueError:
            return False
        # An address is no name that another site could lead here.
        return not self._only_here or address.is_loopback

    def takes_origin(self, origin: str | None, host_header: str) -> bool:
        """Whether a page from `origin` may open a socket; a program that is no browser sends none."""
        return origin is None or origin in (f"http://{host_header}", f"https://{host_header}")
