"""Where tools find a team in one process: its router, session and name."""

import pytest

import zteam
from support.transports import RouterProcess
from zteam import names
from zteam.bus.presence import ProcessInfo
from zteam.bus.probe import port_accepts
from zteam.errors import BusError
from zteam.in_process.hub import TeamHub
from zteam.in_process.outside import Outside
from zteam.launch.kinds import Pace
from zteam.runtime.shutdown import Stop


def test_the_router_ends_with_it() -> None:
    """Within, tools reach the team's own router and find the launcher; after it, nothing listens there."""
    with Outside(zteam.BusOptions(), Pace()) as outside:
        hub = TeamHub(outside.bus)
        launcher = hub.bus(names.LAUNCHER)
        outside.hold_namespace(launcher, (), Stop())
        tool = zteam.connect(zteam.BusOptions(connect=outside.endpoint))
        assert tool.ask(names.info_key(names.LAUNCHER), ProcessInfo).instance == launcher.instance
        outside.release()
        assert tool.query(names.info_key(names.LAUNCHER), ProcessInfo) == []
        tool.close()
        hub.close()
    assert not port_accepts(outside.endpoint)


def test_a_program_opens_its_team() -> None:
    """`run_team` with bus options: another session finds the robots, a second team is refused, the run is the same."""
    router = RouterProcess()
    options = zteam.BusOptions(connect=router.endpoint, namespace="inbus")
    found: list[str] = []

    def main(node: zteam.Node) -> None:
        tool = zteam.connect(options)
        found.extend(info.name for _, info in tool.query(names.info_key("*"), ProcessInfo))
        with pytest.raises(BusError, match="a team is already running here"):
            zteam.run_team("arena", seconds=1.0, bus=options)
        tool.close()
        node.run(lambda now: None)

    try:
        report = zteam.run_team("arena", seconds=5.0, nodes={"crowd": main}, bus=options)
    finally:
        router.kill()
    assert {"up", "sim", "crowd"} <= set(found)
    assert report.trajectory_sha256 == zteam.run_team("arena", seconds=5.0).trajectory_sha256
