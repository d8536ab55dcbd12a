"""What each kind of process is told when it starts: one struct a kind, whose fields are those of its command line.

`zteam up`, `zteam.run_team` and the `team` fixture make them of a team file, and commands of what a user types. A
launcher hands them to its children as one line of JSON on their standard input.
"""

import json
import os
from pathlib import Path
from typing import Any, get_args

import msgspec

from zteam.bus.options import RouterOptions
from zteam.config.fault import Fault
from zteam.config.simulation_options import Options
from zteam.errors import UsageError
from zteam.geometry import Pose2
from zteam.messages import TransformStamped
from zteam.messages.base import BaseOverride

LOCKSTEP_TIMEOUT = 10.0
"""Host seconds until lock-step leaves a living participant behind that does not answer."""
DEFAULT_VIEW_PORT = 8765
DEFAULT_FOXGLOVE_PORT = 8766

MAX_LINE = 1 << 24
"""Characters of a launcher's line."""


class LockStepOptions(msgspec.Struct, frozen=True):
    """How the simulator keeps lock-step."""

    expected: tuple[str, ...] = ()
    """The first tick is held until these processes take part."""
    timeout: float = LOCKSTEP_TIMEOUT
    """Host seconds until a living participant that does not answer is dropped."""
    gate: bool = True
    """Hold the first tick until the monitor gives GO."""


class SimOptions(msgspec.Struct, frozen=True):
    """A simulator."""

    world: Path
    seed: int = 1
    map_resolution: float = 0.05
    """Metres a cell of the published map."""
    has_map: bool = True
    """Whether it publishes one."""
    world_robots: bool = True
    """Whether the world's own robots are simulated."""
    added: tuple[tuple[int, str, Pose2], ...] = ()
    """Further robots: id, model, pose in `map`."""
    follows: dict[int, int] = msgspec.field(default_factory=dict)
    """Pairs whose gap is measured: follower -> leader."""
    engine: Options = Options()
    run_for: float | None = None
    """Stand still this many simulated seconds after GO."""
    until: int | None = None
    """Stand still before this tick."""
    speed: float | None = 1.0
    """Simulated seconds a second of the host; None = as fast as possible."""
    paused: bool = False
    """Stand still at the first tick."""
    lockstep: LockStepOptions | None = None
    faults: tuple[Fault, ...] = ()
    """On purpose, in lock-step: those that the simulator can carry out."""


class MapOptions(msgspec.Struct, frozen=True):
    """A map server."""

    file: Path
    """map_server's YAML."""


class AggregatorOptions(msgspec.Struct, frozen=True):
    """The aggregator of transforms."""

    static_transforms: tuple[TransformStamped, ...] = ()
    descriptions: dict[int, Path] = msgspec.field(default_factory=dict)
    """URDF files, by robot."""
    rate: float | None = None
    """Bundles a second; None = one a tick."""


class MonitorOptions(msgspec.Struct, frozen=True):
    """The monitor."""

    team_size: int
    """0: look at the monitor that runs."""
    ids: tuple[int, ...] | None = None
    json: bool = False
    exit_on_go: bool = False
    table: float | None = None
    """Host seconds between two tables where there is no terminal; None = no table, infinity = a single one."""
    go_timeout: float | None = None
    """Host seconds without GO after which to give up. Simulated time may stand still until GO."""
    in_world: bool = False
    """Whether GO waits only for those of `ids` that the simulator's world has."""


class RobotOptions(msgspec.Struct, frozen=True):
    """One robot."""

    robot_id: int
    behavior: str
    """Its name."""
    params: dict[str, Any] = {}
    """Of the behaviour, by name."""
    gate: bool = True
    """Wait for the monitor's GO."""
    seed: int = 1
    base: BaseOverride = BaseOverride()
    """What holds instead of `base_info`."""
    safety: bool = True
    """Without it nothing but the limits of the base holds."""
    folders: tuple[str, ...] = ("",)
    """Where the module of a user's behaviour may lie; an empty name is the current folder."""


class NavigatedRobot(msgspec.Struct, frozen=True):
    """One robot of a navigation."""

    parameters: dict[str, Any] = {}
    """As the table `navigation` of a team file."""
    folder: Path = Path()
    """Where a parameter file that they name lies."""
    source: str = "the parameters"
    """What an error calls the table."""
    base: BaseOverride = BaseOverride()
    """What holds instead of `base_info`."""


class NavigationOptions(msgspec.Struct, frozen=True):
    """The navigation of one or several robots."""

    robots: dict[int, NavigatedRobot]
    """By id."""
    seed: int = 1


class ViewOptions(msgspec.Struct, frozen=True):
    """A view: where its page is served."""

    host: str = "127.0.0.1"
    port: int = DEFAULT_VIEW_PORT
    """0: any."""
    token: str = ""
    """Empty: one is made."""
    browser: bool = True
    """Whether the page is opened in the user's browser."""
    layout: Path | None = None
    """A file with the layout that pages begin with."""
    foxglove_port: int | None = None
    """Where Foxglove finds the team; 0: any, None: nowhere."""
    foxglove_layout: Path | None = None
    """A file to write a layout for Foxglove to, instead of a view."""
    name: str = ""
    """Its name on the bus; empty: a new one of its kind."""
    public_url: str = ""
    """Where browsers find the page, if that is not where it is served: behind a published port, or a proxy."""

    @classmethod
    def from_environment(cls) -> "ViewOptions":
        """What ZTEAM_VIEW_HOST, ZTEAM_VIEW_TOKEN and ZTEAM_VIEW_URL say."""
        given = {"host": "HOST", "token": "TOKEN", "public_url": "URL"}
        found = {field: os.environ.get(f"ZTEAM_VIEW_{name}") for field, name in given.items()}
        return msgspec.convert({field: text for field, text in found.items() if text}, cls)


class NodeOptions(msgspec.Struct, frozen=True):
    """A node of the user's own."""

    name: str
    body: str
    """Its function, as `package.module:function`."""
    folders: tuple[str, ...] = ("",)
    """As of RobotOptions."""


ProcessOptions = (
    RouterOptions
    | SimOptions
    | MapOptions
    | AggregatorOptions
    | MonitorOptions
    | RobotOptions
    | NavigationOptions
    | ViewOptions
    | NodeOptions
)
_TYPES = {kind.__name__: kind for kind in get_args(ProcessOptions)}


def to_line(name: str, options: ProcessOptions) -> str:
    """What a launcher writes to the process `name`."""
    # Python's own JSON, because it has infinity, as TOML has.
    return json.dumps([name, type(options).__name__, msgspec.to_builtins(options, str_keys=True, enc_hook=str)])


def from_line(line: str) -> tuple[str, ProcessOptions]:
    """The name of the process and its options. Raises UsageError for what `to_line` does not write."""
    try:
        name, kind, options = json.loads(line)
        return name, msgspec.convert(options, _TYPES[kind], str_keys=True, dec_hook=lambda made, text: made(text))
    except (ValueError, TypeError, KeyError, msgspec.ValidationError, RecursionError) as error:
        raise UsageError(f"standard input: no line of a launcher: {error}") from None
