"""The document `markers`: markers and polygons as things to draw in `map`."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import msgspec

from zteam.geometry import Pose2
from zteam.messages import Marker, MarkerAction, MarkerType, PolygonStamped
from zteam.nodes.web.places import pose2_of

PoseOf = Callable[[str], Pose2 | None]
"""The pose of a frame in `map`."""
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
