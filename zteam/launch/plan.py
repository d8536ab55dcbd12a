"""A team as commands: which processes, with which arguments, stopped in which order."""

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec

from zteam import names
from zteam.launch import kinds
from zteam.launch.arguments import Pace, TeamLaunch
from zteam.launch.process import zteam_command
from zteam.launch.supervisor import Job
from zteam.team_file import NodeEntry, Team


class Plan(msgspec.Struct):
    """Commands by process name, in the order of starting, without the router."""

    commands: dict[str, list[str]]
    nodes: dict[str, Job] = {}
    """The user's own processes, which start when the router listens."""
    restarts: frozenset[str] = frozenset()
    """Names of the robots that are started again when they have failed."""
    optional: frozenset[str] = frozenset()
    """Names of the nodes without which the run begins."""
    beside: frozenset[str] = frozenset()
    """Names of the nodes that come with zteam and that the team does not need: they may end at any time."""

    @property
    def robots(self) -> list[str]:
        """Names of the robots."""
        return [name for name in self.commands if names.robot_id_of(name) is not None]

    def stop_order(self) -> list[list[str]]:
        """Groups of process names; each group is stopped after the one before it has ended."""
        return stop_order((*self.commands, *self.nodes, kinds.ROUTER))


def stop_order(processes: Iterable[str]) -> list[list[str]]:
    """These processes in groups; each group is stopped after the one before it has ended."""
    ranks = sorted({kind.stop_rank for kind in kinds.KINDS})
    groups: dict[int, list[str]] = {rank: [] for rank in ranks}
    for name in processes:
        kind = kinds.kind_of(name)
        # A user's own process may drive a robot, so it stops with the robots.
        groups[kind.stop_rank if kind else ranks[0]].append(name)
    return list(groups.values())


def plan_team(launch: TeamLaunch, bus: Sequence[str]) -> Plan:
    """The processes of a team. `bus` holds the connection options that all get."""
    team = launch.team
    commands = {
        name: [*kind.command_line(*arguments), *bus]
        for kind in kinds.KINDS
        if not kind.beside
        for name, arguments in kind.arguments(launch).items()
    }
    beside = {
        name: Job(kind.command_line(*arguments), may_end=True)
        for kind in kinds.KINDS
        if kind.beside
        for name, arguments in kind.arguments(launch).items()
    }
    nodes = {
        node.name: Job(node_command(node), folder=Path(node.folder), restarts=team.restarts(node), may_end=True)
        for node in team.nodes
    }
    robots = (names.robot_name(robot.id) for robot in team.robots if team.restarts(robot))
    awaited = launch.participants if launch.pace.lockstep else ()
    return Plan(
        commands,
        {**beside, **nodes},
        frozenset(robots),
        frozenset({**beside, **nodes}).difference(awaited),
        frozenset(beside),
    )


def node_command(node: NodeEntry) -> list[str]:
    """The command of a user's node. `python` is this interpreter, wherever the user's own is, and zteam this zteam."""
    program, *rest = node.command
    if is_own(program):
        return zteam_command(program, *rest)
    return [sys.executable if is_python(program) else program, *rest]


def is_own(program: str) -> bool:
    """Whether the word is a command of zteam."""
    return program == "zteam" or program in {kind.command for kind in kinds.KINDS}


def is_python(program: str) -> bool:
    """Whether the word stands for this interpreter."""
    return program in ("python", "python3")


def launch_of(
    team: Team,
    world: Path | None,
    *,
    team_file: Path | None = None,
    seed: int | None = None,
    run_for: float | None = None,
    until: int | None = None,
    pace: Pace | None = None,
    view: tuple[str, ...] | None = None,
) -> TeamLaunch:
    """What the processes of a team depend on; `seed` None = the team's own."""
    launch = TeamLaunch(
        team=team,
        world=world,
        seed=team.team.seed if seed is None else seed,
        team_file=team_file,
        run_for=run_for,
        until=until,
        pace=pace or Pace(),
        view=view,
    )
    own = [name for kind in kinds.KINDS if kind.in_lockstep for name in kind.arguments(launch)]
    expected = dict.fromkeys((*(node.name for node in team.nodes if node.expect), *launch.pace.expect))
    return msgspec.structs.replace(launch, participants=(*own, *expected))
