"""Requests of queries that change something: each names the one process that is to carry it out.

A query on a wildcard (`**`) reaches every query of every process, and none of them can see that its key was a wildcard.
So a query that changes something is refused unless it carries the session id of the process that serves it.
"""

import msgspec

from zteam.errors import BusError
from zteam.names import info_key

MEANT_FOR_ANOTHER = "is meant for another process"
"""In the text of a refusal: the process that the request names is not the one that serves the key."""


class Change(msgspec.Struct, kw_only=True):
    """A request that changes something; the base of all such requests."""

    instance: str = ""
    """Session id of the process that is to carry it out, as `<name>/info` tells it; `Bus.query` fills in an empty one."""


class Addressee(msgspec.Struct):
    """What `<name>/info` tells of the process that serves the keys below `<name>`."""

    instance: str
    start: int = 0


def owner_of(key: str) -> str:
    """The name of the process that serves the query `key`."""
    return key.partition("/")[0]


def check_instance(key: str, request: Change, instance: str) -> None:
    """Raise BusError unless `request` on `key` names the process `instance`."""
    if request.instance == instance:
        return
    told_by = info_key(owner_of(key))
    if not request.instance:
        raise BusError(
            f'{key} changes something and has to name the process it is meant for: send {{"instance": "ID"}} with '
            f"the ID that the query {told_by} tells"
        )
    raise BusError(
        f"{key} {MEANT_FOR_ANOTHER}: no process {request.instance[:40]!r} serves it (restarted?); the query {told_by} "
        "tells the ID of the one that does"
    )
