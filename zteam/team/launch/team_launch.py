"""What each kind of process is told of a team, by the kind's name (`zteam.node.kinds`)."""

from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec

from zteam import names
from zteam.config.fault import Fault
from zteam.node import kinds
from zteam.node.kinds import Kind
from zteam.node.process_options import (
    LOCKSTEP_TIMEOUT,
    AggregatorOptions,
    LockStepOptions,
    MapOptions,
    MonitorOptions,
    NavigatedRobot,
    NavigationOptions,
    ProcessOptions,
    RobotOptions,
    SimOptions,
    ViewOptions,
)
from zteam.simulator.faults import is_simulated
from zteam.team.file.entries import Team, behavior_of, navigation_of, static_transform


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
    """Everything that the processes of a team depend on."""

    team: Team
    world: Path | None
    """None: real robots, no simulator."""
    given_seed: int | None = None
    """None: that of the team file."""
    team_file: Path | None = None
    run_for: float | None = None
    """Simulated seconds after GO."""
    until: int | None = None
    """The run ends before this tick."""
    pace: Pace = Pace()
    view: ViewOptions | None = None
    """None: the team is started without one."""
    faults: tuple[Fault, ...] = ()
    """On purpose; of those, the simulator carries out in lock-step what it can."""

    @property
    def seed(self) -> int:
        """Of the whole run."""
        return self.team.team.seed if self.given_seed is None else self.given_seed

    @property
    def participants(self) -> tuple[str, ...]:
        """Names of the processes that the first tick of lock-step waits for."""
        own = [name for kind in kinds.KINDS if kind.in_lockstep for name in options_of(kind, self)]
        expected = (node.name for node in self.team.nodes if node.expect)
        return tuple(dict.fromkeys((*own, *expected, *self.pace.expect)))

    def is_simulated(self, fault: Fault) -> bool:
        """Whether the simulator carries out this fault: in lock-step, what happens to a robot."""
        return self.pace.lockstep and is_simulated(fault)

    @property
    def restarts(self) -> bool:
        """Whether processes that are neither robots nor nodes are started again when they have failed."""
        return self.team.team.restart == "on-failure"

    @property
    def has_end(self) -> bool:
        """Whether the run ends by itself."""
        return self.run_for is not None or self.until is not None

    @property
    def folder(self) -> Path:
        """What paths of the team file are relative to."""
        return self.team_file.parent if self.team_file else Path()


def _simulator(launch: TeamLaunch) -> dict[str, SimOptions]:
    """One simulator, unless the robots are real."""
    team, pace = launch.team, launch.pace
    if launch.world is None:
        return {}
    speed = pace.speed or ("max" if pace.lockstep else "1")
    options = SimOptions(
        world=launch.world,
        seed=launch.seed,
        has_map=team.team.map is None,
        world_robots=team.team.world_robots,
        added=tuple((robot.id, robot.model or "erratic", robot.pose) for robot in team.robots if robot.pose),
        follows={robot.id: robot.follow for robot in team.robots if robot.follow is not None},
        engine=team.simulation,
        run_for=launch.run_for,
        until=launch.until,
        speed=None if speed == "max" else float(speed),
        paused=pace.paused,
        lockstep=LockStepOptions(launch.participants, pace.timeout) if pace.lockstep else None,
        faults=tuple(filter(launch.is_simulated, launch.faults)),
    )
    return {names.SIMULATOR: options}


def aggregator_options(team: Team, folder: Path) -> AggregatorOptions:
    """What the aggregator publishes of a team file in this folder."""
    configured = tuple(static_transform(entry) for entry in team.static_transforms)
    return AggregatorOptions(configured, {r.id: folder / r.description for r in team.robots if r.description})


def _robots(launch: TeamLaunch) -> dict[str, RobotOptions]:
    """One process per robot. The module of a user's behaviour may lie beside the team file and what it includes."""
    own = [] if launch.team_file is None else [str(launch.team_file.resolve().parent)]
    folders = (*dict.fromkeys([*own, *launch.team.folders]), "")
    found = {}
    for robot in launch.team.robots:
        spec, params = behavior_of(robot)
        found[names.robot_name(robot.id)] = RobotOptions(
            robot.id, spec, params, seed=launch.seed, base=robot.base, safety=robot.safety, folders=folders
        )
    return found


def _navigation(launch: TeamLaunch) -> dict[str, NavigationOptions]:
    """One process for all robots that are navigated: they share the map."""
    found = {
        robot.id: NavigatedRobot(table, launch.folder, f"robot {robot.id}, navigation", robot.base)
        for robot in sorted(launch.team.robots, key=lambda robot: robot.id)
        if (table := navigation_of(robot)) is not None
    }
    return {names.navigation_name(min(found)): NavigationOptions(found, launch.seed)} if found else {}


OPTIONS: dict[str, Callable[[TeamLaunch], Mapping[str, ProcessOptions]]] = {
    names.SIMULATOR: _simulator,
    # In the place of the simulator's own map, where the team file names one.
    names.MAP_SERVER: lambda launch: (
        {names.MAP_SERVER: MapOptions(launch.folder / file)} if (file := launch.team.team.map) else {}
    ),
    names.AGGREGATOR: lambda launch: {names.AGGREGATOR: aggregator_options(launch.team, launch.folder)},
    names.MONITOR: lambda launch: {
        names.MONITOR: MonitorOptions(len(launch.team.robots), tuple(robot.id for robot in launch.team.robots))
    },
    kinds.NAVIGATION: _navigation,
    kinds.ROBOT: _robots,
    names.VIEW: lambda launch: {names.VIEW: launch.view} if launch.view else {},
}
"""Without the router, which the launcher starts first, because that chooses the port."""


def options_of(kind: Kind, launch: TeamLaunch) -> Mapping[str, ProcessOptions]:
    """The processes of this kind in a team, by name."""
    return OPTIONS[kind.name](launch) if kind.name in OPTIONS else {}
