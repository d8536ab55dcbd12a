"""A team as commands: which processes, with which arguments, stopped in which order."""

from collections.abc import Sequence
from pathlib import Path

import msgspec

from zteam import names
from zteam.launch import kinds
from zteam.launch.arguments import Pace, TeamLaunch
from zteam.team_file import Team


class Plan(msgspec.Struct):
    """Commands by process name, in the order of starting, without the router."""

    commands: dict[str, list[str]]

    @property
    def robots(self) -> list[str]:
        """Names of the robots."""
        return [name for name in self.commands if names.robot_id_of(name) is not None]

    def stop_order(self) -> list[list[str]]:
        """Groups of process names; each group is stopped after the one before it has ended."""
        ranks = sorted({kind.stop_rank for kind in kinds.KINDS})
        groups: dict[int, list[str]] = {rank: [] for rank in ranks}
        for name in (*self.commands, kinds.ROUTER):
            kind = kinds.kind_of(name)
            # A user's own process may drive a robot, so it stops with the robots.
            groups[kind.stop_rank if kind else ranks[0]].append(name)
        return list(groups.values())


def plan_team(
    team: Team,
    world: Path | None,
    bus: Sequence[str],
    *,
    team_file: Path | None = None,
    seed: int | None = None,
    run_for: float | None = None,
    pace: Pace | None = None,
) -> Plan:
    """The processes of a team. `bus` holds the connection options that all get; `world` None = real robots."""
    launch = TeamLaunch(
        team=team,
        world=world,
        seed=team.team.seed if seed is None else seed,
        team_file=team_file,
        run_for=run_for,
        pace=pace or Pace(),
    )
    own = [name for kind in kinds.KINDS if kind.in_lockstep for name in kind.arguments(launch)]
    launch = msgspec.structs.replace(launch, participants=(*own, *launch.pace.expect))
    return Plan(
        {
            name: [*kind.command_line(*arguments), *bus]
            for kind in kinds.KINDS
            for name, arguments in kind.arguments(launch).items()
        }
    )
