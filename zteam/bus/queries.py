"""Typed queries: requests and answers as JSON, errors as texts that the asker gets as BusError.

Nothing on the wire may crash a process.
"""

from collections.abc import Callable, Iterable
from typing import Any, ClassVar, NamedTuple, TypeVar

import msgspec

from zteam.bus.receiving import Counters
from zteam.bus.transport import TIMED_OUT, Finish, QueryHandler, Reply, decode_json
from zteam.errors import BusError, DecodeError, QueryError, QueryTimeoutError

Request = TypeVar("Request", bound=msgspec.Struct)
T = TypeVar("T")


class NoRequest(msgspec.Struct):
    """The request of a query that needs none."""


class Change(msgspec.Struct, kw_only=True):
    """A request that changes something; the base of all such requests.

    A query on a wildcard, such as `**`, reaches every query of every process: it changes nothing.
    """

    wildcard: ClassVar[str] = ""
    """The only wildcard that may ask for it; empty for none."""


class Deferred(NamedTuple):
    """An answer that takes its time: `finish()` returns it and is called on a thread of its own."""

    finish: Callable[[], Any]


def read_replies(key_expr: str, replies: Iterable[Reply], reply_type: type[T]) -> list[tuple[str, T]]:
    """(key, answer) pairs sorted by key. Raises QueryError if there are errors and no answer."""
    good: list[tuple[str, T]] = []
    bad: list[tuple[str, str]] = []
    error: type[QueryError] = QueryTimeoutError
    for reply in replies:
        if reply is not TIMED_OUT:
            error = QueryError
        if reply.error:
            bad.append((reply.key or key_expr, reply.payload.decode(errors="replace")))
            continue
        try:
            good.append((reply.key, decode_json(reply.payload, reply_type)))
        except DecodeError as fault:
            bad.append((reply.key, f"unreadable answer: {fault}"))
    if bad and not good:
        raise error("; ".join(map(": ".join, bad)), "; ".join(why for _, why in bad))
    return sorted(good, key=lambda pair: pair[0])


def query_handler(
    key: str, request_type: type[Request], handler: Callable[[Request], Any], counters: Counters
) -> QueryHandler:
    """The transport's handler that calls the typed `handler`."""

    def handle(asked: str, payload: bytes) -> bytes | Finish:
        if issubclass(request_type, Change) and asked not in (key, request_type.wildcard):
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
