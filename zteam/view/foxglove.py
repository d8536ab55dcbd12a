"""The team for Foxglove and Lichtblick: a server of the WebSocket subprotocol `foxglove.sdk.v1`, which only shows.

The bytes on the bus are ROS 2's. So nothing is decoded, and a topic that no client looks at is not subscribed to.
Viewers draw most topics only when a user or a layout says so: `write_layout` makes one.
"""

import colorsys
import importlib.util
import logging
import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import msgspec

from zteam import messages, names
from zteam.bus.graph import robots_of
from zteam.bus.transport import Closeable, Declaration, RawSample
from zteam.clock import Every, wall_ns
from zteam.errors import BusError, UsageError, ZteamError, log
from zteam.messages import Message, ns_from_time, type_of_encoding
from zteam.messages.message import definition_of
from zteam.messages.topics import is_latched, type_of_key
from zteam.node.process_node import ProcessNode
from zteam.simulator.client import find_status
from zteam.view.connections import open_front
from zteam.view.server import listen

if TYPE_CHECKING:
    from foxglove import Channel
    from foxglove.websocket import ChannelView, Client


KEYS_PERIOD = 1.0
"""Host seconds between two looks at which keys there are."""
PATIENCE = 3
"""Looks in which a key is missing until its channel goes: a frozen process tells nothing of its keys."""
MAX_CHANNELS = 20_000
STATUS_LIMIT = 1.0
"""Host seconds for the simulator to tell its time."""
TIME_STEP = 50_000_000
"""Nanoseconds between two tellings of the host's time."""


def require_sdk() -> None:
    """Raise UsageError where the package is missing that speaks the protocol."""
    if importlib.util.find_spec("foxglove") is None:
        raise UsageError("--foxglove needs the package foxglove-sdk: pip install 'zteam[foxglove]'")


def shown_keys(declarations: Iterable[Declaration]) -> dict[str, type[Message] | None]:
    """The keys that have a publisher, or are known and have a subscriber, such as that of a robot's goals.

    Each with its type; None: the first message tells it.
    """
    found: dict[str, type[Message] | None] = {}
    for declaration in declarations:
        key = declaration.key
        if names.is_wildcard(key) or key.startswith("@"):
            continue
        target = names.split_robot_key(key)
        if target is not None and target[1] in (names.TF, names.TF_STATIC):
            # Its frames have no prefix: viewers would hang those of all robots into one tree.
            continue
        kind = type_of_key(key)
        if declaration.publishes or kind is not None:
            found[key] = kind
    return found


class _Shown:
    """One key, with its channel as soon as its type is known."""

    def __init__(self, key: str, kind: type[Message] | None) -> None:
        self.kind = kind
        self.latched = type_of_key(key) is None or is_latched(key)
        self.channel: Channel | None = None
        self.clients: set[int] = set()
        self.handle: Closeable | None = None
        """Its subscription on the bus."""
        self.is_late = False
        """Whether a client has come that lacks the last message."""
        self.missed = 0
        """Looks in which the key was missing."""


class FoxgloveServer:
    """Runs on a thread of its own until `close`.

    Its clients' requests come on threads of the SDK, and messages on those of the bus. They only note what came,
    or hand messages on: the thread of this server makes all calls of the bus.
    """

    def __init__(self, node: ProcessNode, host: str, port: int) -> None:
        """Listen at `host`, at `port` or where that is taken at one of the next. Raises UsageError."""
        from foxglove import Context, start_server
        from foxglove.websocket import Capability

        self._node, self._bus = node, node.bus
        self._context = Context()
        self._shown: dict[str, _Shown] = {}
        self._woken = threading.Event()
        self._keys_due = Every(KEYS_PERIOD)
        self._clock: Closeable | None = None
        self._sim_time: int | None = None
        """Nanoseconds; None without a simulator."""
        self._told_time = 0
        listener, self.port = listen(host, port)
        # What it says of each connection is of no use to a user; nor are its errors of each that is none of a viewer.
        logging.getLogger("foxglove").setLevel(logging.WARNING)
        logging.getLogger("foxglove.websocket").setLevel(logging.CRITICAL)
        # Of what else a client may ask nothing is offered, so it has no other method of a listener.
        requests: Any = self
        # Only this host reaches it: the SDK lets any number of connections wait, and closes its port for good when no
        # descriptor is left.
        try:
            self._server = start_server(
                name="zteam", host="127.0.0.1", port=0, capabilities=[Capability.Time], server_listener=requests,
                context=self._context,
            )  # fmt: skip
        except RuntimeError as error:
            listener.close()
            raise UsageError(f"--foxglove: cannot listen at 127.0.0.1: {error}") from None
        self._close_front = open_front(listener, ("127.0.0.1", self._server.port), node.fail)
        self._thread = threading.Thread(target=self._run, name="foxglove", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._woken.set()
        self._close_front()
        self._server.stop()
        self._thread.join(1.0)

    # What clients ask for, by names that the SDK gives

    def on_subscribe(self, client: "Client", channel: "ChannelView") -> None:
        if (shown := self._shown.get(names.strip_slash(channel.topic))) is not None:
            shown.clients.add(client.id)
            shown.is_late = True
        self._woken.set()

    def on_unsubscribe(self, client: "Client", channel: "ChannelView") -> None:
        """A client looks no more at a topic, or has gone."""
        if (shown := self._shown.get(names.strip_slash(channel.topic))) is not None:
            shown.clients.discard(client.id)
        self._woken.set()

    # The team's side

    def _run(self) -> None:
        try:
            while not self._node.stopping:
                self._woken.clear()
                if self._keys_due.due():
                    self._match_keys(shown_keys(self._bus.declarations()))
                self._match_subscriptions()
                self._woken.wait(self._keys_due.left())
        except BaseException as error:
            self._node.fail(error)

    def _match_keys(self, there: dict[str, type[Message] | None]) -> None:
        for key in [*self._shown]:
            shown = self._shown[key]
            shown.missed = 0 if key in there else shown.missed + 1
            if shown.missed >= PATIENCE:
                self._drop(key)
        for key in sorted(there.keys() - self._shown.keys())[: MAX_CHANNELS - len(self._shown)]:
            self._shown[key] = _Shown(key, there[key])

    def _drop(self, key: str) -> None:
        shown = self._shown.pop(key)
        if shown.handle is not None:
            shown.handle.close()
        if shown.channel is not None:
            shown.channel.close()

    def _open_channel(self, key: str, shown: _Shown) -> None:
        from foxglove import Channel, Schema

        # `Message` itself: nothing that can be shown.
        if shown.channel is not None or shown.kind is None or shown.kind is Message:
            return
        schema = Schema(name=shown.kind.ros_type, encoding="ros2msg", data=definition_of(shown.kind).encode())
        shown.channel = Channel(f"/{key}", schema=schema, message_encoding="cdr", context=self._context)

    def _match_subscriptions(self) -> None:
        watched = any(shown.clients for shown in self._shown.values())
        if watched and self._clock is None:
            # Before all topics: viewers drop what has come when time goes back, and what is latched comes once.
            sim = find_status(self._bus, STATUS_LIMIT)
            if sim is not None:
                self._sim_time = sim.now
                self._server.broadcast_time(sim.now)
            self._clock = self._bus.subscribe(names.CLOCK, messages.Clock, self._on_clock)
        for key, shown in self._shown.items():
            self._open_channel(key, shown)
            # A key of unknown type is subscribed to until its first message.
            wanted = bool(shown.clients) or shown.kind is None
            before, renews = shown.handle, shown.is_late
            if renews:
                # Not in any case: a client may come just now.
                shown.is_late = False
            if (renews and shown.latched) or wanted != (before is not None):
                # A new subscription gets what is latched once more; the other clients draw the same.
                shown.handle = self._subscribe(key, shown) if wanted else None
                if before is not None:
                    before.close()
        if not watched and self._clock is not None:
            self._clock.close()
            self._clock = self._sim_time = None

    def _subscribe(self, key: str, shown: _Shown) -> Closeable | None:
        def on_sample(sample: RawSample) -> None:
            kind = type_of_encoding(sample.encoding)
            if shown.kind is None:
                shown.kind, shown.is_late = kind or Message, True
                self._woken.set()
            elif kind in (shown.kind, None) and shown.channel is not None:
                self._show(shown.channel, sample.payload)

        try:
            # With a type without time and source of each message, which cost most of a view's time.
            only = None if shown.latched else shown.kind
            return self._bus.subscribe_raw(key, on_sample, latched=shown.latched, only=only)
        except BusError as error:
            log.debug("%s", error)
            return None

    def _on_clock(self, _key: str, message: messages.Clock) -> None:
        self._sim_time = ns_from_time(message.clock)
        self._server.broadcast_time(self._sim_time)

    def _show(self, channel: "Channel", data: bytes) -> None:
        now = wall_ns() if self._sim_time is None else self._sim_time
        if self._sim_time is None and now - self._told_time > TIME_STEP:
            self._told_time = now
            self._server.broadcast_time(now)
        channel.log(data, log_time=now)


def serve_foxglove(node: ProcessNode, host: str, port: int, known_as: str, show: Callable[[str], None]) -> None:
    """Show the team from now on until the node stops; `show` prints where, with the name `known_as` of this machine.

    Raises UsageError.
    """
    server = FoxgloveServer(node, host, port)
    node.on_stop(server.close)
    if port and server.port != port:
        log.warning("port %d is taken: Foxglove finds the team at port %d", port, server.port)
    show(f"Foxglove and Lichtblick find the team at ws://{known_as}:{server.port}")


_GOLDEN_TURN = 0.618034
"""Of the circle of hues: neighbours in number are far apart in colour, however many there are."""
PANEL = "3D!zteam"
LOOKS, PAUSE = 20, 0.2
"""How often the team is asked for its keys until there is a robot, and the host seconds between."""


def color_of(robot_id: int) -> str:
    """A colour for a robot, such as `#1f77b4`."""
    rgb = colorsys.hls_to_rgb(robot_id * _GOLDEN_TURN % 1.0, 0.5, 0.85)
    return "#" + "".join(f"{round(255 * part):02x}" for part in rgb)


def layout_of(keys: Mapping[str, type[Message] | None]) -> dict[str, Any]:
    """The layout: one panel from above that moves with the first robot, and shows map, frames, scans, paths, goals,
    outlines and markers. Costmaps and particles are there and hidden."""
    robots = sorted(robots_of(keys))
    topics = {f"/{key}": shown for key in sorted(keys) if (shown := _settings(key, keys[key])) is not None}
    panel = {
        "cameraState": {
            "perspective": False, "distance": 25, "phi": 0, "thetaOffset": 0, "fovy": 45, "near": 0.5, "far": 5000,
            "target": [0, 0, 0], "targetOffset": [0, 0, 0], "targetOrientation": [0, 0, 0, 1],
        },
        "followMode": "follow-position",
        "followTf": names.robot_frame(robots[0], names.BASE_FOOTPRINT) if robots else names.MAP_FRAME,
        "scene": {"transforms": {"axisScale": 0.5, "labelSize": 0.1, "showLabel": True}},
        "transforms": {f"frame:{names.robot_frame(i, names.ODOM)}": {"visible": False} for i in robots},
        "topics": topics,
        "layers": {},
    }  # fmt: skip
    return {
        "configById": {PANEL: panel},
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": PANEL,
    }


def _settings(key: str, kind: type[Message] | None) -> dict[str, Any] | None:
    """How a topic is drawn; None if it is not."""
    target = names.split_robot_key(key)
    color = color_of(target[0]) if target is not None else "#888888"
    settings: dict[type[Message] | None, dict[str, Any]] = {
        messages.LaserScan: {"visible": True, "colorMode": "flat", "flatColor": color, "pointSize": 3},
        messages.Path: {"visible": True, "type": "line", "lineWidth": 0.05, "gradient": [color, color]},
        messages.PoseStamped: {"visible": True, "type": "arrow", "color": color, "arrowScale": [0.6, 0.08, 0.08]},
        messages.PolygonStamped: {"visible": True, "color": color},
        messages.Range: {"visible": True, "color": color},
        messages.OccupancyGrid: {"visible": key == names.MAP, "colorMode": "map" if key == names.MAP else "costmap"},
        messages.PoseArray: {"visible": False, "color": color},
        messages.Marker: {"visible": True},
        messages.MarkerArray: {"visible": True},
    }
    return settings.get(kind)


def write_layout(node: ProcessNode, path: FilePath, show: Callable[[str], None]) -> None:
    """Write the layout of the topics that are there now. Raises ZteamError without a robot, UsageError for the file."""
    for _ in range(LOOKS):
        keys = shown_keys(node.bus.declarations())
        # A session that has just opened may not know all others yet.
        if robots_of(keys) or node.wait(lambda: node.stopping, PAUSE):
            break
    if not robots_of(keys):
        raise ZteamError("--foxglove-layout: no robot is there: start the team first (zteam up)")
    try:
        path.write_bytes(msgspec.json.format(msgspec.json.encode(layout_of(keys)), indent=1) + b"\n")
    except OSError as error:
        raise UsageError(f"--foxglove-layout {path}: {error.strerror or error}") from None
    show(f"{path}: a layout of {len(keys)} topics; open it in Foxglove or Lichtblick (Layouts, import from file)")
