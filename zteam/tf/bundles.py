"""The aggregator's bundles, of which a robot reads only the frames that it looks up.

A bundle holds the whole team. All that a follower needs of it is two frames, and to decode the other ninety-eight of
fifty robots' takes most of its time. Bundles come one a tick with the same frames in the same order, so the places of
everything in a payload are learnt from one and hold for the next. The payloads are kept as they came, and a frame is
read from those that it has not been read from yet when somebody asks for it.
"""

import struct
import threading
from collections.abc import Iterable
from typing import NamedTuple

from zteam.errors import DecodeError
from zteam.messages import (
    Header,
    Quaternion,
    TFMessage,
    Time,
    Transform,
    TransformStamped,
    Vector3,
    decode,
    ns_from_time,
)
from zteam.tf.buffer import Buffer

_LITTLE = b"\x00\x01"
_ORIGIN = 4
"""CDR counts alignment from behind its header."""
_STAMP = struct.Struct("<iI")
_LENGTH = struct.Struct("<I")
_NUMBERS = struct.Struct("<7d")
_PRUNE = 64
"""Payloads between looks for those that are too old."""


class _Entry(NamedTuple):
    """One transform's place in a payload."""

    stamp: int
    names: bytes
    """The payload from behind the stamp up to `end`: both frames with their lengths."""
    end: int
    numbers: int
    parent: str
    child: str


def _read_text(payload: bytes, at: int) -> tuple[str, int]:
    (length,) = _LENGTH.unpack_from(payload, at)
    end = at + _LENGTH.size + length
    return payload[at + _LENGTH.size : end - 1].decode(), end


def _align(at: int, size: int) -> int:
    return at + (_ORIGIN - at) % size


def _learn(payload: bytes) -> list[_Entry]:
    """Where everything is in a payload that has been decoded without an error."""
    (count,) = _LENGTH.unpack_from(payload, _ORIGIN)
    at, entries = _ORIGIN + _LENGTH.size, []
    for _ in range(count):
        stamp = _align(at, 4)
        names = stamp + _STAMP.size
        parent, at = _read_text(payload, names)
        child, end = _read_text(payload, _align(at, 4))
        numbers = _align(end, 8)
        entries.append(_Entry(stamp, payload[names:end], end, numbers, parent, child))
        at = numbers + _NUMBERS.size
    return entries


def _names_in(payload: bytes, entry: _Entry) -> bytes:
    return payload[entry.stamp + _STAMP.size : entry.end]


class Bundles:
    """Bundles on their way into a buffer. Safe to use from several threads."""

    def __init__(self, buffer: Buffer, authority: str) -> None:
        self._buffer = buffer
        self._authority = authority
        self._lock = threading.Lock()
        self._payloads: list[bytes] = []
        """All of one layout, oldest first."""
        self._entries: list[_Entry] = []
        self._by_child: dict[str, _Entry] = {}
        self._read: dict[str, int] = {}
        """How many of the payloads each frame has been read from."""
        self._paths: dict[tuple[str, str], list[str]] = {}

    def take(self, payload: bytes) -> int:
        """A bundle has come; the stamp (ns) of its last transform, 0 if it is empty. Raises DecodeError."""
        with self._lock:
            if not self._payloads or not self._is_alike(payload):
                return self._take_other(payload)
            self._payloads.append(payload)
            if len(self._payloads) % _PRUNE == 0:
                self._prune()
            return self._stamp(payload, self._entries[-1])

    def _is_alike(self, payload: bytes) -> bool:
        """Whether a payload seems to have the layout that is known; each frame's place is looked at when it is read."""
        return (
            len(payload) == len(self._payloads[-1])
            and payload[:2] == _LITTLE
            and _names_in(payload, self._entries[-1]) == self._entries[-1].names
        )

    def _take_other(self, payload: bytes) -> int:
        """A bundle of another layout: what is known of the old one is read, and all of this."""
        message = decode(TFMessage, payload)
        self._settle(list(self._by_child))
        for transform in message.transforms:
            self._buffer.set_transform(transform, self._authority)
        self._forget()
        if not message.transforms:
            return 0
        if payload[:2] == _LITTLE:
            self._entries = _learn(payload)
            self._by_child = {entry.child: entry for entry in self._entries}
            if len(self._by_child) == len(self._entries):
                self._payloads = [payload]
                self._read = dict.fromkeys(self._by_child, 1)
        return ns_from_time(message.transforms[-1].header.stamp)

    def settle(self, target_frame: str, source_frame: str) -> None:
        """Bring every frame between these two up to date in the buffer."""
        with self._lock:
            path = self._paths.get((target_frame, source_frame))
            if path is None:
                path = self._paths[target_frame, source_frame] = self._find_path(target_frame, source_frame)
            self._settle(path)

    def clear(self) -> None:
        """Forget what was not read: time has gone back."""
        with self._lock:
            self._forget()

    def forget_paths(self) -> None:
        """The tree's fixed part may have changed."""
        with self._lock:
            self._paths.clear()

    def _forget(self) -> None:
        self._payloads, self._entries, self._by_child, self._read = [], [], {}, {}
        self._paths.clear()

    def _find_path(self, *frames: str) -> list[str]:
        """The frames from these up to their roots that bundles tell of."""
        known, found = self._buffer.frames(), set()
        for frame in frames:
            while frame in known and frame not in found:
                found.add(frame)
                frame = known[frame].parent
        return sorted(found & self._by_child.keys())

    def _settle(self, children: Iterable[str]) -> None:
        count = len(self._payloads)
        for child in children:
            first = self._read.get(child, count)
            if first < count:
                self._read[child] = count
                entry = self._by_child[child]
                for payload in self._payloads[first:]:
                    self._apply(payload, entry)

    def _apply(self, payload: bytes, entry: _Entry) -> None:
        if _names_in(payload, entry) != entry.names:
            # As long as the others, but with other frames.
            try:
                message = decode(TFMessage, payload)
            except DecodeError:
                return
            for transform in message.transforms:
                self._buffer.set_transform(transform, self._authority)
            return
        sec, nanosec = _STAMP.unpack_from(payload, entry.stamp)
        x, y, z, *rotation = _NUMBERS.unpack_from(payload, entry.numbers)
        pose = Transform(Vector3(x, y, z), Quaternion(*rotation))
        header = Header(Time(sec, nanosec), entry.parent)
        self._buffer.set_transform(TransformStamped(header, entry.child, pose), self._authority)

    @staticmethod
    def _stamp(payload: bytes, entry: _Entry) -> int:
        sec, nanosec = _STAMP.unpack_from(payload, entry.stamp)
        stamp: int = sec * 1_000_000_000 + nanosec
        return stamp

    def _prune(self) -> None:
        """Drop payloads that the buffer would not keep either."""
        last = self._entries[-1]
        oldest = self._stamp(self._payloads[-1], last) - self._buffer.cache
        cut = 0
        while self._stamp(self._payloads[cut], last) < oldest:
            cut += 1
        if cut:
            del self._payloads[:cut]
            self._read = {child: max(0, read - cut) for child, read in self._read.items()}
