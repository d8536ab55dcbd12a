"""Types by name, names on the wire, and stamps."""

import difflib
import logging
from functools import cache, lru_cache

from zteam.entry_points import MESSAGES, load_offered, offered
from zteam.errors import UsageError
from zteam.messages.message import REGISTERED, Message
from zteam.messages.std_msgs import Time

log = logging.getLogger("zteam")

_NS = 1_000_000_000


def all_types() -> dict[str, type[Message]]:
    """Every message type that is imported by now, by its full ROS name, sorted."""
    return dict(sorted(REGISTERED.items()))


def message_type(name: str) -> type[Message]:
    """The type that a user calls `sensor_msgs/msg/LaserScan`, `sensor_msgs/LaserScan` or `LaserScan`.

    Types of installed packages (entry points `zteam.messages`) are imported if no other type has that name. Raises
    UsageError with the nearest names.
    """
    parts = name.strip("/").split("/")
    found = _by_parts(parts)
    if found is None:
        if len(parts) > 1:
            load_offered(MESSAGES, parts[0])
        else:
            for package in offered(MESSAGES):
                _import_offered(package)
        found = _by_parts(parts)
    if found is not None:
        return found
    known = all_types()
    near = difflib.get_close_matches(parts[-1], [t.rpartition("/")[2] for t in known], n=3, cutoff=0.4)
    hint = f"did you mean {', '.join(near)}?" if near else f"known: {', '.join(known)}"
    raise UsageError(f"no message type {name!r}: {hint}")


def _by_parts(parts: list[str]) -> type[Message] | None:
    # In the order of their definition: a bare name means zteam's own type before another package's.
    for ros_type, found in REGISTERED.items():
        package, _, bare = ros_type.split("/")
        if parts in ([package, "msg", bare], [package, bare], [bare]):
            return found
    return None


@cache
def encoding_of(kind: type[Message]) -> str:
    """The Zenoh encoding of a type: `application/cdr;sensor_msgs/msg/LaserScan`."""
    return f"application/cdr;{kind.ros_type}"


def type_of_encoding(encoding: str) -> type[Message] | None:
    """The type that an encoding names, or None. Imports it from an installed package where it is not zteam's own."""
    prefix, _, name = encoding.partition(";")
    if prefix != "application/cdr":
        return None
    return REGISTERED.get(name) or _offered_type(name)


@lru_cache(maxsize=1024)
def _offered_type(name: str) -> type[Message] | None:
    """The type called `name` of the package that offers its ROS package; None if there is none, or it is broken.

    Tools ask once for each message they see, so the answer is kept.
    """
    _import_offered(name.partition("/")[0])
    return REGISTERED.get(name)


def _import_offered(package: str) -> None:
    """Import the message types of `package`; a broken package is logged, because others may have the type."""
    try:
        load_offered(MESSAGES, package)
    except UsageError as error:
        log.warning("%s", error)


def time_from_ns(nanoseconds: int) -> Time:
    """A stamp from integer nanoseconds."""
    return Time(nanoseconds // _NS, nanoseconds % _NS)


def ns_from_time(time: Time) -> int:
    """Integer nanoseconds from a stamp."""
    return time.sec * _NS + time.nanosec
