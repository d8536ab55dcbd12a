"""Types by name, names on the wire, and stamps."""

import difflib
from functools import cache

from zteam.errors import UsageError
from zteam.messages import types
from zteam.messages.types import Message, Time

_NS = 1_000_000_000


@cache
def all_types() -> dict[str, type[Message]]:
    """Every message type by its full ROS name."""
    found = [t for t in vars(types).values() if isinstance(t, type) and issubclass(t, Message) and t is not Message]
    return {t.ros_type: t for t in sorted(found, key=lambda t: t.ros_type)}


def message_type(name: str) -> type[Message]:
    """The type that a user calls `sensor_msgs/msg/LaserScan`, `sensor_msgs/LaserScan` or `LaserScan`.

    Raises UsageError with the nearest names.
    """
    known = all_types()
    parts = name.strip("/").split("/")
    for ros_type, found in known.items():
        package, _, bare = ros_type.split("/")
        if parts in ([package, "msg", bare], [package, bare], [bare]):
            return found
    near = difflib.get_close_matches(parts[-1], [t.rpartition("/")[2] for t in known], n=3, cutoff=0.4)
    hint = f"did you mean {', '.join(near)}?" if near else f"known: {', '.join(known)}"
    raise UsageError(f"no message type {name!r}: {hint}")


@cache
def encoding_of(kind: type[Message]) -> str:
    """The Zenoh encoding of a type: `application/cdr;sensor_msgs/msg/LaserScan`."""
    return f"application/cdr;{kind.ros_type}"


def type_of_encoding(encoding: str) -> type[Message] | None:
    """The type that an encoding names, or None."""
    prefix, _, name = encoding.partition(";")
    return all_types().get(name) if prefix == "application/cdr" else None


def time_from_ns(nanoseconds: int) -> Time:
    """A stamp from integer nanoseconds."""
    return Time(nanoseconds // _NS, nanoseconds % _NS)


def ns_from_time(time: Time) -> int:
    """Integer nanoseconds from a stamp."""
    return time.sec * _NS + time.nanosec
