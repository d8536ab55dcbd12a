"""Typed queries: requests and answers as JSON, errors as BusError."""

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, TypeVar

import msgspec

from zteam.bus.counters import Counters
from zteam.bus.payloads import decode_json
from zteam.bus.transport import QueryHandler, Reply
from zteam.errors import BusError, DecodeError

Request = TypeVar("Request", bound=msgspec.Struct)
T = TypeVar("T")


class NoRequest(msgspec.Struct):
    """The request of a query that needs none."""


class Change(msgspec.Struct, kw_only=True):
    """A request that changes something; the base of all such requests.

    A query on a wildcard, such as `**`, reaches every query of every process: it changes nothing.
    """


class Deferred(NamedTuple):
    """An answer that takes its time: `finish()` returns it and is called on a thread of its own."""

    finish: Callable[[], Any]


def read_replies(key_expr: str, replies: Iterable[Reply], reply_type: type[T]) -> list[tuple[str, T]]:
    """(key, answer) pairs sorted by key. Raises BusError if there are errors and no answer."""
    good: list[tuple[str, T]] = []
    bad: list[str] = []
    for key, body, error in replies:
        if error:
            bad.append(f"{key or key_expr}: {body.decode(errors='replace')}")
            continue
        try:
            good.append((key, decode_json(body, reply_type)))
        except DecodeError as fault:
            bad.append(f"{key}: unreadable answer: {fault}")
    if bad and not good:
        raise BusError("; ".join(bad))
    return sorted(good, key=lambda pair: pair[0])


def query_handler(
    key: str, request_type: type[Request], handler: Callable[[Request], Any], counters: Counters
) -> QueryHandler:
    """The transport's handler that calls the typed `handler`."""

    def handle(asked: str, payload: bytes) -> bytes | Callable[[], bytes]:
        if issubclass(request_type, Change) and asked != key:
            raise BusError(f"{key} changes something: ask for it by this key, not by the wildcard {asked}")
        try:
            request = decode_json(payload or b"{}", request_type)
        except DecodeError as error:
            counters.drop(key, f"bad request: {error}")
            raise BusError(f"bad request: {error}") from None
        answer = handler(request)
        if isinstance(answer, Deferred):
            return lambda: msgspec.json.encode(answer.finish())
        return msgspec.json.encode(answer)

    return handle
