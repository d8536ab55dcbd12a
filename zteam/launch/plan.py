"""A team as commands: which processes, with which arguments, stopped in which order."""

from collections.abc import Sequence
from pathlib import Path

import msgspec

from zteam import names
from zteam.launch.process import zteam_command
from zteam.simulation_options import simulation_arguments
from zteam.team_file import RobotEntry, Team, robot_arguments

ROUTER = "router"
LOCKSTEP_TIMEOUT = 10.0
"""Host seconds until lock-step leaves a living participant behind that does not answer."""


class Pace(msgspec.Struct, frozen=True):
    """How a simulated team's time goes."""

    speed: str | None = None
    """As on the command line: a number or `max`; None = the simulator's default."""
    lockstep: bool = False
    timeout: float = LOCKSTEP_TIMEOUT
    """Host seconds until lock-step leaves a silent participant behind."""
    expect: tuple[str, ...] = ()
    """Participants besides the team's own without which lock-step does not begin."""
    paused: bool = False


class Plan(msgspec.Struct):
    """Commands by process name, in the order of starting; the router is not among them."""

    commands: dict[str, list[str]]

    @property
    def robots(self) -> list[str]:
        """Names of the robots."""
        return [name for name in self.commands if names.robot_id_of(name) is not None]

    def stop_order(self) -> list[list[str]]:
        """Groups to stop one after the other: robots and user processes first, so that a zero velocity gets through."""
        ends = [[names.MONITOR, names.AGGREGATOR], [names.SIMULATOR], [ROUTER]]
        known = {*self.commands, ROUTER}
        # What this plan does not know by name may drive a robot too.
        first = [name for name in self.commands if not any(name in group for group in ends)]
        return [first, *([name for name in group if name in known] for group in ends)]


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
    chosen_seed = str(team.team.seed if seed is None else seed)
    commands = {}
    if world is not None:
        commands[names.SIMULATOR] = [
            *zteam_command("zteam-sim", str(world), "--seed", chosen_seed),
            *(() if run_for is None else ("--for", str(run_for))),
            *_additions(team.robots),
            *(() if team.team.world_robots else ("--only-added",)),
            *_gaps(team.robots),
            *simulation_arguments(team.simulation),
            *_pace(pace or Pace(), team.robots),
            *bus,
        ]
    commands[names.AGGREGATOR] = [*zteam_command("zteam-tf", *((str(team_file),) if team_file else ())), *bus]
    ids = [str(robot.id) for robot in team.robots]
    commands[names.MONITOR] = [*zteam_command("zteam-monitor", "--ids", *ids), *bus]
    for robot in team.robots:
        arguments = [*robot_arguments(robot), "--seed", chosen_seed]
        if team_file is not None and ":" in (robot.behavior or ""):
            arguments += ["--path", str(team_file.resolve().parent)]
        commands[names.robot_name(robot.id)] = [*zteam_command("zteam-robot", *arguments), *bus]
    return Plan(commands)


def _pace(pace: Pace, robots: Sequence[RobotEntry]) -> list[str]:
    arguments = [] if pace.speed is None else ["--speed", pace.speed]
    if pace.paused:
        arguments.append("--paused")
    if pace.lockstep:
        members = [names.AGGREGATOR, *(names.robot_name(robot.id) for robot in robots), *pace.expect]
        arguments += ["--lockstep", "--lockstep-timeout", str(pace.timeout), "--expect", *members]
    return arguments


def _additions(robots: Sequence[RobotEntry]) -> list[str]:
    arguments = []
    for robot in robots:
        if robot.pose is not None:
            x, y, yaw = robot.pose
            arguments += ["--add", f"{robot.id}:{robot.model or 'erratic'}:{x!r}:{y!r}:{yaw!r}"]
    return arguments


def _gaps(robots: Sequence[RobotEntry]) -> list[str]:
    return [part for robot in robots if robot.follow is not None for part in ("--gap", f"{robot.id}:{robot.follow}")]
