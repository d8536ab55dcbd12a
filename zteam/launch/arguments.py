"""The arguments of each process of a team: one function per kind of process. The table in `kinds` names them."""

from collections.abc import Sequence
from pathlib import Path

import msgspec

from zteam import names
from zteam.simulation_options import simulation_arguments
from zteam.team_file import RobotEntry, Team, navigation_of, robot_arguments

LOCKSTEP_TIMEOUT = 10.0
"""Host seconds until lock-step leaves a living participant behind that does not answer."""

Arguments = dict[str, list[str]]
"""Arguments by process name, without the connection options that all processes get."""


class Pace(msgspec.Struct, frozen=True):
    """How the time of a simulated team passes."""

    speed: str | None = None
    """As on the command line: a number or `max`; None = the simulator's default."""
    lockstep: bool = False
    timeout: float = LOCKSTEP_TIMEOUT
    """Host seconds until lock-step leaves a silent participant behind."""
    expect: tuple[str, ...] = ()
    """Participants besides the team's own that the first tick of lock-step waits for."""
    paused: bool = False


class TeamLaunch(msgspec.Struct, frozen=True):
    """Everything that the arguments of a team's processes depend on."""

    team: Team
    world: Path | None
    """None: real robots, no simulator."""
    seed: int
    team_file: Path | None = None
    run_for: float | None = None
    """Simulated seconds after GO."""
    until: int | None = None
    """The run ends before this tick."""
    pace: Pace = Pace()
    view: tuple[str, ...] | None = None
    """Arguments of the view; None: the team is started without one."""
    participants: tuple[str, ...] = ()
    """Names of the processes that the first tick of lock-step waits for."""

    @property
    def has_end(self) -> bool:
        """Whether the run ends by itself."""
        return self.run_for is not None or self.until is not None


def no_arguments(_launch: TeamLaunch) -> Arguments:
    """No process: the plan does not start this kind."""
    return {}


def simulator_arguments(launch: TeamLaunch) -> Arguments:
    """One simulator, unless the robots are real."""
    team, world = launch.team, launch.world
    if world is None:
        return {}
    arguments = [
        str(world),
        *("--seed", str(launch.seed)),
        *(() if launch.run_for is None else ("--for", str(launch.run_for))),
        *(() if launch.until is None else ("--until", str(launch.until))),
        *_additions(team.robots),
        *(() if team.team.world_robots else ("--only-added",)),
        *(() if team.team.map is None else ("--no-map",)),
        *_gaps(team.robots),
        *simulation_arguments(team.simulation),
        *_pace(launch),
    ]
    return {names.SIMULATOR: arguments}


def aggregator_arguments(launch: TeamLaunch) -> Arguments:
    """One aggregator, which publishes the static transforms of the team file."""
    return {names.AGGREGATOR: [str(launch.team_file), *launch.team.arguments] if launch.team_file else []}


def map_arguments(launch: TeamLaunch) -> Arguments:
    """One map server, if the team file names a map."""
    found = team_map(launch)
    return {} if found is None else {names.MAP_SERVER: [str(found)]}


def team_map(launch: TeamLaunch) -> Path | None:
    """The map that the team gets in the place of the simulator's own; None for that one."""
    if launch.team.team.map is None:
        return None
    return (launch.team_file.parent if launch.team_file else Path()) / launch.team.team.map


def monitor_arguments(launch: TeamLaunch) -> Arguments:
    """One monitor, which gives GO when all these robots are ready."""
    return {names.MONITOR: ["--ids", *(str(robot.id) for robot in launch.team.robots)]}


def robots_arguments(launch: TeamLaunch) -> Arguments:
    """One process per robot."""
    found = {}
    for robot in launch.team.robots:
        arguments = [*robot_arguments(robot), "--seed", str(launch.seed)]
        if ":" in (robot.behavior or ""):
            arguments += [part for folder in module_folders(launch) for part in ("--path", str(folder))]
        found[names.robot_name(robot.id)] = arguments
    return found


def view_arguments(launch: TeamLaunch) -> Arguments:
    """One view, if it is asked for."""
    return {} if launch.view is None else {names.VIEW: ["--name", names.VIEW, *launch.view]}


def navigation_arguments(launch: TeamLaunch) -> Arguments:
    """One process for all robots that are navigated: they share the map. It reads their parameters from the file."""
    ids = navigated_robots(launch)
    if not ids:
        return {}
    file = [str(launch.team_file), *launch.team.arguments] if launch.team_file else []
    return {names.navigation_name(ids[0]): [*file, "--ids", *map(str, ids), "--seed", str(launch.seed)]}


def navigated_robots(launch: TeamLaunch) -> list[int]:
    """Ids of the robots that are navigated, ascending."""
    return sorted(robot.id for robot in launch.team.robots if navigation_of(robot) is not None)


def module_folders(launch: TeamLaunch) -> list[Path]:
    """Where the module of a user's behaviour may lie: beside the team file, and beside what it includes."""
    own = [] if launch.team_file is None else [launch.team_file.resolve().parent]
    return list(dict.fromkeys([*own, *map(Path, launch.team.folders)]))


def _pace(launch: TeamLaunch) -> list[str]:
    pace = launch.pace
    arguments = [] if pace.speed is None else ["--speed", pace.speed]
    if pace.paused:
        arguments.append("--paused")
    if pace.lockstep:
        arguments += ["--lockstep", "--lockstep-timeout", str(pace.timeout), "--expect", *launch.participants]
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
