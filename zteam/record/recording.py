"""Reads a recording, finished or not: what it holds, its messages, and what these say as tables."""

import os
import struct
from collections.abc import Iterator
from functools import cached_property
from io import BytesIO
from operator import attrgetter
from pathlib import Path
from typing import IO, Any

import msgspec
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema
from mcap.stream_reader import get_chunk_data_stream
from numpy.typing import NDArray

from zteam import names
from zteam.errors import DecodeError, UsageError, did_you_mean, log
from zteam.geometry import yaw_from_quaternion
from zteam.messages import Message, Odometry, decode
from zteam.messages.message import Field, fields_of
from zteam.record.definitions import type_of
from zteam.record.writing import FACTS, Entry

_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")
"""Of each record: its opcode, and how many bytes follow."""
_MESSAGE = struct.Struct("<HIQQ")
"""Channel, sequence, log time and publish time; the payload follows."""
_BROKEN = McapError, struct.error, ValueError, zstandard.ZstdError, KeyError, OverflowError
"""What the reading of damaged bytes raises."""


class Topic(msgspec.Struct):
    """What a recording holds of a key."""

    type: str
    """The ROS name."""
    messages: int = 0
    start: int = 0
    """Time of its first message (ns): simulated, or the host's where there is no simulator."""
    end: int = 0


class RecordedRobot(msgspec.Struct):
    id: int
    distance_m: float | None
    """Driven, by its ground truth; None without one."""


class RecordingReport(msgspec.Struct, kw_only=True):
    """What a recording is, and the figures of its run."""

    version: str
    """Of the zteam that has recorded it."""
    command: str
    seed: int | None
    """None where it was recorded beside a running team."""
    keys: list[str]
    """Key expressions that were recorded; empty for all."""
    is_finished: bool
    """Whether it has its summary: other readers refuse a file without one."""
    is_whole: bool | None
    """Whether it has every message of each tick, from the first on; None if its recorder has not come to its end."""
    lockstep: bool
    ticks: int
    """That are over, in lock-step."""
    seconds: float
    """From the first message to the last one, in the time of the recording."""
    messages: int
    lost: int
    """Messages that came faster than they could be written."""
    missed: int
    """Real time: ticks of which no clock has come."""
    gaps: list[str]
    """Messages that have not come, in words."""
    stray: dict[str, str]
    """Processes that publish outside of their steps, so that the run does not repeat: name and one of the keys."""
    robots: list[RecordedRobot]


class Recording:
    """A recording that `zteam up --record` or `zteam record` has written, or is writing.

    Of a file that was cut off, it reads all that is whole. Raises UsageError for a file that is no recording, here and
    where its damaged part is read.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.is_finished = False
        """Whether it has its summary: other readers refuse a file without one."""
        self.contents: dict[str, bytes] = {}
        """The attachments by name: how the run was launched, and the files that it has read."""
        self.definitions: dict[str, str] = {}
        """The texts of the message types that were met so far, by ROS name."""
        self._facts: list[dict[str, str]] = []
        self._chunks: list[tuple[int, int]] = []
        """Place and size in the file."""
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, tuple[str, str]] = {}
        """Key and type of those that the chunks read so far define."""
        self._kinds: dict[str, type[Message]] = {}
        try:
            with self.path.open("rb") as file:
                self._find_records(file, os.fstat(file.fileno()).st_size)
        except OSError as error:
            raise UsageError(f"{path}: cannot read a recording: {error.strerror}") from None
        if not self._facts:
            raise UsageError(f"{path} is an MCAP file, but holds no recording of zteam")

    def _find_records(self, file: IO[bytes], size: int) -> None:
        if file.read(len(_MAGIC)) != _MAGIC:
            raise UsageError(f"{self.path} is no recording: it is {'no MCAP file' if size else 'empty'}")
        end = len(_MAGIC)
        while end + _HEAD.size <= size:
            file.seek(end)
            opcode, length = _HEAD.unpack(file.read(_HEAD.size))
            begin, end = end + _HEAD.size, end + _HEAD.size + length
            if opcode == 0 or end > size:
                # It was cut off here.
                return
            if opcode == Opcode.CHUNK:
                self._chunks.append((begin, length))
            elif opcode in (Opcode.METADATA, Opcode.ATTACHMENT):
                self._keep(opcode, file.read(length))
            elif opcode == Opcode.FOOTER:
                file.seek(end)
                self.is_finished = file.read() == _MAGIC
                return

    def _keep(self, opcode: int, data: bytes) -> None:
        stream = ReadDataStream(BytesIO(data))
        try:
            if opcode == Opcode.ATTACHMENT:
                attachment = Attachment.read(stream)
                self.contents[attachment.name] = attachment.data
            elif (metadata := Metadata.read(stream)).name == FACTS:
                self._facts.append(metadata.metadata)
        except _BROKEN:
            raise self._damaged() from None

    def _damaged(self) -> UsageError:
        return UsageError(f"{self.path} is damaged: what it holds cannot be read")

    @property
    def facts(self) -> dict[str, str]:
        """What the file said of itself when it began: version, command, seed, keys."""
        return self._facts[0]

    @property
    def end_facts(self) -> dict[str, str]:
        """What its recorder has added at its end: ticks, is_whole, lost, gaps, stray; empty where it was killed."""
        return self._facts[1] if len(self._facts) > 1 else {}

    @property
    def chunks(self) -> int:
        """In how many parts the file has its messages; each is read as a whole."""
        return len(self._chunks)

    def entries(self, key: str = "") -> Iterator[Entry]:
        """All messages, or those of a key, in the order of the file."""
        for chunk in range(self.chunks):
            yield from self.entries_in(chunk, key)

    def entries_in(self, chunk: int, key: str = "") -> Iterator[Entry]:
        """Those of one chunk, from 0 on. The chunks before it have been read once: they define its channels."""
        data = self._content_of(chunk)
        at, size = 0, len(data)
        try:
            while at < size:
                opcode, length = _HEAD.unpack_from(data, at)
                begin, at = at + _HEAD.size, at + _HEAD.size + length
                if opcode == Opcode.MESSAGE:
                    channel, tick, time, _ = _MESSAGE.unpack_from(data, begin)
                    topic, kind = self._channels[channel]
                    if not key or topic == key:
                        yield Entry(topic, kind, time, data[begin + _MESSAGE.size : at], tick)
                elif opcode == Opcode.SCHEMA:
                    schema = Schema.read(ReadDataStream(BytesIO(data[begin:at])))
                    self._schemas[schema.id] = schema.name
                    self.definitions[schema.name] = schema.data.decode()
                elif opcode == Opcode.CHANNEL:
                    read = Channel.read(ReadDataStream(BytesIO(data[begin:at])))
                    self._channels[read.id] = names.strip_slash(read.topic), self._schemas[read.schema_id]
        except _BROKEN:
            raise self._damaged() from None

    def _content_of(self, chunk: int) -> bytes:
        begin, length = self._chunks[chunk]
        try:
            with self.path.open("rb") as file:
                file.seek(begin)
                read = Chunk.read(ReadDataStream(BytesIO(file.read(length))))
            stream, size = get_chunk_data_stream(read, validate_crc=True)
            return stream.read(size)
        except OSError as error:
            raise UsageError(f"{self.path}: cannot read a recording: {error.strerror}") from None
        except _BROKEN:
            if not self.is_finished and chunk == self.chunks - 1:
                # A host that went down may have kept the size of what was not written any more.
                return b""
            raise self._damaged() from None

    @cached_property
    def _scanned(self) -> tuple[dict[str, Topic], int]:
        topics: dict[str, Topic] = {}
        newest = 0
        for key, kind, time, _, tick in self.entries():
            topic = topics.get(key) or topics.setdefault(key, Topic(kind, 0, time, time))
            topic.messages += 1
            topic.start, topic.end = min(topic.start, time), max(topic.end, time)
            newest = max(newest, tick)
        return dict(sorted(topics.items())), newest

    @property
    def topics(self) -> dict[str, Topic]:
        """What was recorded, by key. The first call reads the file."""
        return self._scanned[0]

    @property
    def span(self) -> tuple[int, int]:
        """Time of the first message and of the last one (ns); both 0 without messages."""
        topics = self.topics.values()
        return min((each.start for each in topics), default=0), max((each.end for each in topics), default=0)

    def type_of(self, name: str) -> type[Message]:
        """The class of a recorded message type. It is made of the recorded definition where it is not installed here
        with the same fields. Raises UsageError for fields that zteam does not read."""
        if name not in self._kinds:
            self._kinds[name] = type_of(name, self.definitions[name])
        return self._kinds[name]

    def messages(self, key: str) -> Iterator[tuple[int, Any]]:
        """(time in ns, message) of a key such as `robot_0/odom`, in the order of their recording.

        The time is simulated, or the host's where there is no simulator. What is no message of the key's type is left
        out, with a warning. Raises UsageError for a key without messages.
        """
        found, refused = False, 0
        for entry in self.entries(names.strip_slash(key)):
            found = True
            try:
                message = decode(self.type_of(entry.type), entry.data)
            except DecodeError:
                refused += 1
                continue
            yield entry.time, message
        if not found:
            raise UsageError(f"{self.path} has no messages on {key}{did_you_mean(key, self.topics)}")
        if refused:
            log.warning("%s: %d messages on %s are none of its type, and are left out", self.path, refused, key)

    def table(self, key: str) -> dict[str, NDArray[Any]]:
        """The messages of a key as columns of equal length, for `pandas.DataFrame` among others.

        `time_s` is the time in seconds, as in `messages`. Each field has a column, and one in a nested message a name
        such as `pose.pose.position.x`. Numbers keep their type. A column of texts, arrays or lists holds objects.
        """
        times, kind, rows = [], None, []
        for time, message in self.messages(key):
            if kind is None:
                kind = type(message)
                columns = list(_columns(kind))
                # The message itself, too: with one name alone it would return no tuple.
                read = attrgetter("__class__", "__class__", *(name for name, _ in columns))
            if type(message) is kind:
                times.append(time / 1e9)
                rows.append(read(message)[2:])
        found: dict[str, NDArray[Any]] = {"time_s": np.array(times, np.float64)}
        for (name, field), values in zip(columns if kind else (), zip(*rows, strict=True), strict=True):
            is_number = field.kind is None and field.length is None
            found[name] = np.fromiter(values, np.dtype(field.ros_name) if is_number else np.dtype(object), len(rows))
        return found

    def poses(self, robot: int | str) -> NDArray[np.float64]:
        """(n, 4): time [s], x, y [m] and yaw [rad] in `map` of robot `robot` (7 or "robot_7"), by its ground truth.

        Raises UsageError where none was recorded.
        """
        robot_id = robot if isinstance(robot, int) else names.robot_id_of(robot)
        if robot_id is None:
            raise UsageError(f"{robot!r} is no robot; give 7 or 'robot_7'")
        rows = []
        for time, message in self.messages(names.robot_key(robot_id, names.GROUND_TRUTH)):
            if not isinstance(message, Odometry):
                # Any program can publish on a key.
                continue
            truth = message
            at, q = truth.pose.pose.position, truth.pose.pose.orientation
            rows.append((time / 1e9, at.x, at.y, yaw_from_quaternion(q.x, q.y, q.z, q.w)))
        return np.array(rows, np.float64).reshape(-1, 4)

    @cached_property
    def report(self) -> RecordingReport:
        """What the recording is, and the figures of its run. The first call reads the file."""
        begin, end = self.facts, self.end_facts
        topics, newest = self._scanned
        robot_ids = sorted({target[0] for key in topics if (target := names.split_robot_key(key))})
        try:
            seed = int(begin["seed"]) if "seed" in begin else None
            ticks, lost, missed = (
                int(facts.get(name, default))
                for facts, name, default in (
                    (end, "ticks", max(0, newest - 1)),
                    (end, "lost", 0),
                    (end, "missed", 0),
                )
            )
            stray = dict(line.split(" ", 1) for line in end.get("stray", "").splitlines())
        except ValueError:
            raise self._damaged() from None
        start, stop = self.span
        whole = end.get("is_whole")
        return RecordingReport(
            version=begin.get("version", ""),
            command=begin.get("command", ""),
            seed=seed,
            keys=begin.get("keys", "").split(),
            is_finished=self.is_finished,
            is_whole=None if whole is None else whole == str(True),
            lockstep=newest > 0,
            ticks=ticks,
            seconds=(stop - start) / 1e9,
            messages=sum(topic.messages for topic in topics.values()),
            lost=lost,
            missed=missed,
            gaps=end.get("gaps", "").splitlines(),
            stray=stray,
            robots=[RecordedRobot(each, self._distance(each)) for each in robot_ids],
        )

    def _distance(self, robot_id: int) -> float | None:
        if names.robot_key(robot_id, names.GROUND_TRUTH) not in self.topics:
            return None
        steps = np.diff(self.poses(robot_id)[:, 1:3], axis=0)
        return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def _columns(kind: type[Message], place: str = "") -> Iterator[tuple[str, Field]]:
    for field in fields_of(kind):
        if field.is_message:
            yield from _columns(field.kind, f"{place}{field.name}.")
        else:
            yield place + field.name, field
