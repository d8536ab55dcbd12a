"""What each process of a team does in one process."""

from pathlib import Path

from zteam.in_process.parts import parts_of
from zteam.launch.kinds import KINDS
from zteam.launch.plan import launch_of, plan_of
from zteam.resources import find_team, find_world
from zteam.team_file import load_team


def test_every_process_of_a_plan_has_a_part() -> None:
    """A kind of process that is added to the table must be added to the team in one process as well."""
    path: Path = find_team("line")
    launch = launch_of(load_team(path), find_world("office"), team_file=path)
    assert [*parts_of(launch, lambda name, text: None)] == [*plan_of(launch, ()).commands]
    needed = [kind for kind in KINDS if kind.on_bus and not kind.beside]
    assert all(any(kind.includes(name) for name in plan_of(launch, ()).commands) for kind in needed)
