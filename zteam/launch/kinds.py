"""The kinds of process that make a team: one table, one row per kind.

The plan, the launcher, the `team` fixture and `zteam doctor` read this table. A new kind of process needs its folder
under `nodes/`, its command under `cli/` and its row here.
"""

from collections.abc import Callable

import msgspec

from zteam import names
from zteam.launch.arguments import (
    Arguments,
    TeamLaunch,
    aggregator_arguments,
    map_arguments,
    monitor_arguments,
    navigation_arguments,
    no_arguments,
    robots_arguments,
    simulator_arguments,
    view_arguments,
)
from zteam.launch.process import zteam_command

ROUTER = "router"


class Kind(msgspec.Struct, frozen=True):
    """One row."""

    title: str
    """What `zteam doctor` calls it."""
    name: str
    """Name of the process; for one process per robot, the pattern that a user reads."""
    command: str
    """The command that runs it, such as `zteam-sim`."""
    arguments: Callable[[TeamLaunch], Arguments]
    """The processes of this kind in a team, by name, with their arguments."""
    stop_rank: int
    """A team stops rank by rank, the lowest first."""
    hint: str
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
    arguments=no_arguments,
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
        arguments=simulator_arguments,
        stop_rank=2,
        hint="zteam-sim WORLD (or real robots that publish the same keys)",
        carries_run=True,
    ),
    Kind(
        title="map",
        name=names.MAP_SERVER,
        command="zteam-map",
        arguments=map_arguments,
        stop_rank=1,
        # The simulator has a map of its own, and few teams need one: `zteam doctor` names it where the map is missing.
        hint="",
    ),
    Kind(
        title="transforms",
        name=names.AGGREGATOR,
        command="zteam-tf",
        arguments=aggregator_arguments,
        stop_rank=1,
        hint="zteam-tf",
        in_lockstep=True,
    ),
    Kind(
        title="monitor",
        name=names.MONITOR,
        command="zteam-monitor",
        arguments=monitor_arguments,
        stop_rank=1,
        hint="zteam-monitor --team-size {robots}",
    ),
    Kind(
        title="navigation",
        name="nav_N",
        command="zteam-nav",
        arguments=navigation_arguments,
        stop_rank=0,
        # Robots that follow or run a behaviour need none.
        hint="",
        in_lockstep=True,
        robot_id_of=names.navigated_robot_of,
    ),
    Kind(
        title="robots",
        name="robot_N",
        command="zteam-robot",
        arguments=robots_arguments,
        stop_rank=0,
        hint="zteam-robot --id 0",
        in_lockstep=True,
        robot_id_of=names.robot_id_of,
    ),
    Kind(
        title="view",
        name=names.VIEW,
        command="zteam-view",
        arguments=view_arguments,
        stop_rank=0,
        hint="",
        beside=True,
        is_one=names.is_view,
    ),
)
"""In the order of starting."""


def kind_of(name: str) -> Kind | None:
    """The kind of a process by its name; None for a user's own process."""
    return next((kind for kind in KINDS if kind.includes(name)), None)
