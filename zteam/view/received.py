"""What the pages look at is subscribed to, and kept as it comes: nothing is decoded before a page shows it."""

import itertools
import threading
from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import NamedTuple, TypeVar

import msgspec

from zteam import messages, names
from zteam.bus import Bus
from zteam.bus.transport import Closeable, RawSample
from zteam.clock import monotonic
from zteam.errors import BusError, DecodeError
from zteam.geometry import Pose2
from zteam.messages import Marker, MarkerArray, Message, decode, type_of_encoding
from zteam.messages.topics import SENSORS, type_of_key
from zteam.node.tick_messages import stamp_of
from zteam.view.requests import MAX_WATCHES, Ack, Look, Watch

M = TypeVar("M", bound=Message)


class Arrival(msgspec.Struct, eq=False):
    key: str
    content: bytes | Message
    """Its bytes, until it is read; then the message, for all readers."""
    number: int
    """Grows with every message of any key."""
    time: float
    """Host time at which it came."""
    encoding: str = ""
    """Empty where the key has one type."""

    @property
    def kind(self) -> type[Message] | None:
        """Its type; None if neither encoding nor key tells."""
        if isinstance(self.content, Message):
            return type(self.content)
        return type_of_encoding(self.encoding) or type_of_key(self.key)

    def read(self, kind: type[M]) -> M | None:
        """The message; None if it is none of this type."""
        content = self.content
        if not isinstance(content, Message):
            if type_of_encoding(self.encoding) not in (kind, None):
                return None
            try:
                content = self.content = decode(kind, content)
            except DecodeError:
                return None
        return content if isinstance(content, kind) else None

    @property
    def stamp(self) -> int:
        """Of its header, in ns; 0 without one."""
        message = self.read(self.kind) if self.kind else None
        return 0 if message is None else stamp_of(message)


KEPT = 2000
"""Messages of one topic."""
KEPT_BYTES = 16_000_000
"""Of one topic; the newest message is kept whatever its size."""
MAX_BUNDLES = 500
"""Messages of transforms that wait while no page takes a frame."""


class Received:
    """The newest message of each key, and of some topics all for a while.

    Filled by threads of the bus, read by the one that makes frames.
    """

    def __init__(self, on_news: Callable[[], None]) -> None:
        self._on_news = on_news
        self._lock = threading.Lock()
        self.number = 0
        """Of the newest message of all keys."""
        self._newest: dict[str, Arrival] = {}
        self.bundles = deque[Arrival](maxlen=MAX_BUNDLES)
        """All of transforms, until they are read."""
        self._kept: dict[str, deque[Arrival]] = {}

    def take(self, key: str, content: bytes | Message, encoding: str = "", *, topic: str = "") -> None:
        """A message came; by the subscription to `topic` if each message of that counts."""
        with self._lock:
            self.number += 1
            arrival = Arrival(key, content, self.number, monotonic(), encoding)
            if not topic:
                self._newest[key] = arrival
                if key == names.TF:
                    self.bundles.append(arrival)
            else:
                kept = self._kept.setdefault(topic, deque(maxlen=KEPT))
                kept.append(arrival)
                # The messages of a topic are of about one size.
                size = len(content) if isinstance(content, bytes) else 0
                while len(kept) > 1 and len(kept) * size > KEPT_BYTES:
                    kept.popleft()
        self._on_news()

    def get(self, key: str) -> Arrival | None:
        """The newest of a key; None before the first."""
        return self._newest.get(key)

    def read(self, key: str, kind: type[M]) -> tuple[Arrival, M] | None:
        """The newest of a key, and its message; None without one of this type."""
        arrival = self._newest.get(key)
        message = arrival.read(kind) if arrival else None
        return None if arrival is None or message is None else (arrival, message)

    def newest(self) -> list[Arrival]:
        with self._lock:
            return list(self._newest.values())

    def of_robots(self) -> list[tuple[int, str, Arrival]]:
        """Robot, topic and message of the newest of all keys of robots."""
        split = [(names.split_robot_key(arrival.key), arrival) for arrival in self.newest()]
        return [(*target, arrival) for target, arrival in split if target is not None]

    def keep_robots(self, robots: Collection[int]) -> None:
        """Forget the newest of the keys of all other robots."""
        gone = [arrival.key for robot_id, _, arrival in self.of_robots() if robot_id not in robots]
        with self._lock:
            for key in gone:
                self._newest.pop(key, None)

    def forget_after(self, stamp: int) -> None:
        """Forget what was said after `stamp` (ns), but for the map: that need not be said again."""
        later = [one for one in self.newest() if one.key != names.MAP and one.stamp > stamp]
        with self._lock:
            for arrival in later:
                if self._newest.get(arrival.key) is arrival:
                    del self._newest[arrival.key]

    def clear(self) -> None:
        with self._lock:
            self._newest.clear()
            self.bundles.clear()

    def since(self, topic: str, number: int) -> list[Arrival]:
        """The kept messages of a topic after the one with this number, oldest first."""
        with self._lock:
            newer = itertools.takewhile(lambda one: one.number > number, reversed(self._kept.get(topic, ())))
            return [*newer][::-1]

    def forget(self, topic: str) -> None:
        with self._lock:
            self._kept.pop(topic, None)


class Topic(NamedTuple):
    """What is subscribed to."""

    key: str
    """A key expression."""
    kind: type[Message] | None = None
    """None: the samples' encoding tells."""
    latched: bool = False
    every: bool = False
    """Whether each message counts, not only the newest."""


class Subscriptions:
    """One thread makes all calls."""

    def __init__(self, bus: Bus, received: Received) -> None:
        self._bus, self._received = bus, received
        self._open: dict[Topic, Closeable | None] = {}
        self.opened = 0
        """How many were opened so far that miss what was sent before."""

    def match(self, wanted: Iterable[Topic]) -> None:
        """Subscribe to these and to nothing else. A key that is no key expression is left out."""
        chosen = set(wanted)
        for topic in self._open.keys() - chosen:
            if (handle := self._open.pop(topic)) is not None:
                handle.close()
            if topic.every:
                self._received.forget(topic.key)
        for topic in chosen:
            if topic not in self._open:
                self.opened += not topic.latched
                try:
                    self._open[topic] = self._subscribe(topic)
                except BusError:
                    self._open[topic] = None

    def _subscribe(self, topic: Topic) -> Closeable:
        take, kept = self._received.take, topic.key if topic.every else ""

        def on_sample(sample: RawSample) -> None:
            take(sample.key, sample.content, sample.encoding, topic=kept)

        # With a type without time and source: at the rate of lock-step those are most of the cost of a view.
        only = None if topic.latched else topic.kind
        return self._bus.subscribe_raw(topic.key, on_sample, latched=topic.latched, only=only)


LAYERS: Mapping[str, tuple[type[Message], ...]] = {
    "plans": (messages.Path,),
    "costmaps": (messages.OccupancyGrid,),
    "particles": (messages.PoseArray,),
    "markers": (Marker, MarkerArray, messages.PolygonStamped),
}
"""Message types by the layer that shows them."""
MAX_KEYS = 1024


class Drawables(dict[str, type[Message] | None]):
    """The keys that other processes publish, sorted, with their types; None until a first message has told."""

    def __init__(self, published: Iterable[str], received: Received) -> None:
        """`received` has the first messages."""
        keys = {key for key in published if not names.is_wildcard(key) and key != names.MAP and key[0] != "@"}
        for key in sorted(keys)[:MAX_KEYS]:
            self[key] = type_of_key(key)
            if self[key] is None and (arrival := received.get(key)) is not None:
                self[key] = type_of_encoding(arrival.encoding) or Message

    def of(self, layer: str) -> list[str]:
        return [key for key, kind in self.items() if kind in LAYERS[layer]]

    def topics(self, layers: Collection[str]) -> set[Topic]:
        """What to subscribe to for these layers; a key of unknown type until its first message."""
        chosen = [kind for layer in layers for kind in LAYERS.get(layer, ())]
        return {
            Topic(key, latched=True, every=kind in (Marker, MarkerArray))
            for key, kind in self.items()
            if chosen and (kind is None or kind in chosen)
        }


PERIOD, FAST_PERIOD = 0.05, 0.1
"""Host seconds between two frames of one page, at least; the second one where time runs fast, to slow that run less."""


REACH = 5.0
"""Metres beside its viewport from which a page is shown what sensors see."""
UNDER_WAY = 2
"""Frames to a page that it has not acknowledged, at most: with one, a link of 400 ms has two a second."""


class Viewer:
    """The caller passes the host's time."""

    def __init__(self, number: int, may_command: bool) -> None:
        self.number, self.may_command = number, may_command
        self.look = Look()
        self.watches: dict[tuple[str, str], int] = {}
        """The topics and fields that it watches, with the number of the newest message that it has of each."""
        self.scans: dict[tuple[int, int], object] = {}
        """The version of the scan that it shows, by robot and number of the laser."""
        self.has: dict[object, object] = {}
        """What the page has of each thing, such as the number of the scan of a key."""
        self.era = 0
        """How often time was set back before the newest frame."""
        self.log_number = 0
        """Of the newest line of logs that it has."""
        self.cut = ""
        """The grid of which tiles did not fit into the newest frame; empty if all did."""
        self.frame = 0
        """The number of the newest frame that was sent."""
        self.sent = float("-inf")
        """Host time of that frame."""
        self._acknowledged = 0

    @property
    def inspected(self) -> int | None:
        return self.look.selected[0] if "inspect" in self.look.docs and self.look.selected else None

    @property
    def layers(self) -> set[str]:
        return {*self.look.layers, *(() if self.inspected is None else ("goals",))}

    @property
    def has_credit(self) -> bool:
        """Whether another frame may be under way to it."""
        return self.frame - self._acknowledged < UNDER_WAY

    def on_ack(self, ack: Ack) -> None:
        """It has taken a frame. One that it was never sent changes nothing."""
        if ack.frame <= self.frame:
            self._acknowledged = max(ack.frame, self._acknowledged)

    def on_watch(self, watch: Watch) -> None:
        """It watches a topic or field from now on, unless it watches too many, or no more."""
        if watch.op == "unwatch":
            self.watches.pop((watch.topic, watch.field), None)
        elif len(self.watches) < MAX_WATCHES:
            self.watches.setdefault((watch.topic, watch.field), 0)

    def next_frame(self, now: float) -> int:
        """Count a frame that is sent now; its number."""
        self.frame += 1
        self.sent = now
        return self.frame

    def lacks(self, thing: object, version: object) -> bool:
        """Whether it has another version of a thing, or none; from now on it has this one."""
        if self.has.get(thing) == version:
            return False
        self.has[thing] = version
        return True

    def forget(self, era: int) -> None:
        """Time was set back: the page has dropped all but the map, and is sent the rest anew."""
        self.era = era
        self.has = {thing: it for thing, it in self.has.items() if isinstance(thing, tuple) and thing[0] == names.MAP}
        self.scans = dict.fromkeys(self.scans)

    def sees(self, x: float, y: float) -> bool:
        """Whether a point of `map` is in its viewport, or a sensor there may reach into it."""
        view = self.look.viewport
        return not view or (view[0] - REACH <= x <= view[2] + REACH and view[1] - REACH <= y <= view[3] + REACH)


def sensor_topics(robot_id: int) -> set[Topic]:
    """What is measured of a robot. Each message counts, as their rates are shown."""
    return {
        Topic(names.robot_key(robot_id, names.all_numbered(stem)), kind, every=True) for stem, kind in SENSORS.items()
    }


SENSED: Mapping[str, tuple[str, type[Message]]] = {
    "scans": (names.all_numbered(names.BASE_SCAN), messages.LaserScan),
    "sonars": (names.all_numbered(names.SONAR), messages.Range),
    "fiducials": (names.FIDUCIALS, messages.Fiducials),
}
"""What the layers of sensors show of each robot in sight."""
MAX_SCANNED = 100
"""Robots whose sensors one page is shown at a time, the selected ones first, then those nearest to its middle."""


TEAM = (
    Topic(names.TF_STATIC, None, latched=True),
    Topic(names.MAP, None, latched=True),
    Topic(names.all_robots_key(names.BASE_INFO), None, latched=True),
    # It comes when a localiser has moved its estimate, not with every tick.
    Topic(names.all_robots_key(names.AMCL_POSE), None, latched=True),
)
"""What every page shows, besides what a `TeamObserver` has: the statuses of team and robots."""


def topics_of(
    viewers: Collection[Viewer],
    poses: Mapping[int, Pose2],
    drawables: Drawables,
    *,
    aggregator: bool,
    truth_of: Collection[int] = (),
) -> set[Topic]:
    """What these pages look at; `aggregator`: whether there is one, else the robots' poses are the simulator's.

    What localisers say of the robots `truth_of` is compared with the simulator's own.
    """
    if not viewers:
        return set()
    wanted = {*TEAM}
    if not aggregator:
        wanted.add(Topic(names.all_robots_key(names.GROUND_TRUTH), messages.Odometry))
    else:
        wanted.add(Topic(names.TF, messages.TFMessage))
        wanted |= {Topic(names.robot_key(robot_id, names.GROUND_TRUTH), messages.Odometry) for robot_id in truth_of}
    for viewer in viewers:
        layers = viewer.layers
        wanted |= drawables.topics(layers)
        if viewer.inspected is not None:
            wanted |= sensor_topics(viewer.inspected)
        # Of a plot each message counts. The last message is enough for an echo, also if it came before the page.
        wanted |= {Topic(topic, latched=not field, every=bool(field)) for topic, field in viewer.watches}
        if "log" in viewer.look.docs:
            wanted.add(Topic(names.log_key("*"), messages.Log, every=True))
        if "goals" in layers:
            wanted.add(Topic(names.all_robots_key(names.GOAL_POSE), messages.PoseStamped))
            wanted.add(Topic(names.all_robots_key(names.NAVIGATION_STATUS), messages.NavigationStatus))
        if "costs" in layers:
            wanted |= {Topic(names.robot_key(i, names.GLOBAL_COSTMAP), latched=True) for i in viewer.look.selected}
        for layer in layers & SENSED.keys():
            topic, kind = SENSED[layer]
            wanted |= {Topic(names.robot_key(i, topic), kind) for i in robots_in_sight(viewer, poses)}
    return wanted


def robots_in_sight(viewer: Viewer, poses: Mapping[int, Pose2]) -> list[int]:
    """The robots whose sensors a page is shown."""
    selected = {*viewer.look.selected, viewer.look.follow} & poses.keys()
    there = selected | {i for i, pose in poses.items() if viewer.sees(pose.x, pose.y)}
    if len(there) <= MAX_SCANNED:
        return sorted(there)
    return sorted(sorted(there, key=lambda i: (i not in selected, _distance(viewer, poses[i])))[:MAX_SCANNED])


def _distance(viewer: Viewer, pose: Pose2) -> float:
    view = viewer.look.viewport
    if not view:
        return 0.0
    return abs(pose.x - (view[0] + view[2]) / 2) + abs(pose.y - (view[1] + view[3]) / 2)
