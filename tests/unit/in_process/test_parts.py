"""What each process of a team does in one process."""

from pathlib import Path

import numpy as np

from zteam.in_process.parts import parts_of
from zteam.launch.kinds import KINDS
from zteam.launch.plan import launch_of, plan_team
from zteam.planning.grid import make_map
from zteam.planning.map_files import write_map
from zteam.resources import find_world
from zteam.team_file import load_team


def test_every_process_of_a_plan_has_a_part(tmp_path: Path) -> None:
    """A kind of process that is added to the table must be added to the team in one process as well."""
    write_map(make_map(np.zeros((2, 2), np.int8), 0.05), tmp_path / "map.yaml")
    path = tmp_path / "team.toml"
    path.write_text('[team]\nworld = "office"\nmap = "map.yaml"\n[[robots]]\nid = 0\nnavigation = true\n')
    launch = launch_of(load_team(path), find_world("office"), team_file=path)
    assert [*parts_of(launch, lambda name, text: None)] == [*plan_team(launch).own]
    needed = [kind for kind in KINDS if kind.on_bus and kind.hint]
    assert all(any(kind.includes(name) for name in plan_team(launch).own) for kind in needed)
