"""The kinds of process that make a team: one table, one row per kind, with what each is told of a team.

The plan, the launcher, the `team` fixture and `zteam doctor` read this table. A new kind of process needs its folder
under `nodes/`, its options and its body (`process_options`, `nodes.bodies`), its command under `cli/`, and its row.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

import msgspec

from zteam import names
from zteam.launch.process import zteam_command
from zteam.process_options import (
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
from zteam.team_file.entries import Team, behavior_of, navigation_of, static_transform


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

    @property
    def seed(self) -> int:
        """Of the whole run."""
        return self.team.team.seed if self.given_seed is None else self.given_seed

    @property
    def participants(self) -> tuple[str, ...]:
        """Names of the processes that the first tick of lock-step waits for."""
        own = [name for kind in KINDS if kind.in_lockstep for name in kind.options(self)]
        expected = (node.name for node in self.team.nodes if node.expect)
        return tuple(dict.fromkeys((*own, *expected, *self.pace.expect)))

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
    )
    return {names.SIMULATOR: options}


def aggregator_options(team: Team, folder: Path) -> AggregatorOptions:
    """What the aggregator publishes of a team file in this folder."""
    configured = tuple(static_transform(entry) for entry in team.static_transforms)
    return AggregatorOptions(configured, {r.id: folder / r.description for r in team.robots if r.description})


def _monitor(launch: TeamLaunch) -> dict[str, MonitorOptions]:
    """One monitor, which gives GO when all these robots are ready."""
    ids = tuple(robot.id for robot in launch.team.robots)
    return {names.MONITOR: MonitorOptions(len(ids), ids)}


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


ROUTER = "router"


class Kind(msgspec.Struct, frozen=True):
    """One row."""

    title: str
    """What `zteam doctor` calls it."""
    name: str
    """Name of the process; for one process per robot, the pattern that a user reads."""
    command: str
    """The command that runs it, such as `zteam-sim`."""
    options: Callable[[TeamLaunch], Mapping[str, ProcessOptions]]
    """The processes of this kind in a team, by name."""
    stop_rank: int
    """A team stops rank by rank, the lowest first."""
    hint: str = ""
    """What `zteam doctor` tells the user to do when no such process is alive; `{robots}` is the number of robots.
    Empty for a kind that a team can work without."""
    in_lockstep: bool = False
    """Whether every tick of lock-step waits for it."""
    carries_run: bool = False
    """Whether a run with a time limit cannot be finished without it."""
    on_bus: bool = True
    """Whether it holds its name on the bus."""
    beside: bool = False
    """Whether a team runs on as before without it: it may come and go at any time."""
    is_one: Callable[[str], bool] | None = None
    """Where several of its processes may run: whether a name is that of one."""
    robot_id_of: Callable[[str], int | None] | None = None
    """For one process per robot: the robot's id in a process name, None where the name is of another kind."""

    def includes(self, name: str) -> bool:
        """Whether a process of this name is of this kind."""
        if self.is_one is not None:
            return self.is_one(name)
        return name == self.name if self.robot_id_of is None else self.robot_id_of(name) is not None

    def command_line(self, *arguments: str) -> list[str]:
        """The command line that starts such a process."""
        return zteam_command(self.command, *arguments)


ROUTER_KIND = Kind(
    title="router",
    name=ROUTER,
    command="zteam-router",
    # `launch.router` starts it before the plan's processes, because it chooses the port.
    options=lambda _launch: {},
    stop_rank=3,
    hint="start anything of zteam (it brings a router), or 'zteam-router'",
    carries_run=True,
    on_bus=False,
)

KINDS: tuple[Kind, ...] = (
    ROUTER_KIND,
    # The simulator takes longest to start, so it is started first. Robots stop before it: their last command, a zero
    # velocity, must reach the wheels.
    Kind(
        title="simulator",
        name=names.SIMULATOR,
        command="zteam-sim",
        options=_simulator,
        stop_rank=2,
        hint="zteam-sim WORLD (or real robots that publish the same keys)",
        carries_run=True,
    ),
    Kind(
        title="map",
        name=names.MAP_SERVER,
        command="zteam-map",
        # In the place of the simulator's own map, where the team file names one.
        options=lambda launch: (
            {names.MAP_SERVER: MapOptions(launch.folder / file)} if (file := launch.team.team.map) else {}
        ),
        stop_rank=1,
        # Without a hint, because few teams need one: `zteam doctor` names it where the map is missing.
    ),
    Kind(
        title="transforms",
        name=names.AGGREGATOR,
        command="zteam-tf",
        options=lambda launch: {names.AGGREGATOR: aggregator_options(launch.team, launch.folder)},
        stop_rank=1,
        hint="zteam-tf",
        in_lockstep=True,
    ),
    Kind(
        title="monitor",
        name=names.MONITOR,
        command="zteam-monitor",
        options=_monitor,
        stop_rank=1,
        hint="zteam-monitor --team-size {robots}",
    ),
    Kind(
        title="navigation",
        name="nav_N",
        command="zteam-nav",
        options=_navigation,
        stop_rank=0,
        in_lockstep=True,
        robot_id_of=names.navigated_robot_of,
    ),
    Kind(
        title="robots",
        name="robot_N",
        command="zteam-robot",
        options=_robots,
        stop_rank=0,
        hint="zteam-robot --id 0",
        in_lockstep=True,
        robot_id_of=names.robot_id_of,
    ),
    Kind(
        title="view",
        name=names.VIEW,
        command="zteam-view",
        options=lambda launch: {names.VIEW: launch.view} if launch.view else {},
        stop_rank=0,
        beside=True,
        is_one=names.is_view,
    ),
)
"""In the order of starting."""


def kind_of(name: str) -> Kind | None:
    """The kind of a process by its name; None for a user's own process."""
    return next((kind for kind in KINDS if kind.includes(name)), None)
