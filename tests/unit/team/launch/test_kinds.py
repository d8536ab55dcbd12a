"""The table of the kinds of process: one row is all that the launcher and the tools need of a kind."""

from pathlib import Path

import pytest

from zteam import names
from zteam.cli import main
from zteam.node import kinds
from zteam.node.kinds import KINDS, Kind, kind_of
from zteam.node.process_options import MonitorOptions, SimOptions, from_line
from zteam.team.file.entries import NodeEntry, RobotEntry, Team
from zteam.team.file.rules import check_nodes
from zteam.team.launch import team_launch
from zteam.team.launch.plan import plan_team, stop_order
from zteam.team.launch.team_launch import Pace, TeamLaunch

TEAM = Team(robots=[RobotEntry(id=0, behavior="forward"), RobotEntry(id=12, behavior="forward")])
WORLD = Path("/w/arena.world")
PLANNER = Kind(
    title="planner",
    name="planner",
    command="zteam-monitor",
    stop_rank=2,
    hint="start the planner of {robots} robots",
    in_lockstep=True,
)


@pytest.fixture
def planner(monkeypatch: pytest.MonkeyPatch) -> None:
    """A further row in both tables."""
    monkeypatch.setattr(kinds, "KINDS", (*KINDS, PLANNER))
    told = {**team_launch.OPTIONS, "planner": lambda launch: {"planner": MonitorOptions(len(launch.team.robots))}}
    monkeypatch.setattr(team_launch, "OPTIONS", told)


def test_a_row_is_a_process_of_every_team(planner: None) -> None:
    """The plan starts the new kind after the others, with the row's options."""
    plan = plan_team(TeamLaunch(TEAM, WORLD))
    assert list(plan.own)[-1] == "planner"
    assert from_line(plan.own["planner"].words) == ("planner", MonitorOptions(2))


def test_a_row_has_its_place_in_the_stop_order(planner: None) -> None:
    """The new kind stops with the kinds of its rank."""
    order = stop_order([*plan_team(TeamLaunch(TEAM, WORLD)).jobs, "router"])
    assert order == [["robot_0", "robot_12"], ["tf", "monitor"], ["sim", "planner"], ["router"]]


def test_a_row_takes_part_in_lock_step(planner: None) -> None:
    """The simulator waits for the new kind, for the kinds before it, and for what the user expects."""
    plan = plan_team(TeamLaunch(TEAM, WORLD, pace=Pace(lockstep=True, expect=("mine",))))
    _, options = from_line(plan.own[names.SIMULATOR].words)
    assert isinstance(options, SimOptions) and options.lockstep is not None
    assert options.lockstep.expected == ("tf", "robot_0", "robot_12", "planner", "mine")


@pytest.mark.parametrize(
    ("name", "title"),
    [
        ("router", "router"),
        ("sim", "simulator"),
        ("tf", "transforms"),
        ("monitor", "monitor"),
        ("robot_0", "robots"),
        ("robot_9999", "robots"),
        ("robot_N", None),
        ("robot_01", None),
        ("zteam-robot #3", None),
        ("up", None),
    ],
)
def test_a_kind_is_found_by_its_processes_names(name: str, title: str | None) -> None:
    """Single processes by their name, robots by the pattern of theirs, a user's own process not at all."""
    kind = kind_of(name)
    assert (kind and kind.title) == title


def test_every_command_of_the_table_is_a_command() -> None:
    """Each row's command is installed under that name."""
    from importlib.metadata import entry_points

    installed = {entry.name for entry in entry_points(group="console_scripts") if entry.value.startswith(main.__name__)}
    assert {kind.command for kind in KINDS} == installed - {"zteam"}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.title)
def test_a_node_cannot_take_the_place_of_a_process(kind: Kind) -> None:
    """A node with the name of any kind of process is refused: it would replace that process."""
    name = kind.name.replace("_N", "_0")
    (problem,) = check_nodes({0: NodeEntry(name=name, command=("true",))}, {0})
    assert problem.text == f"{name} is a process of the team already; give the node another name"


def test_a_run_needs_its_router_and_its_simulator() -> None:
    """These alone end a run with a time limit after GO."""
    assert [kind.name for kind in KINDS if kind.required_to_finish] == ["router", "sim"]


def test_an_empty_plan_still_stops_its_router() -> None:
    """Groups without processes are empty, and the router is in the last one."""
    assert stop_order(["router"]) == [[], [], [], ["router"]]
