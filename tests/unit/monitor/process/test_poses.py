"""The robots' poses for the monitor's table, asked of an aggregator on a bus in memory."""

import math
from collections.abc import Callable

import pytest

from support.limits import LIMIT
from zteam import names
from zteam.bus import MemoryHub
from zteam.clock import wait_until
from zteam.geometry import Pose2, quaternion_from_yaw
from zteam.monitor.observer import TeamObserver
from zteam.monitor.process import display as module
from zteam.monitor.process.display import Poses
from zteam.node.launcher import Restarted
from zteam.node.process_node import ProcessNode
from zteam.node.shutdown import Stop
from zteam.team.launch.progress import Recoveries
from zteam.transforms.client import Lookup, LookupReply, LookupRequest


def answer(lookup: Lookup) -> LookupReply:
    """Robot 2 is somewhere; the others are not known."""
    if lookup.source != "robot_2/base_footprint":
        return LookupReply(error="LookupException", text=f"{lookup.source} is not known")
    return LookupReply(1, (1.5, -2.0, 0.0), quaternion_from_yaw(0.5))


def wait_for(node: ProcessNode, condition: Callable[[], bool]) -> None:
    """Wait until it is true; nothing notifies, so look again from time to time."""
    with node.changed:
        for _ in range(int(LIMIT / 0.01)):
            if wait_until(node.changed, condition, 0.01):
                return
    raise AssertionError("it did not come true")


def test_poses_come_from_the_aggregator(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """All robots are asked for in one query; one that is not known has no pose; without an aggregator none has."""
    monkeypatch.setattr(module, "PERIOD", 0.01)
    stop = Stop()
    node = ProcessNode(names.MONITOR, hub.bus(), stop)
    asked: list[list[str]] = []

    def serve(request: LookupRequest) -> list[LookupReply]:
        asked.append([lookup.target + " " + lookup.source for lookup in request.lookups])
        return [*map(answer, request.lookups)]

    server = hub.bus().serve("tf/lookup", LookupRequest, serve)
    found = Poses(node, lambda: [1, 2])
    try:
        wait_for(node, lambda: bool(found.newest))
        assert found.newest.keys() == {2}
        assert math.isclose(found.newest[2].yaw, 0.5)
        assert found.newest[2][:2] == Pose2(1.5, -2.0, 0.0)[:2]
        assert asked[0] == ["map robot_1/base_footprint", "map robot_2/base_footprint"]
        server.close()
        wait_for(node, lambda: not found.newest)
    finally:
        stop.request("test over")
        node.close()


def test_restarts_come_from_the_launcher(hub: MemoryHub, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also for a monitor that comes later; without a launcher there are none."""
    monkeypatch.setattr(module, "PERIOD", 0.01)
    stop, launcher, counts = Stop(), hub.bus(), {"robot_1": 1}
    node = ProcessNode(names.MONITOR, hub.bus(), stop)
    Recoveries(TeamObserver(launcher), lambda: dict(counts))
    found = Poses(node, list)
    try:
        wait_for(node, lambda: found.restarts == {"robot_1": Restarted(1)})
        counts["planner"] = 3
        wait_for(node, lambda: found.restarts == {"robot_1": Restarted(1), "planner": Restarted(3)})
        launcher.close()
        wait_for(node, lambda: found.restarts == {})
    finally:
        stop.request("test over")
        node.close()
