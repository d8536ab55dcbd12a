"""Reads the view's binary frames again."""

import struct
from typing import NamedTuple

KIND, VERSION = 1, 1

_HEADER = struct.Struct("<BBHIQdd")
_BLOCK = struct.Struct("<BBHI")


class Frame(NamedTuple):
    """What the header says."""

    number: int
    tick: int
    stamp: float
    """Seconds of the clock that the team lives on."""
    age: float
    """Host seconds since the newest pose came, when the frame was sent."""


def decode_frame(data: bytes) -> tuple[Frame, list[tuple[int, int, int, bytes]]]:
    """The header, and type, flags, id and body of each block. Raises ValueError for anything that is no frame."""
    try:
        kind, version, count, *rest = _HEADER.unpack_from(data)
        blocks, at = [], _HEADER.size
        for _ in range(count):
            block, flags, owner, length = _BLOCK.unpack_from(data, at)
            body = data[at + _BLOCK.size : at + _BLOCK.size + length]
            if len(body) != length:
                raise ValueError("a block is longer than the frame")
            blocks.append((block, flags, owner, body))
            at += _BLOCK.size + length + -length % 8
    except struct.error as error:
        raise ValueError(f"no frame: {error}") from None
    if (kind, version) != (KIND, VERSION) or at != len(data):
        raise ValueError("no frame of this version")
    return Frame(*rest), blocks
