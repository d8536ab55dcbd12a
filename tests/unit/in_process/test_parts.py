"""What each process of a team does in one process."""

from pathlib import Path

from msgspec import structs

from zteam.in_process.parts import parts_of
from zteam.launch.kinds import KINDS
from zteam.launch.plan import launch_of, plan_of
from zteam.resources import find_team, find_world
from zteam.team_file import load_team


def test_every_process_of_a_plan_has_a_part() -> None:
    """A kind of process that is added to the table must be added to the team in one process as well."""
    path: Path = find_team("line")
    team = load_team(path)
    # A line needs no navigation.
    team = structs.replace(team, robots=[structs.replace(robot, navigation=True) for robot in team.robots])
    launch = launch_of(team, find_world("office"), team_file=path)
    assert [*parts_of(launch, lambda name, text: None)] == [*plan_of(launch, ()).commands]
    assert all(any(kind.includes(name) for name in plan_of(launch, ()).commands) for kind in KINDS if kind.on_bus)
