"""Writes a recording: an MCAP file as rosbag2 writes it (profile `ros2`, `cdr`, schemas `ros2msg`).

Its format is that of https://mcap.dev/spec; what readers of ROS 2 expect of it: docs/recording.md.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import IO, NamedTuple

import mcap.writer

from zteam.errors import UsageError
from zteam.messages.message import REGISTERED, definition_of
from zteam.messages.topics import is_latched
from zteam.version import __version__

FACTS = "zteam"
"""The name of the metadata records: one of the beginning, and in a finished file one of the end."""
_MOST_CHANNELS = 10_000
"""A sender can invent keys, and a file has room for 65,535."""
_RELIABLE, _KEEP_LAST, _VOLATILE, _TRANSIENT_LOCAL = 1, 1, 2, 1
"""Values of ROS 2's rmw_qos_profile_t, as integers: without a record of rosbag2, its readers take version 8."""


class Entry(NamedTuple):
    """A message to be recorded."""

    key: str
    type: str
    """The ROS name."""
    time: int
    """Simulated time (ns); of the host where there is none."""
    data: bytes
    """CDR."""
    tick: int = 0
    """The tick of lock-step in which a participant has published it; 0 for all else."""


class RecordingWriter:
    """An MCAP file that is being written. After `flush`, what was put before outlives this process."""

    def __init__(self, path: Path, facts: Mapping[str, str], contents: Mapping[str, bytes], *, force: bool) -> None:
        """`contents` are the attachments, by name. Raises UsageError where the file exists, unless `force`, or cannot
        be written."""
        try:
            self._file: IO[bytes] = path.open("wb" if force else "xb")
        except FileExistsError:
            raise UsageError(f"{path} exists: choose another file, or say --force to replace it") from None
        except OSError as error:
            raise UsageError(f"{path}: cannot write a recording: {error.strerror}") from None
        self._writer = mcap.writer.Writer(self._file, compression=mcap.writer.CompressionType.ZSTD)
        try:
            self._writer.start(profile="ros2", library=f"zteam {__version__}")
            self._writer.add_metadata(FACTS, {"version": __version__, **facts})
            for name, data in contents.items():
                kind = "application/json" if name.endswith(".json") else "application/octet-stream"
                self._writer.add_attachment(0, 0, name, kind, data)
            self._file.flush()
        except OSError as error:
            self.abandon()
            path.unlink()
            raise UsageError(f"{path}: cannot write a recording: {error.strerror}") from None
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[str, str], int] = {}
        self.count = 0
        """Messages."""

    def define(self, kind: str, definition: str) -> None:
        """The definition of a type that is none of zteam's."""
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", definition.encode())

    def knows(self, kind: str) -> bool:
        """Whether messages of this type can be put."""
        if kind not in self._schemas and kind in REGISTERED:
            self.define(kind, definition_of(REGISTERED[kind]))
        return kind in self._schemas

    def put(self, entry: Entry) -> str:
        """Record a message, whose type is known. Why it cannot be recorded; empty if it is."""
        if not (0 <= entry.time < 1 << 63 and 0 <= entry.tick < 1 << 32):
            return "its time, or its tick, is too large for a recording"
        channel = self._channels.get((entry.key, entry.type))
        if channel is None:
            if len(self._channels) >= _MOST_CHANNELS:
                return f"the recording has {_MOST_CHANNELS} keys already"
            channel = self._open_channel(entry.key, entry.type)
        self._writer.add_message(channel, entry.time, entry.data, entry.time, entry.tick)
        self.count += 1
        return ""

    def _open_channel(self, key: str, kind: str) -> int:
        if not self.knows(kind):
            raise KeyError(kind)
        metadata = {"offered_qos_profiles": qos_profiles(latched=is_latched(key))}
        channel = self._writer.register_channel(f"/{key}", "cdr", self._schemas[kind], metadata)
        self._channels[key, kind] = channel
        return channel

    def flush(self) -> None:
        """Give the system all that was put."""
        # The library ends a chunk by its size alone, and has no call of its own for it.
        self._writer._Writer__finalize_chunk()  # type: ignore[attr-defined]
        self._file.flush()

    def finish(self, facts: Mapping[str, str]) -> None:
        """Write the summary, without which other readers refuse the file."""
        try:
            self._writer.add_metadata(FACTS, {**facts})
            self._writer.finish()  # type: ignore[no-untyped-call]
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close the file as it is."""
        try:
            self._file.close()
        except OSError:
            # It holds what no longer fits on the disk.
            pass


def qos_profiles(*, latched: bool) -> str:
    """ROS 2's quality of service of a channel, in the YAML of version 8."""
    none = {"sec": 0, "nsec": 0}
    profile = {
        "history": _KEEP_LAST,
        "depth": 1 if latched else 10,
        "reliability": _RELIABLE,
        "durability": _TRANSIENT_LOCAL if latched else _VOLATILE,
        "deadline": none,
        "lifespan": none,
        "liveliness": 1,
        "liveliness_lease_duration": none,
        "avoid_ros_namespace_conventions": False,
    }
    # JSON is YAML.
    return json.dumps([profile])
