"""Limits of payloads, and requests and answers as JSON: nothing on the wire may crash a process."""

from typing import TypeVar

import msgspec

from zteam.errors import DecodeError

T = TypeVar("T")

MAX_PAYLOAD = 64 * 1024 * 1024
"""Bytes of a message, a request or an answer; a map of 4000 x 4000 cells has 16 MB. Larger ones are not decoded."""


def size_problem(payload: bytes) -> str:
    """Why a payload is too large to be decoded; empty if it is not."""
    return f"its {len(payload)} bytes are more than {MAX_PAYLOAD}" if len(payload) > MAX_PAYLOAD else ""


def decode_json(payload: bytes, kind: type[T]) -> T:
    """A request or an answer. Raises DecodeError."""
    if problem := size_problem(payload):
        raise DecodeError(problem)
    try:
        return msgspec.json.decode(payload, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise DecodeError(str(error)) from None
    except RecursionError:
        raise DecodeError("it is nested too deeply") from None
