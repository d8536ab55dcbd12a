"""What a page says, and what it is told when that makes no sense."""

import msgspec
import pytest

from zteam.errors import DecodeError
from zteam.view import requests
from zteam.view.requests import decode_request


def test_each_request_is_told_by_its_op() -> None:
    """The `op` chooses the type, and defaults fill the rest."""
    assert decode_request('{"op":"hello","version":1}') == requests.Hello(1, "", op="hello")
    drive = decode_request('{"op":"drive","robot":3,"linear":0.5,"angular":0}')
    assert drive == requests.Drive(3, 0.5, 0.0, op="drive")
    look = decode_request('{"op":"look","viewport":[0,0,1,1],"layers":["scans"],"docs":["log"]}')
    assert look == requests.Look(viewport=[0, 0, 1, 1], layers=["scans"], docs=["log"], op="look")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "truncated"),
        ("[]", "object"),
        ('{"op":"fly"}', "fly"),
        ('{"op":"pause"}', "seq"),
        ('{"op":"pause","seq":1,"force":true}', "force"),
        ('{"op":"goal","robots":[1],"x":1e9,"y":0,"yaw":0,"seq":1}', "x"),
        ('{"op":"look","viewport":[0,0,1]}', "four numbers"),
        ('{"op":"look","layers":["walls"]}', "walls"),
        ('{"op":"look","docs":["team"]}', "team"),
        ('{"op":"watch","topic":"**"}', "single topics"),
        ('{"op":"step","ticks":0,"seq":1}', "ticks"),
        ('{"op":"take","robot":10000,"seq":1}', "robot"),
        ('{"op":"look","viewport":' + "[" * 5000, "viewport|nested|truncated"),
        ('{"op":"hello","version":1,"token":"' + "x" * 300 + '"}', "token"),
    ],
)
def test_nonsense_is_refused_with_a_reason(text: str, why: str) -> None:
    """Whatever comes, the answer is a DecodeError that names the mistake."""
    with pytest.raises(DecodeError, match=why):
        decode_request(text)


def test_a_large_message_is_refused_before_it_is_read() -> None:
    """A message above 64 KiB is not decoded."""
    text = msgspec.json.encode({"op": "hello", "version": 1, "token": "x" * requests.MAX_BYTES}).decode()
    with pytest.raises(DecodeError, match="at most 65536"):
        decode_request(text)
