"""The kinds of process that make a team: one table, one row per kind.

The plan, the launcher, the `team` fixture and `zteam doctor` read it. A new kind of process needs its options
(`process_options`) and its part (`team.parts`), its command under `cli/`, its row here, and what it is told of a team
(`team.launch.plan`).
"""

from collections.abc import Callable

import msgspec

from zteam import names

ROUTER, NAVIGATION, ROBOT = names.ROUTER, "nav_N", "robot_N"


class Kind(msgspec.Struct, frozen=True):
    """One row."""

    title: str
    """What `zteam doctor` calls it."""
    name: str
    """Name of the process; for one process per robot, the pattern that a user reads."""
    command: str
    """The command that runs it, such as `zteam-sim`."""
    stop_rank: int
    """A team stops rank by rank, the lowest first."""
    hint: str = ""
    """What `zteam doctor` tells the user to do when no such process is alive; `{robots}` is the number of robots.
    Empty for a kind that a team can work without."""
    in_lockstep: bool = False
    """Whether every tick of lock-step waits for it."""
    required_to_finish: bool = False
    """Whether a run with a time limit cannot be finished without it."""
    on_bus: bool = True
    """Whether it holds its name on the bus."""
    optional: bool = False
    """Whether a team runs without it as well: it may come and go at any time."""
    matches: Callable[[str], bool] | None = None
    """Where several of its processes may run: whether a name is that of one."""
    robot_id_of: Callable[[str], int | None] | None = None
    """For one process per robot: the robot's id in a process name, None where the name is of another kind."""

    def includes(self, name: str) -> bool:
        if self.matches is not None:
            return self.matches(name)
        return name == self.name if self.robot_id_of is None else self.robot_id_of(name) is not None


ROUTER_KIND = Kind(
    "router", ROUTER, "zteam-router", 3, "start anything of zteam (it brings a router), or 'zteam-router'",
    required_to_finish=True, on_bus=False,
)  # fmt: skip

KINDS: tuple[Kind, ...] = (
    ROUTER_KIND,
    # The simulator takes longest to start, so it is started first. Robots stop before it: their last command, a zero
    # velocity, must reach the wheels.
    Kind(
        "simulator", names.SIMULATOR, "zteam-sim", 2, "zteam-sim WORLD (or real robots that publish the same keys)",
        required_to_finish=True,
    ),
    # Few teams need a map server: `zteam doctor` names it where the map is missing.
    Kind("map", names.MAP_SERVER, "zteam-map", 1, in_lockstep=True),
    Kind("transforms", names.AGGREGATOR, "zteam-tf", 1, "zteam-tf", in_lockstep=True),
    Kind("monitor", names.MONITOR, "zteam-monitor", 1, "zteam-monitor --team-size {robots}"),
    Kind("navigation", NAVIGATION, "zteam-nav", 0, in_lockstep=True, robot_id_of=names.navigated_robot_of),
    Kind("robots", ROBOT, "zteam-robot", 0, "zteam-robot --id 0", in_lockstep=True, robot_id_of=names.robot_id_of),
    # It stops last, and then with the simulator: what the others publish at their end is recorded.
    Kind("recorder", names.RECORDER, "zteam-record", 2, in_lockstep=True, optional=True),
    # It is no part of a team: it stands for one that was recorded.
    Kind("replay", names.REPLAY, "zteam-replay", 0, optional=True),
    Kind("view", names.VIEW, "zteam-view", 0, optional=True, matches=names.is_view),
)  # fmt: skip
"""In the order of starting."""


def kind_of(name: str) -> Kind | None:
    """The kind of a process by its name; None for a user's own process."""
    return next((kind for kind in KINDS if kind.includes(name)), None)
