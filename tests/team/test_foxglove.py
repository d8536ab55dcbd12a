"""A client of the subprotocol `foxglove.sdk.v1` beside a real team, as Foxglove and Lichtblick are."""

import json
import struct
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from websockets.sync.client import ClientConnection, connect

from support.limits import LIMIT
from zteam import names
from zteam.bus.transport import RawSample
from zteam.clock import monotonic
from zteam.messages import LaserScan, OccupancyGrid, TFMessage, decode
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team

SAID = "find the team at ws://127.0.0.1:"
MESSAGE, TIME = 1, 2
"""First bytes of the server's binary messages."""


class Heard(NamedTuple):
    """One message of a topic."""

    log_time: int
    """Nanoseconds."""
    content: bytes


class Client:
    """Keeps what the server sends."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self.channels: dict[str, dict[str, Any]] = {}
        self.heard: dict[str, list[Heard]] = defaultdict(list)
        self.times: list[int] = []
        self._topics: dict[int, str] = {}
        self._wanted: set[str] = set()

    def _take(self, message: str | bytes) -> None:
        if isinstance(message, str):
            said = json.loads(message)
            if said["op"] == "advertise":
                found = {channel["topic"]: channel for channel in said["channels"]}
                self.channels.update(found)
                for topic in self._wanted & found.keys():
                    self._look_at(topic)
            elif said["op"] == "unadvertise":
                gone = set(said["channelIds"])
                self.channels = {t: channel for t, channel in self.channels.items() if channel["id"] not in gone}
        elif message[0] == MESSAGE:
            subscription, time = struct.unpack_from("<IQ", message, 1)
            self.heard[self._topics[subscription]].append(Heard(time, message[13:]))
        elif message[0] == TIME:
            self.times.append(struct.unpack_from("<Q", message, 1)[0])

    def wait(self, ready: Callable[[], Any]) -> None:
        """Take messages until `ready()`."""
        end = monotonic() + LIMIT
        while not ready():
            left = end - monotonic()
            assert left > 0.0, f"not true within {LIMIT:g} s; channels: {sorted(self.channels)}"
            try:
                self._take(self._socket.recv(timeout=min(left, 0.5)))
            except TimeoutError:
                continue

    def subscribe(self, *topics: str) -> None:
        """Look at topics whenever they are there: on a crowded machine one may be gone for a moment."""
        self._wanted |= set(topics)
        for topic in self._wanted & self.channels.keys():
            self._look_at(topic)

    def _look_at(self, topic: str) -> None:
        number = len(self._topics) + 1
        self._topics[number] = topic
        wanted = {"id": number, "channelId": self.channels[topic]["id"]}
        self._socket.send(json.dumps({"op": "subscribe", "subscriptions": [wanted]}))


@contextmanager
def open_client(port: int) -> Iterator[Client]:
    """A client of the server at this port."""
    url = f"ws://127.0.0.1:{port}"
    with connect(url, subprotocols=["foxglove.sdk.v1"], compression=None, max_size=None, close_timeout=1.0) as socket:  # type: ignore[list-item]
        assert socket.subprotocol == "foxglove.sdk.v1"
        yield Client(socket)


def start_foxglove(team: TeamFixture) -> int:
    """Start a view with a server for Foxglove; the port of that."""
    arguments = ("--port", "0", "--no-browser", "--foxglove", "--foxglove-port", "0", "--name", names.VIEW)
    team.spawn("zteam-view", *arguments, name=names.VIEW)
    team.wait_for_line(names.VIEW, SAID)
    return int(next(line for line in team.lines(names.VIEW) if SAID in line).partition(SAID)[2])


def sessions(team: TeamFixture, key: str) -> int:
    """How many other sessions subscribe to a key by this name."""
    return sum(each.key == key and not each.publishes for each in team.bus.declarations())


@pytest.mark.real_time
def test_a_client_gets_the_bytes_of_the_bus(team: TeamFixture, tmp_path: Path) -> None:
    """A client gets scan and transforms, a late one the map too. The view subscribes only to what a client shows.
    The topics of a robot that ends are gone."""
    team.start("office", 2, behavior="go_to", lockstep=False)
    sent: dict[str, set[bytes]] = defaultdict(set)

    def take(sample: RawSample) -> None:
        sent[sample.key].add(sample.payload)

    for key in ("robot_3/base_scan", "tf", "map"):
        team.bus.subscribe_raw(key, take, latched=key == "map")
    port = start_foxglove(team)
    with open_client(port) as first:
        first.subscribe("/robot_3/base_scan", "/tf", "/map")
        first.wait(lambda: all(first.heard[topic] for topic in ("/robot_3/base_scan", "/tf", "/map")))
        channel = first.channels["/robot_3/base_scan"]
        assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
        assert channel["schemaName"] == "sensor_msgs/msg/LaserScan"
        # Of the robots 2 and 3, which have no process.
        team.wait_for(lambda: sessions(team, "robot_3/base_scan") == 1)
        assert sessions(team, "robot_2/base_scan") == 0
        scan, bundle = first.heard["/robot_3/base_scan"][-1], first.heard["/tf"][-1]
        team.wait_for(lambda: {scan.content} <= sent["robot_3/base_scan"] and {bundle.content} <= sent["tf"])
        assert decode(LaserScan, scan.content).header.frame_id == "robot_3/base_laser_link"
        assert decode(TFMessage, bundle.content).transforms
        # Simulated time, by which the viewer looks transforms up.
        first.wait(lambda: first.times and first.heard["/robot_3/base_scan"][-1].log_time in first.times)
        with open_client(port) as late:
            late.subscribe("/map")
            late.wait(lambda: late.heard["/map"])
            assert {late.heard["/map"][-1].content} == sent["map"]
            assert decode(OccupancyGrid, late.heard["/map"][-1].content).info.width > 0
        layout = tmp_path / "layout.json"
        team.command("view", "--foxglove-layout", str(layout))
        assert "/robot_3/base_scan" in next(iter(json.loads(layout.read_text())["configById"].values()))["topics"]
        team.kill("robot_1")
        first.wait(lambda: "/robot_1/status" not in first.channels)
        assert "/robot_0/status" in first.channels
    team.wait_for(lambda: sessions(team, "robot_3/base_scan") == 0)
    # No clock tells the time of a world that stands: with the host's time before it, time would go back.
    team.sim.pause()
    with open_client(port) as alone:
        alone.subscribe("/map")
        alone.wait(lambda: alone.heard["/map"] and alone.times)
        now = team.sim_status.now
        assert (alone.heard["/map"][-1].log_time, alone.times) == (now, [now])
