"""The documents that a page may ask for, besides `team`: each made once, however many pages get it."""

import itertools
import math
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

import msgspec

from zteam import names
from zteam.bus.topics import type_of_key
from zteam.clock import NS_PER_S, monotonic, to_seconds
from zteam.errors import DecodeError
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import (
    Fiducials,
    Log,
    Marker,
    MarkerAction,
    MarkerArray,
    MarkerType,
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
from zteam.nodes.web.received import Arrival, Event
from zteam.nodes.web.scene import printable
from zteam.nodes.web.team_view import TeamView, decoded, pose2_of
from zteam.services.logs import HOLD, LogLine, LogOrder, level_name, line_of

KEPT = 1000


class Line(NamedTuple):
    """As the page gets it."""

    time: float
    """Seconds since the Unix epoch."""
    process: str
    level: str
    text: str


class LogTail:
    """Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._order = LogOrder(HOLD)
        self._numbers = itertools.count(1)
        self._lines: deque[tuple[int, Line]] = deque(maxlen=KEPT)

    def take(self, lines: Iterable[LogLine], now: float) -> None:
        """Lines came."""
        with self._lock:
            self._order.take(list(lines), now)

    def since(self, number: int, now: float) -> tuple[int, list[Line]]:
        """The lines after the one with this number, and the number of the last one."""
        with self._lock:
            for line in self._order.ready(now):
                shown = Line(line.time_ns / NS_PER_S, line.process, level_name(line.level), printable(line.text))
                self._lines.append((next(self._numbers), shown))
            found = [(n, line) for n, line in self._lines if n > number]
        return (found[-1][0] if found else number), [line for _, line in found]


PoseOf = Callable[[str], Pose2 | None]
"""The pose of a frame in `map`."""


class Sonar(msgspec.Struct):
    """One reading, with the sensor's pose in `map`."""

    robot: int
    x: float
    y: float
    yaw: float
    field_of_view: float
    range: float | None
    """None: no return."""
    max_range: float


class SeenFiducial(msgspec.Struct):
    """A marked model in sight, with its pose in `map`; id 0 is too far to be read."""

    robot: int
    """That sees it."""
    id: int
    x: float
    y: float
    yaw: float


def sonar_of(robot_id: int, reading: Range, pose_of: PoseOf) -> Sonar | None:
    """A reading in `map`; None while its frame is not known."""
    frame = pose_of(reading.header.frame_id)
    if frame is None:
        return None
    hit = reading.min_range <= reading.range < reading.max_range
    most = reading.max_range if math.isfinite(reading.max_range) else 0.0
    view = reading.field_of_view if math.isfinite(reading.field_of_view) else 0.0
    return Sonar(robot_id, *_rounded_pose(frame), view, round(reading.range, 3) if hit else None, most)


def fiducials_of(robot_id: int, message: Fiducials, pose_of: PoseOf) -> list[SeenFiducial]:
    """What a fiducial finder sees, in `map`."""
    frame = pose_of(message.header.frame_id)
    if frame is None:
        return []
    found = []
    for seen in message.fiducials:
        place = Pose2(seen.range * math.cos(seen.bearing), seen.range * math.sin(seen.bearing), seen.orientation)
        if all(map(math.isfinite, place)):
            found.append(SeenFiducial(robot_id, seen.id, *_rounded_pose(frame.compose(place))))
    return found


def _rounded_pose(pose: Pose2) -> tuple[float, float, float]:
    return round(pose.x, 4), round(pose.y, 4), round(pose.yaw, 4)


MAX_MARKERS = 2000
MAX_POINTS = 5000
"""Of one marker."""
_POLYGON = (0.2, 0.7, 0.3, 1.0)


class Drawn(msgspec.Struct):
    """One thing, with its pose in `map`; `type` is one of MarkerType."""

    ns: str
    id: int
    type: int
    x: float
    y: float
    yaw: float
    scale: tuple[float, float, float]
    color: tuple[float, float, float, float]
    points: list[tuple[float, float]] = []
    """In the frame of the pose."""
    text: str = ""


class MarkerBoard:
    """The markers that were added and not deleted, and have not expired. The caller passes the host's time."""

    def __init__(self) -> None:
        self._markers: dict[tuple[str, str, int], tuple[Marker, float]] = {}
        """By key, namespace and id, with the host time until which each is shown."""

    def take(self, key: str, markers: Iterable[Marker], now: float) -> None:
        """Markers came on a key."""
        for marker in markers:
            place = key, marker.ns, marker.id
            if marker.action == MarkerAction.DELETEALL:
                self._markers = {k: v for k, v in self._markers.items() if k[0] != key}
            elif marker.action == MarkerAction.DELETE:
                self._markers.pop(place, None)
            elif place in self._markers or len(self._markers) < MAX_MARKERS:
                span = marker.lifetime.sec + marker.lifetime.nanosec / 1e9
                self._markers[place] = marker, now + span if span > 0.0 else math.inf

    def keep(self, keys: Iterable[str]) -> None:
        """Forget the markers of all other keys."""
        kept = set(keys)
        self._markers = {place: marker for place, marker in self._markers.items() if place[0] in kept}

    def drawn(self, pose_of: PoseOf, now: float) -> list[Drawn]:
        """The markers whose frames are known."""
        self._markers = {place: marker for place, marker in self._markers.items() if now < marker[1]}
        found = (drawn_marker(key, marker, pose_of) for (key, _, _), (marker, _) in self._markers.items())
        return [drawn for drawn in found if drawn is not None]


def drawn_marker(key: str, marker: Marker, pose_of: PoseOf) -> Drawn | None:
    """A marker in `map`; None while its frame is not known."""
    frame = pose_of(marker.header.frame_id)
    if frame is None:
        return None
    pose, color, scale = frame.compose(pose2_of(marker.pose)), marker.color, marker.scale
    return Drawn(
        f"{key}/{marker.ns}" if marker.ns else key, marker.id, marker.type, *pose,
        (scale.x, scale.y, scale.z), (color.r, color.g, color.b, color.a),
        [(point.x, point.y) for point in marker.points[:MAX_POINTS]], marker.text[:1000],
    )  # fmt: skip


def drawn_polygon(key: str, polygon: PolygonStamped, pose_of: PoseOf) -> Drawn | None:
    """An outline as a closed line."""
    frame = pose_of(polygon.header.frame_id)
    points = [(point.x, point.y) for point in polygon.polygon.points[:MAX_POINTS]]
    if frame is None or not points:
        return None
    return Drawn(key, 0, MarkerType.LINE_STRIP, *frame, (0.02, 0.0, 0.0), _POLYGON, [*points, points[0]])


def as_document(drawn: Iterable[Drawn]) -> bytes:
    """The document."""
    return msgspec.json.encode([_plain(one) for one in drawn])


def _plain(one: Drawn) -> Mapping[str, Any]:
    plain: Mapping[str, Any] = msgspec.to_builtins(one)
    return {name: _rounded(value) for name, value in plain.items()}


def _rounded(value: Any) -> Any:
    """Numbers to a tenth of a millimetre; those that JSON lacks as 0."""
    if isinstance(value, float):
        return round(value, 4) if math.isfinite(value) else 0.0
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    return value


MAX_ECHO = 200_000
"""Bytes of a message's JSON that a page is sent."""


class Documents:
    """The thread that makes frames makes all calls."""

    def __init__(self, state: TeamView) -> None:
        self._state = state
        self._frames: dict[str, tuple[TransformStamped, bool]] = {}
        """By child: the newest transform, and whether it is fixed."""
        self._read: dict[str, int] = {}
        self._board = MarkerBoard()
        self._log = LogTail()
        state.queries.on_log = lambda lines: self._log.take(lines, monotonic())

    def transforms(self) -> bytes:
        """`tf`: every frame in its parent."""
        for key, fixed in ((names.TF_STATIC, True), (names.TF, False)):
            arrival = self._state.newest.get(key)
            if arrival is not None and self._read.get(key) != arrival.number:
                self._read[key] = arrival.number
                message = decoded(TFMessage, arrival.content)
                for transform in message.transforms if message else ():
                    self._frames[transform.child_frame_id] = transform, fixed
        now, by = self._state.places.stamp, self._state.queries.authorities
        rows = [_frame(*each, by.get(name, ""), now) for name, each in sorted(self._frames.items())]
        return msgspec.json.encode({"frames": rows})

    def topics(self) -> bytes:
        """`topics`: the keys, their types, rates and users."""
        return msgspec.json.encode(self._state.queries.topics)

    def log(self, number: int) -> tuple[int, list[Line]]:
        """`log`: the lines after that number, and the number of the last."""
        topic = names.log_key()
        events = self._state.history.since(topic, self._read.get(topic, 0))
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
        reply = self._state.queries.obstacles
        return msgspec.json.encode([each for each in reply.obstacles if each.movable] if reply else [])

    def markers(self) -> bytes:
        """`markers`: what other processes want to be drawn."""
        self._take_markers()
        drawn = self._board.drawn(self.pose_of, monotonic())
        for key, arrival in self._state.newest.items():
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
        for key, arrival in sorted(self._state.newest.items()):
            target = names.split_robot_key(key)
            if target is not None:
                yield *target, arrival

    def _take_markers(self) -> None:
        keys = self._state.drawables.keys("markers")
        self._board.keep(keys)
        for key in keys:
            events = self._state.history.since(key, self._read.get(key, 0))
            for event in events:
                self._read[key] = event.number
                if (array := _of_type(MarkerArray, event)) is not None:
                    self._board.take(key, array.markers, event.time)
                elif (marker := _of_type(Marker, event)) is not None:
                    self._board.take(key, [marker], event.time)

    def pose_of(self, frame: str) -> Pose2 | None:
        """The pose of a frame in `map`."""
        name = names.strip_slash(frame)
        return Pose2(0.0, 0.0, 0.0) if name == names.MAP_FRAME else self._state.places.pose_of(name)

    def echo(self, topic: str) -> tuple[int, bytes] | None:
        """The number and the document of the newest message of a topic; None before the first."""
        arrival = self._state.newest.get(topic)
        if arrival is None:
            return None
        shown = _shown(topic, arrival)
        stamp = to_seconds(self._state.places.stamp)
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
