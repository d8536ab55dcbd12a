"""Which connections are taken, and the token."""

import re
import socket

import pytest

from zteam.view.connections import Gatekeeper, is_loopback, is_token, make_token, takes_origin


@pytest.mark.parametrize(
    ("header", "taken"),
    [
        ("127.0.0.1:8765", True),
        ("127.0.0.1", True),
        ("localhost:1", True),
        ("LOCALHOST", True),
        ("[::1]:8765", True),
        ("127.0.0.2:80", True),
        ("", False),
        ("evil.example:8765", False),
        ("localhost.evil.example", False),
        ("127.0.0.1.evil.example", False),
        ("10.0.0.5:8765", False),
        ("127.0.0.1:x", False),
        ("[::1", False),
        ("[]:80", False),
    ],
)
def test_on_loopback_only_names_of_loopback_are_taken(header: str, taken: bool) -> None:
    """A name of another site that leads to this machine (DNS rebinding) is refused."""
    assert Gatekeeper("127.0.0.1").takes_host(header) is taken


def test_in_a_network_addresses_are_taken_and_foreign_names_are_not() -> None:
    """An address in the Host cannot be a rebound name; the machine's own name is taken too."""
    gate = Gatekeeper("0.0.0.0")
    assert gate.takes_host("192.168.1.9:8765")
    assert gate.takes_host(f"{socket.gethostname()}:8765")
    assert not gate.takes_host("evil.example")
    assert [is_loopback(host) for host in ("localhost", "::1", "10.0.0.1", "robot")] == [True, True, False, False]


@pytest.mark.parametrize(
    ("origin", "taken"),
    [
        (None, True),
        ("http://127.0.0.1:8765", True),
        ("https://127.0.0.1:8765", True),
        ("http://127.0.0.1:8766", False),
        ("http://localhost:8765", False),
        ("http://127.0.0.1:8765.evil.example", False),
        ("null", False),
        ("", False),
    ],
)
def test_the_origin_has_to_be_this_very_server(origin: str | None, taken: bool) -> None:
    """Another port, another name and a sandboxed page are other origins."""
    assert takes_origin(origin, "127.0.0.1:8765") is taken


def test_tokens_are_long_and_compared_whole() -> None:
    """Two tokens differ, each is a word for a command line, and no prefix or other text is taken for one."""
    token = make_token()
    assert token != make_token()
    assert re.fullmatch("[0-9a-f]{32}", token)
    assert is_token(token, token)
    assert not any(is_token(other, token) for other in ("", token[:-1], token + "x", "ü"))
