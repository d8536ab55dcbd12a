"""Requests of queries that change something: each names the one process that is to carry it out.

A query on a wildcard (`**`) reaches every query of every process, and none of them can see that its key was a wildcard.
So a query that changes something is refused unless it carries the session id of the process that serves it.
"""

from collections.abc import Callable
from typing import Any

import msgspec

from zteam.errors import BusError
from zteam.names import info_key

_MEANT_FOR_ANOTHER = "is meant for another process"
"""In the text of a refusal: the process that the request names is not the one that serves the key."""


class Change(msgspec.Struct, kw_only=True):
    """A request that changes something; the base of all such requests."""

    instance: str = ""
    """Session id of the process that is to carry it out, told by `<name>/info`; `Bus.query` fills in an empty one."""


def check_instance(key: str, request: Change, instance: str) -> None:
    """Raise BusError unless `request` on `key` names the process `instance`."""
    if request.instance == instance:
        return
    told_by = info_key(_owner_of(key))
    if not request.instance:
        raise BusError(
            f'{key} changes something and has to name the process it is meant for: send {{"instance": "ID"}} with '
            f"the ID that the query {told_by} tells"
        )
    raise BusError(
        f"{key} {_MEANT_FOR_ANOTHER}: no process {request.instance[:40]!r} serves it (restarted?); the query {told_by} "
        "tells the ID of the one that does"
    )


def _owner_of(key: str) -> str:
    """What the query `key` belongs to: its last part is the service, and beside it is `info`.

    That is the process's name, or for `robot_N/navigation/cancel` its place below a robot's.
    """
    return key.rpartition("/")[0]


class _Info(msgspec.Struct):
    """Of `<name>/info`, what matters here."""

    instance: str
    start: int = 0


class Addressees:
    """Asks for changes in the name of a bus: fills in the process that each is meant for, and remembers it."""

    def __init__(self, query: Callable[..., list[tuple[str, Any]]]) -> None:
        """`query` is `Bus.query`."""
        self._query = query
        self._known: dict[str, str] = {}
        """Session ids by process name."""

    def query(self, key: str, reply_type: type[Any], request: Change, timeout: float) -> list[tuple[str, Any]]:
        """Ask the process that served `key` the last time; if it was restarted since then, ask its successor."""
        owner = _owner_of(key)
        known = self._known.get(owner)
        if known is not None:
            try:
                return self._query_one(key, reply_type, request, known, timeout)
            except BusError as error:
                if _MEANT_FOR_ANOTHER not in str(error):
                    raise
        found = self._find(key, owner, timeout)
        return self._query_one(key, reply_type, request, found, timeout) if found else []

    def _query_one(
        self, key: str, reply_type: type[Any], request: Change, instance: str, timeout: float
    ) -> list[tuple[str, Any]]:
        return self._query(key, reply_type, msgspec.structs.replace(request, instance=instance), timeout=timeout)

    def _find(self, key: str, owner: str, timeout: float) -> str:
        """The session id of the process `owner`; empty if there is none."""
        info = info_key(owner)
        try:
            told = [found for _, found in self._query(info, _Info, timeout=timeout)]
        except BusError as error:
            raise BusError(f"{key}: {str(error).removeprefix(f'{info}: ')}") from None
        if not told:
            return ""
        # Of two processes that claim one name the older one gets it.
        self._known[owner] = min(told, key=lambda found: found.start).instance
        return self._known[owner]
