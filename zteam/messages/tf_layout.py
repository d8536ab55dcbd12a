"""Single transforms from the CDR bytes of a TFMessage, without decoding the rest of it.

Messages with the same frames in the same order differ only in their stamps and numbers: everything else is in the same
places. A `Layout` learns those places from one payload and reads any other payload that it fits.
"""

import struct
from typing import NamedTuple

from zteam.messages.geometry_msgs import Quaternion, Transform, TransformStamped, Vector3
from zteam.messages.std_msgs import Header, Time

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
        self._fixed = struct.Struct(f"{fixed}{self._size - at}x")
        self._fixed_bytes = self._fixed.unpack(payload)

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
    def children(self) -> list[str]:
        """The child frame of every transform."""
        return [place.child for place in self._places]

    def fits(self, payload: bytes) -> bool:
        """Whether a payload differs from the first one in stamps and numbers only.

        `decode` takes such a payload too, unless one of its numbers is not finite.
        """
        return len(payload) == self._size and self._fixed.unpack(payload) == self._fixed_bytes

    def stamp(self, payload: bytes, index: int) -> int:
        """The stamp (ns) of one transform of a payload that fits."""
        sec, nanosec = self._stamp.unpack_from(payload, self._places[index].stamp)
        stamp: int = sec * 1_000_000_000 + nanosec
        return stamp

    def transform(self, payload: bytes, index: int) -> TransformStamped:
        """One transform of a payload that fits; its numbers may be NaN or infinite."""
        place = self._places[index]
        x, y, z, *rotation = self._numbers.unpack_from(payload, place.numbers)
        header = Header(Time(*self._stamp.unpack_from(payload, place.stamp)), place.parent)
        return TransformStamped(header, place.child, Transform(Vector3(x, y, z), Quaternion(*rotation)))


def _align(at: int, size: int) -> int:
    """The first multiple of `size` from `at` on, counted from the end of the header."""
    return at + (_HEADER - at) % size
