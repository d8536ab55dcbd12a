"""The documents that a page may ask for, besides `team`: each made once, however many pages get it."""

import math
from collections.abc import Iterator
from typing import Any

import msgspec

from zteam import names
from zteam.bus.topics import type_of_key
from zteam.clock import monotonic, to_seconds
from zteam.errors import DecodeError
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import (
    Fiducials,
    Log,
    Marker,
    MarkerArray,
    PolygonStamped,
    PoseStamped,
    Range,
    TFMessage,
    TransformStamped,
    decode,
    ns_from_time,
    to_plain,
    type_of_encoding,
)
from zteam.nodes.web.history import Event
from zteam.nodes.web.hub import Hub
from zteam.nodes.web.log_tail import Line, LogTail
from zteam.nodes.web.markers import (
    MarkerBoard,
    as_document,
    drawn_polygon,
)
from zteam.nodes.web.newest import Arrival
from zteam.nodes.web.places import decoded, pose2_of
from zteam.nodes.web.sensed import fiducials_of, sonar_of
from zteam.services.logs import line_of

MAX_ECHO = 200_000
"""Bytes of a message's JSON that a page is sent."""


class Documents:
    """The thread that makes frames makes all calls."""

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._frames: dict[str, tuple[TransformStamped, bool]] = {}
        """By child: the newest transform, and whether it is fixed."""
        self._read: dict[str, int] = {}
        self._board = MarkerBoard()
        self._log = LogTail()
        hub.facts.on_log = lambda lines: self._log.take(lines, monotonic())

    def transforms(self) -> bytes:
        """`tf`: every frame in its parent."""
        for key, fixed in ((names.TF_STATIC, True), (names.TF, False)):
            arrival = self._hub.newest.get(key)
            if arrival is not None and self._read.get(key) != arrival.number:
                self._read[key] = arrival.number
                message = decoded(TFMessage, arrival.content)
                for transform in message.transforms if message else ():
                    self._frames[transform.child_frame_id] = transform, fixed
        now, by = self._hub.places.stamp, self._hub.facts.authorities
        rows = [_frame(*each, by.get(name, ""), now) for name, each in sorted(self._frames.items())]
        return msgspec.json.encode({"frames": rows})

    def topics(self) -> bytes:
        """`topics`: the keys, their types, rates and users."""
        return msgspec.json.encode(self._hub.facts.topics)

    def log(self, number: int) -> tuple[int, list[Line]]:
        """`log`: the lines after that number, and the number of the last."""
        topic = names.log_key()
        events = self._hub.history.since(topic, self._read.get(topic, 0))
        if events:
            self._read[topic] = events[-1].number
            self._log.take(list(_lines(events)), monotonic())
        return self._log.since(number, monotonic())

    def goals(self) -> bytes:
        """`goals`: the newest goal of each robot, in `map`."""
        found = []
        for robot_id, topic, arrival in self._of_robots():
            if topic != names.GOAL_POSE:
                continue
            goal = decoded(PoseStamped, arrival.content)
            frame = None if goal is None else self.pose_of(goal.header.frame_id)
            if goal is not None and frame is not None:
                pose = frame.compose(pose2_of(goal.pose))
                if all(map(math.isfinite, pose)):
                    found.append({"robot": robot_id, "x": pose.x, "y": pose.y, "yaw": pose.yaw})
        return msgspec.json.encode(found)

    def obstacles(self) -> bytes:
        """`obstacles`: those of the world that can be pushed, where they are now. The others are in the map."""
        reply = self._hub.facts.obstacles
        return msgspec.json.encode([each for each in reply.obstacles if each.movable] if reply else [])

    def markers(self) -> bytes:
        """`markers`: what other processes want to be drawn."""
        self._take_markers()
        drawn = self._board.drawn(self.pose_of, monotonic())
        for key, arrival in self._hub.newest.items():
            if arrival.encoding and type_of_encoding(arrival.encoding) is PolygonStamped:
                outline = decoded(PolygonStamped, arrival.content)
                line = None if outline is None else drawn_polygon(key, outline, self.pose_of)
                drawn += [] if line is None else [line]
        return as_document(drawn)

    def sonars(self) -> bytes:
        """`sonars`: the newest reading of each."""
        found = []
        for robot_id, topic, arrival in self._of_robots():
            reading = decoded(Range, arrival.content) if topic.startswith(f"{names.SONAR}_") else None
            sonar = None if reading is None else sonar_of(robot_id, reading, self.pose_of)
            found += [] if sonar is None else [sonar]
        return msgspec.json.encode(found)

    def fiducials(self) -> bytes:
        """`fiducials`: those in sight."""
        found = []
        for robot_id, topic, arrival in self._of_robots():
            seen = decoded(Fiducials, arrival.content) if topic == names.FIDUCIALS else None
            found += [] if seen is None else fiducials_of(robot_id, seen, self.pose_of)
        return msgspec.json.encode(found)

    def _of_robots(self) -> Iterator[tuple[int, str, Arrival]]:
        for key, arrival in sorted(self._hub.newest.items()):
            target = names.split_robot_key(key)
            if target is not None:
                yield *target, arrival

    def _take_markers(self) -> None:
        keys = self._hub.drawables.keys("markers")
        self._board.keep(keys)
        for key in keys:
            events = self._hub.history.since(key, self._read.get(key, 0))
            for event in events:
                self._read[key] = event.number
                if (array := _of_type(MarkerArray, event)) is not None:
                    self._board.take(key, array.markers, event.time)
                elif (marker := _of_type(Marker, event)) is not None:
                    self._board.take(key, [marker], event.time)

    def pose_of(self, frame: str) -> Pose2 | None:
        """The pose of a frame in `map`."""
        name = names.strip_slash(frame)
        return Pose2(0.0, 0.0, 0.0) if name == names.MAP_FRAME else self._hub.places.pose_of(name)

    def echo(self, topic: str) -> tuple[int, bytes] | None:
        """The number and the document of the newest message of a topic; None before the first."""
        arrival = self._hub.newest.get(topic)
        if arrival is None:
            return None
        shown = _shown(topic, arrival)
        stamp = to_seconds(self._hub.places.stamp)
        return arrival.number, msgspec.json.encode({"topic": topic, "stamp": stamp, "json": shown})


def _of_type(kind: type[Any], event: Event) -> Any:
    if event.encoding and type_of_encoding(event.encoding) is not kind:
        return None
    return decoded(kind, event.content)


def _lines(events: list[Event]) -> Iterator[Any]:
    for event in events:
        process, message = names.split_log_key(event.key), decoded(Log, event.content)
        if process is not None and message is not None:
            yield line_of(process, message)


def _shown(topic: str, arrival: Arrival) -> Any:
    content = arrival.content
    if isinstance(content, bytes):
        kind = type_of_encoding(arrival.encoding) or type_of_key(topic)
        if kind is None:
            return f"{len(content)} bytes of {arrival.encoding or 'an unknown type'}"
        try:
            content = decode(kind, content)
        except DecodeError as error:
            return f"not readable: {error}"
    plain = to_plain(content)
    size = len(msgspec.json.encode(plain))
    return plain if size <= MAX_ECHO else f"a message of {size} bytes as JSON: too long to be shown"


def _frame(transform: TransformStamped, fixed: bool, by: str, now: int) -> dict[str, Any]:
    place, turn = transform.transform.translation, transform.transform.rotation
    return {
        "name": transform.child_frame_id,
        "parent": transform.header.frame_id,
        "x": round(place.x, 4),
        "y": round(place.y, 4),
        "z": round(place.z, 4),
        "yaw": round(yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w), 5),
        "static": fixed,
        "by": by,
        "age": 0.0 if fixed else round(to_seconds(now - ns_from_time(transform.header.stamp)), 3),
    }
