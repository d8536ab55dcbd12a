"""Single transforms from the CDR bytes of a TFMessage, without decoding the rest of it.

Messages with the same frames in the same order differ only in their stamps and numbers: everything else is in the same
places. A `Layout` learns those places from one payload and reads any other payload that it fits. A `MessageLayout` does
the same for messages that were never encoded.
"""

import struct
from functools import lru_cache
from typing import Any, NamedTuple

from zteam.messages.geometry_msgs import Quaternion, TFMessage, Transform, TransformStamped, Vector3
from zteam.messages.std_msgs import Header, Time, ns_from_time

_HEADER = 4
"""Bytes of CDR's header; alignment is counted from its end."""


class _Place(NamedTuple):
    """One transform: the offsets of its stamp, of the end of its two names and of its seven numbers, and its frames."""

    stamp: int
    names_end: int
    numbers: int
    parent: str
    child: str


class Layout:
    """Where everything is in payloads with the same frames in the same order, of either byte order."""

    def __init__(self, payload: bytes) -> None:
        """`payload` is one that `decode` takes for a TFMessage."""
        order = "<" if payload[1] == 1 else ">"
        self._length = struct.Struct(order + "I")
        self._stamp = struct.Struct(order + "iI")
        self._numbers = struct.Struct(order + "7d")
        self._places: list[_Place] = []
        stamps = f"{order}{_HEADER}x"
        self._size = len(payload)
        (count,) = self._length.unpack_from(payload, _HEADER)
        at = _HEADER + self._length.size
        # All bytes but stamps, numbers and the padding before these: one call of `unpack` is enough to compare them.
        fixed = f"={at}s"
        for _ in range(count):
            place = self._read_place(payload, at)
            self._places.append(place)
            names, at = at + self._stamp.size, place.numbers + self._numbers.size
            fixed += f"{self._stamp.size}x{place.names_end - names}s{at - place.names_end}x"
            stamps += f"{place.stamp - struct.calcsize(stamps)}xiI"
        self._fixed = struct.Struct(f"{fixed}{self._size - at}x")
        self._fixed_bytes = self._fixed.unpack(payload)
        self._stamps = struct.Struct(stamps)

    def _read_place(self, payload: bytes, at: int) -> _Place:
        """The transform that begins at `at`; the one before it ends aligned."""
        parent, end = self._read_text(payload, at + self._stamp.size)
        child, end = self._read_text(payload, _align(end, 4))
        return _Place(at, end, _align(end, 8), parent, child)

    def _read_text(self, payload: bytes, at: int) -> tuple[str, int]:
        """A text and its end."""
        (length,) = self._length.unpack_from(payload, at)
        begin = at + self._length.size
        # The text ends with a NUL; some writers send the empty text without one.
        return payload[begin : begin + max(0, length - 1)].decode(), begin + length

    @property
    def parents(self) -> list[str]:
        """The parent frame of every transform."""
        return [place.parent for place in self._places]

    @property
    def children(self) -> list[str]:
        """The child frame of every transform."""
        return [place.child for place in self._places]

    def fits(self, payload: Any) -> bool:
        """Whether something is a payload that differs from the first one in stamps and numbers only.

        `decode` takes such a payload too, unless one of its numbers is not finite.
        """
        return (
            type(payload) is bytes and len(payload) == self._size and self._fixed.unpack(payload) == self._fixed_bytes
        )

    def stamp(self, payload: bytes, index: int) -> int:
        """The stamp (ns) of one transform of a payload that fits."""
        sec, nanosec = self._stamp.unpack_from(payload, self._places[index].stamp)
        stamp: int = sec * 1_000_000_000 + nanosec
        return stamp

    def span(self, payload: bytes) -> tuple[int, int]:
        """The oldest and the newest stamp (ns) in a payload that fits."""
        parts = self._stamps.unpack_from(payload)
        secs, nanosecs = parts[::2], parts[1::2]
        if secs.count(secs[0]) == len(secs) == nanosecs.count(nanosecs[0]):
            stamp = secs[0] * 1_000_000_000 + nanosecs[0]
            return stamp, stamp
        stamps = [sec * 1_000_000_000 + nanosec for sec, nanosec in zip(secs, nanosecs, strict=True)]
        return min(stamps), max(stamps)

    def numbers(self, payload: bytes, index: int) -> tuple[float, ...]:
        """Translation x, y, z and rotation x, y, z, w of one transform of a payload that fits."""
        return self._numbers.unpack_from(payload, self._places[index].numbers)

    def transform(self, payload: bytes, index: int) -> TransformStamped:
        """One transform of a payload that fits; its numbers may be NaN or infinite."""
        place = self._places[index]
        x, y, z, *rotation = self.numbers(payload, index)
        header = Header(Time(*self._stamp.unpack_from(payload, place.stamp)), place.parent)
        return TransformStamped(header, place.child, Transform(Vector3(x, y, z), Quaternion(*rotation)))


class MessageLayout:
    """The frames of messages with the same frames in the same order."""

    def __init__(self, message: TFMessage) -> None:
        self._frames, _ = _read(message)

    @property
    def parents(self) -> list[str]:
        """The parent frame of every transform."""
        return list(self._frames[::2])

    @property
    def children(self) -> list[str]:
        """The child frame of every transform."""
        return list(self._frames[1::2])

    def fits(self, message: Any) -> bool:
        """Whether something is a message that differs from the first one in stamps and numbers only."""
        return type(message) is TFMessage and _read(message)[0] == self._frames

    def stamp(self, message: TFMessage, index: int) -> int:
        """The stamp (ns) of one transform of a message that fits."""
        return ns_from_time(message.transforms[index].header.stamp)

    def span(self, message: TFMessage) -> tuple[int, int]:
        """The oldest and the newest stamp (ns) in a message that fits."""
        return _read(message)[1]

    def numbers(self, message: TFMessage, index: int) -> tuple[float, ...]:
        """Translation x, y, z and rotation x, y, z, w of one transform of a message that fits."""
        pose = message.transforms[index].transform
        p, q = pose.translation, pose.rotation
        return p.x, p.y, p.z, q.x, q.y, q.z, q.w

    def transform(self, message: TFMessage, index: int) -> TransformStamped:
        """One transform of a message that fits."""
        return message.transforms[index]


_Contents = tuple[tuple[str, ...], tuple[int, int]]
"""Parent, child, parent, …; and the oldest and the newest stamp."""

_newest: tuple[TFMessage | None, _Contents] = (None, ((), (0, 0)))
"""The message that was read last, which many receivers may share, and what it contains."""


def _read(message: TFMessage) -> _Contents:
    global _newest
    known, contents = _newest
    if known is not message:
        frames: list[str] = []
        stamps: list[int] = []
        for transform in message.transforms:
            header = transform.header
            frames += (header.frame_id, transform.child_frame_id)
            stamps.append(header.stamp.sec * 1_000_000_000 + header.stamp.nanosec)
        contents = _same_object(tuple(frames)), (min(stamps, default=0), max(stamps, default=0))
        _newest = message, contents
    return contents


@lru_cache(maxsize=64)
def _same_object(frames: tuple[str, ...]) -> tuple[str, ...]:
    """One object for all equal frames, which takes less time to compare."""
    return frames


def _align(at: int, size: int) -> int:
    """The first multiple of `size` from `at` on, counted from the end of the header."""
    return at + (_HEADER - at) % size
