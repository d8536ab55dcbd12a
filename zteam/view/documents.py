"""The documents that a page may ask for, besides `team`: each made once, however many pages get it."""

import itertools
import math
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

import msgspec

from zteam import messages, names
from zteam.bus.graph import rate_of
from zteam.clock import NS_PER_S, monotonic, to_seconds
from zteam.errors import DecodeError, printable, short
from zteam.geometry import Pose2, yaw_from_quaternion
from zteam.messages import Fiducials, Log, Marker, NavigationStatus, PolygonStamped, PoseStamped, Range, ns_from_time
from zteam.messages.planar import pose2_of
from zteam.messages.topics import type_of_key
from zteam.node.log_client import HOLD, LogOrder, level_name, line_of
from zteam.node.logs import LogLine
from zteam.robot.client import GONE, ON_THE_WAY, SETTLED, is_same_goal
from zteam.view.received import Arrival, sensor_topics
from zteam.view.team_view import TeamView

KEPT = 1000


def sonar_of(robot_id: int, reading: Range, frame: Pose2) -> dict[str, Any]:
    """A reading of a sensor whose pose in `map` is `frame`; its range is None without a return."""
    hit = reading.min_range <= reading.range < reading.max_range
    return {
        "robot": robot_id, **frame._asdict(), "field_of_view": reading.field_of_view,
        "range": reading.range if hit else None, "max_range": reading.max_range,
    }  # fmt: skip


def fiducials_of(robot_id: int, message: Fiducials, frame: Pose2) -> Iterator[dict[str, Any]]:
    """The marked models that a robot's finder at `frame` sees, each with its pose in `map`; id 0 is too far to be
    read."""
    for seen in message.fiducials:
        place = Pose2(seen.range * math.cos(seen.bearing), seen.range * math.sin(seen.bearing), seen.orientation)
        if all(map(math.isfinite, place)):
            yield {"robot": robot_id, "id": seen.id, **frame.compose(place)._asdict()}


MAX_MARKERS = 2000
MAX_POINTS = 5000
"""Of one marker."""


class MarkerBoard:
    """The markers that were added and not deleted, and have not expired. The caller passes the host's time."""

    def __init__(self) -> None:
        self._markers: dict[tuple[str, str, int], tuple[Marker, float]] = {}
        """By key, namespace and id, with the host time until which each is shown."""

    def take(self, key: str, markers: Iterable[Marker], now: float) -> None:
        for marker in markers:
            place = key, marker.ns, marker.id
            if marker.action == messages.MarkerAction.DELETEALL:
                self._markers = {k: v for k, v in self._markers.items() if k[0] != key}
            elif marker.action == messages.MarkerAction.DELETE:
                self._markers.pop(place, None)
            elif place in self._markers or len(self._markers) < MAX_MARKERS:
                span = marker.lifetime.sec + marker.lifetime.nanosec / 1e9
                self._markers[place] = marker, now + span if span > 0.0 else math.inf

    def keep(self, keys: Iterable[str]) -> None:
        kept = set(keys)
        self._markers = {place: marker for place, marker in self._markers.items() if place[0] in kept}

    def drawn(self, pose_of: Callable[[str], Pose2 | None], now: float) -> list[dict[str, Any]]:
        """Those that are shown now; `pose_of` tells the pose of a frame in `map`."""
        self._markers = {place: marker for place, marker in self._markers.items() if now < marker[1]}
        return [
            drawn_marker(key, marker, frame)
            for (key, _, _), (marker, _) in self._markers.items()
            if (frame := pose_of(marker.header.frame_id)) is not None
        ]


def drawn_marker(key: str, marker: Marker, frame: Pose2) -> dict[str, Any]:
    """A marker with its pose in `map`, where the pose of its frame is `frame`; its points are in its own."""
    scale, color = marker.scale, marker.color
    return {
        "ns": f"{key}/{marker.ns}" if marker.ns else key, "id": marker.id, "type": marker.type,
        **frame.compose(pose2_of(marker.pose))._asdict(),
        "scale": (scale.x, scale.y, scale.z), "color": (color.r, color.g, color.b, color.a),
        "points": [(point.x, point.y) for point in marker.points[:MAX_POINTS]], "text": marker.text[:1000],
    }  # fmt: skip


def drawn_polygon(key: str, polygon: PolygonStamped, frame: Pose2) -> dict[str, Any]:
    """An outline as the marker of a closed line."""
    points = [(point.x, point.y) for point in polygon.polygon.points[:MAX_POINTS]]
    return {
        "ns": key, "id": 0, "type": messages.MarkerType.LINE_STRIP, **frame._asdict(),
        "scale": (0.02, 0.0, 0.0), "color": None, "points": [*points, *points[:1]], "text": "",
    }  # fmt: skip


def as_document(value: Any) -> bytes:
    return msgspec.json.encode(_rounded(value))


def _rounded(value: Any) -> Any:
    """Numbers to a tenth of a millimetre; those that JSON lacks as 0."""
    if isinstance(value, float):
        return round(value, 4) if math.isfinite(value) else 0.0
    if isinstance(value, dict):
        return {name: _rounded(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(item) for item in value]
    return value


def newest_goal(sent: Arrival | None, told: Arrival | None) -> tuple[PoseStamped, NavigationStatus | None] | None:
    """The newest goal of a robot and the status about it, of the goal that was sent last and of what the robot told
    last; None if it has none."""
    goal = sent.read(PoseStamped) if sent else None
    status = told.read(NavigationStatus) if told else None
    if status is None or told is None:
        return None if goal is None else (goal, None)
    if goal is not None and sent is not None and not is_same_goal(goal, status.goal):
        # The robot may still speak of the goal before.
        ahead = ns_from_time(status.header.stamp) - ns_from_time(goal.header.stamp)
        if told.number < sent.number or -SETTLED < ahead < SETTLED:
            return goal, None
    return None if status.state == messages.NavigationState.IDLE else (status.goal, status)


def goal_row(robot_id: int, goal: PoseStamped, status: NavigationStatus | None, frame: Pose2) -> dict[str, Any]:
    """A goal, whose frame's pose in `map` is `frame`: when it was sent (ns), metres and seconds that are left, and why
    its robot does not get on, or has given up."""
    row = {
        "robot": robot_id, **frame.compose(pose2_of(goal.pose))._asdict(), "stamp": ns_from_time(goal.header.stamp),
        # Its robot has said nothing of it yet; all other states are those of `NavigationState`, in lower case.
        "state": "sent", "distance": None, "seconds": None, "recoveries": 0, "text": "",
    }  # fmt: skip
    if status is not None:
        row["state"] = messages.NavigationState(min(status.state, messages.NavigationState.CANCELED)).name.lower()
        row["recoveries"], row["text"] = status.recoveries, short(status.text)
    if status is not None and status.state in ON_THE_WAY:
        left = status.estimated_time_remaining
        row["distance"] = round(status.distance_remaining, 1) or None
        # In whole seconds: a document that says more would change with every status.
        row["seconds"] = round(left.sec + left.nanosec / 1e9) or None
    return row


def _is_behavior(robot_id: int, status: NavigationStatus) -> bool:
    return status.header.frame_id == names.robot_name(robot_id)


S = TypeVar("S", Range, Fiducials)

MAX_CHAIN = 16
"""Frames from a robot up to the map."""
RATE_SPAN = 3.0
"""Host seconds over which a sensor's rate is counted."""
MAX_ECHO = 200_000
"""Bytes of a message's JSON that a page is sent."""


class Documents:
    """The thread that makes frames makes all calls."""

    def __init__(self, state: TeamView) -> None:
        self._state = state
        self._read: dict[str, int] = {}
        self._board = MarkerBoard()
        self._order = LogOrder(HOLD)
        self._numbers = itertools.count(1)
        self._lines: deque[tuple[int, dict[str, Any]]] = deque(maxlen=KEPT)
        """Of logs, with their numbers."""
        self._told: dict[int, Arrival] = {}
        """By robot: the newest status of what takes its goals."""
        self._gone: dict[int, float] = {}
        """By robot: since when the process that drives to a goal is gone."""
        self._kept_log: Sequence[LogLine] | None = None
        self.drawn: Mapping[str, Callable[[], bytes]] = {
            "goals": self.goals, "obstacles": self.obstacles, "markers": self.markers, "sonars": self.sonars,
            "fiducials": self.fiducials,
        }  # fmt: skip
        """Those of layers of the map."""

    def transforms(self) -> bytes:
        """`tf`: every frame in its parent."""
        places, known = self._state.places, self._state.queries.frames
        # The frames of a robot that was removed stay with this process.
        robots = None if self._state.queries.sim is None else {None, *self._state.robots()}
        rows = []
        for name, info in places.buffer.frames().items():
            if robots is None or names.robot_id_of(name.partition("/")[0]) in robots:
                found = places.buffer.lookup_transform(info.parent, name, 0)
                place, turn = found.transform.translation, found.transform.rotation
                age = 0.0 if info.static else to_seconds(places.stamp - ns_from_time(found.header.stamp))
                rows.append({
                    "name": name, "parent": info.parent, "x": round(place.x, 4), "y": round(place.y, 4),
                    "z": round(place.z, 4), "yaw": round(yaw_from_quaternion(turn.x, turn.y, turn.z, turn.w), 5),
                    "static": info.static, "by": known[name].authority if name in known else "", "age": round(age, 3),
                })  # fmt: skip
        return msgspec.json.encode({"frames": rows})

    @property
    def knows_frames(self) -> bool:
        """Whether transforms have come, or nothing is here that would send them."""
        received, queries = self._state.received, self._state.queries
        silent = received.get(names.TF) is None and received.get(names.TF_STATIC) is None
        return not (silent and (queries.alive(names.AGGREGATOR) or queries.loading))

    def log(self, number: int) -> tuple[int, list[dict[str, Any]]]:
        """`log`: the number of the newest line of all processes, and the lines after `number`, in order of time: `time`
        is in seconds since the Unix epoch."""
        now = monotonic()
        for event in self._since(names.log_key("*")):
            process, message = names.process_of(event.key, names.LOG), event.read(Log)
            if process is not None and message is not None:
                self._order.take([line_of(process, message)], now)
        if (kept := self._state.queries.kept_log) is not self._kept_log:
            self._kept_log = kept
            self._order.take(kept or (), now)
        for line in self._order.ready(now):
            level, text = level_name(line.level), printable(line.text)
            shown = {"time": line.time_ns / NS_PER_S, "process": line.process, "level": level, "text": text}
            self._lines.append((next(self._numbers), shown))
        found = [(n, line) for n, line in self._lines if n > number]
        return (found[-1][0] if found else number), [line for _, line in found]

    def goals(self) -> bytes:
        """`goals`: the newest goal of each robot, in `map`, and what has become of it."""
        sim, rows = self._state.queries.sim, []
        for robot_id in sorted(self._state.robots() if sim is None else sim.robots):
            sent = self._state.received.read(names.robot_key(robot_id, names.GOAL_POSE), PoseStamped)
            found = newest_goal(sent and sent[0], self._newest_told(robot_id))
            frame = found and self._state.places.pose_of(found[0].header.frame_id or names.MAP_FRAME)
            if found and frame:
                row, status = goal_row(robot_id, *found, frame), found[1]
                if status is not None and status.state in ON_THE_WAY:
                    self._end_with_process(row, status, monotonic())
                if math.isfinite(row["x"] + row["y"] + row["yaw"]):
                    rows.append(row)
        return as_document(rows)

    def _newest_told(self, robot_id: int) -> Arrival | None:
        found = self._state.received.read(names.robot_key(robot_id, names.NAVIGATION_STATUS), NavigationStatus)
        if found is None:
            self._told.pop(robot_id, None)
        elif not (_is_behavior(robot_id, found[1]) and self._state.queries.alive(names.navigation_name(robot_id))):
            # The header's frame tells a behaviour from navigation, which wins over it.
            self._told[robot_id] = found[0]
        return self._told.get(robot_id)

    def _end_with_process(self, row: dict[str, Any], status: NavigationStatus, now: float) -> None:
        robot_id = row["robot"]
        name = (names.robot_name if _is_behavior(robot_id, status) else names.navigation_name)(robot_id)
        if self._state.queries.speaks(name):
            self._gone.pop(robot_id, None)
        elif now - self._gone.setdefault(robot_id, now) > GONE:
            row["state"], row["text"] = "aborted", f"the process {name} is gone"

    def obstacles(self) -> bytes:
        """`obstacles`: those of the world that can be pushed, where they are now. The others are in the map."""
        reply = self._state.queries.obstacles
        return msgspec.json.encode([each for each in reply.obstacles if each.movable] if reply else [])

    def inspect(self, robot_id: int) -> bytes:
        """`inspect`: which processes say where a robot is, its sensors, and the parameters of its behaviour, which are
        missing if no process answers."""
        told = self._state.queries.parameters.get(robot_id)
        chain = list[dict[str, str]]()
        frame = names.robot_frame(robot_id, names.BASE_FOOTPRINT)
        while (info := self._state.queries.frames.get(frame)) and len(chain) < MAX_CHAIN:
            chain.append({"frame": frame, "parent": info.parent, "by": info.authority})
            frame = info.parent
        about = {"robot": robot_id, "frames": chain, "sensors": list(self._sensors(robot_id))}
        return msgspec.json.encode({**about, **(msgspec.structs.asdict(told) if told else {})})

    def _sensors(self, robot_id: int) -> Iterator[dict[str, Any]]:
        """Topic, type, rate and age (host seconds) of each sensor that was heard."""
        now = monotonic()
        for topic in sorted(sensor_topics(robot_id)):
            by_key = defaultdict[str, list[float]](list)
            for event in self._state.received.since(topic.key, 0):
                by_key[event.key].append(event.time)
            for key, times in sorted(by_key.items()):
                if (kind := type_of_key(key)) is topic.kind and kind is not None:
                    recent, age = [time for time in times if now - time <= RATE_SPAN], now - times[-1]
                    hz = rate_of(recent, RATE_SPAN)
                    yield {"topic": key, "type": kind.ros_type, "hz": round(hz, 1), "age": round(age, 1)}

    def markers(self) -> bytes:
        """`markers`: what other processes want to be drawn."""
        keys = self._state.drawables.of("markers")
        self._board.keep(keys)
        for key in keys:
            for event in self._since(key):
                if (array := event.read(messages.MarkerArray)) is not None:
                    self._board.take(key, array.markers, event.time)
                elif (marker := event.read(Marker)) is not None:
                    self._board.take(key, [marker], event.time)
        pose_of = self._state.places.pose_of
        drawn = self._board.drawn(pose_of, monotonic())
        for arrival in self._state.received.newest():
            outline = arrival.read(PolygonStamped) if arrival.kind is PolygonStamped else None
            frame = pose_of(outline.header.frame_id) if outline and outline.polygon.points else None
            if outline and frame is not None:
                drawn.append(drawn_polygon(arrival.key, outline, frame))
        return as_document(drawn)

    def sonars(self) -> bytes:
        """`sonars`: the newest reading of each."""
        return as_document([sonar_of(*each) for each in self._of_robots(names.SONAR, Range)])

    def fiducials(self) -> bytes:
        """`fiducials`: those in sight."""
        found = self._of_robots(names.FIDUCIALS, Fiducials)
        return as_document([seen for each in found for seen in fiducials_of(*each)])

    def _of_robots(self, topic: str, kind: type[S]) -> Iterator[tuple[int, S, Pose2]]:
        """Robot, newest message, and the pose in `map` of the message's frame, for each key of this topic, which may
        be a numbered one."""
        for robot_id, own, arrival in sorted(self._state.received.of_robots()):
            message = arrival.read(kind) if own.rstrip("_0123456789") == topic else None
            frame = message and self._state.places.pose_of(message.header.frame_id)
            if message and frame:
                yield robot_id, message, frame

    def _since(self, topic: str) -> Iterator[Arrival]:
        """The kept messages of a topic that were not read before."""
        for event in self._state.received.since(topic, self._read.get(topic, 0)):
            self._read[topic] = event.number
            yield event

    def echo(self, arrival: Arrival) -> bytes:
        """`echo`: a message of a topic."""
        stamp = to_seconds(self._state.places.stamp)
        return msgspec.json.encode({"topic": arrival.key, "stamp": stamp, "json": _shown(arrival)})


def _shown(arrival: Arrival) -> Any:
    content = arrival.content
    if isinstance(content, bytes):
        if arrival.kind is None:
            return f"{len(content)} bytes of {arrival.encoding or 'an unknown type'}"
        try:
            content = messages.decode(arrival.kind, content)
        except DecodeError as error:
            return f"not readable: {error}"
    plain = messages.to_plain(content)
    size = len(msgspec.json.encode(plain))
    return plain if size <= MAX_ECHO else f"a message of {size} bytes as JSON: too long to be shown"
