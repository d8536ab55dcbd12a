"""A run in one process: what each node does, and how tools find the team."""

from pathlib import Path

import numpy as np
import pytest

import zteam
from support.transports import RouterProcess
from zteam import names
from zteam.bus.options import port_accepts
from zteam.bus.presence import ProcessInfo
from zteam.config.resources import find_world
from zteam.errors import BusError
from zteam.navigation.planning.grid import make_map
from zteam.navigation.planning.maps import write_map
from zteam.node.kinds import KINDS
from zteam.team.file.entries import RobotEntry, Team
from zteam.team.file.reading import load_team
from zteam.team.launch.plan import TeamLaunch, plan_team
from zteam.team.run.team_run import TeamRun
from zteam.team.run.threads import Threads, parts_of


def test_every_process_of_a_plan_has_a_part(tmp_path: Path) -> None:
    """A kind of process that is added to the table must be added to the team in one process as well."""
    write_map(make_map(np.zeros((2, 2), np.int8), 0.05), tmp_path / "map.yaml")
    path = tmp_path / "team.toml"
    path.write_text('[team]\nworld = "office"\nmap = "map.yaml"\n[[robots]]\nid = 0\nnavigation = true\n')
    launch = TeamLaunch(load_team(path), find_world("office"), team_file=path)
    assert [*parts_of(launch, lambda name, text: None, {})] == [*plan_team(launch).jobs]
    needed = [kind for kind in KINDS if kind.on_bus and kind.hint]
    assert all(any(kind.includes(name) for name in plan_team(launch).jobs) for kind in needed)


def test_the_router_ends_with_it() -> None:
    """Within, tools reach the team's own router and find the launcher; after it, nothing listens there."""
    launch = TeamLaunch(Team([RobotEntry(id=0)]), find_world("arena"))
    members = Threads(options=zteam.BusOptions())
    with TeamRun(members, launch) as run:
        run.open()
        tool = zteam.connect(zteam.BusOptions(connect=members.endpoint))
        info = members.beside_simulator(lambda: tool.ask(names.info_key(names.LAUNCHER), ProcessInfo))
        assert members.bus is not None
        assert info.instance == members.bus.instance
    tool.close()
    assert not port_accepts(members.endpoint)


@pytest.mark.gate
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
