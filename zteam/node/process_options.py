"""What each kind of process is told when it starts: one struct a kind, whose fields are those of its command line.

`zteam up`, `zteam.run_team` and the `team` fixture make them of a team file, and commands of what a user types. A
launcher hands them to its children as one line of JSON on their standard input.
"""

import json
import os
from pathlib import Path
from typing import Annotated, Any, get_args

import msgspec

from zteam.bus.options import RouterOptions
from zteam.config.option import Seed, option
from zteam.config.simulation_options import LOCKSTEP_TIMEOUT as LOCKSTEP_TIMEOUT
from zteam.config.simulation_options import LockStepOptions as LockStepOptions
from zteam.config.simulation_options import SimOptions as SimOptions
from zteam.errors import UsageError
from zteam.messages import TransformStamped
from zteam.messages.base import BaseOverride

PORTS = (0, 65535, "a port")
DEFAULT_VIEW_PORT = 8765
DEFAULT_FOXGLOVE_PORT = 8766

MAX_LINE = 1 << 24
"""Characters of a launcher's line."""


class MapOptions(msgspec.Struct, frozen=True):
    """A map server."""

    file: Path
    """map_server's YAML."""


class AggregatorOptions(msgspec.Struct, frozen=True):
    """The aggregator of transforms."""

    static_transforms: tuple[TransformStamped, ...] = ()
    descriptions: dict[int, Path] = msgspec.field(default_factory=dict)
    """URDF files, by robot."""
    rate: Annotated[
        float | None,
        option("publish at this rate (default: once per tick)", "HZ", typed=(1e-3, 1e4, "bundles a second")),
    ] = None


class MonitorOptions(msgspec.Struct, frozen=True):
    """The monitor."""

    team_size: int
    """0 without ids: look at the monitor that runs."""
    ids: tuple[int, ...] | None = None
    json: Annotated[bool, option("print events as JSON lines: event, robot, text")] = False
    exit_on_go: Annotated[bool, option("end with 0 once GO is sent and every robot runs")] = False
    table: Annotated[
        float | None,
        option(
            "also print the table this often, in host time, where the output is no terminal",
            "SECONDS",
            typed=(0.1, 86400.0, "seconds"),
        ),
    ] = None
    """Infinity = a single one."""
    go_timeout: float | None = None
    """Host seconds without GO after which to give up. Simulated time may stand still until GO."""
    in_world: Annotated[bool, option("with --ids: wait only for those that the simulator's world has")] = False


class RobotOptions(msgspec.Struct, frozen=True):
    """One robot."""

    robot_id: int
    behavior: str
    """Its name."""
    params: dict[str, Any] = {}
    """Of the behaviour, by name."""
    gate: Annotated[bool, option("drive without waiting for the monitor's GO")] = True
    seed: Seed = 1
    base: BaseOverride = BaseOverride()
    """What holds instead of `base_info`."""
    safety: Annotated[bool, option("drive without the safety layer: nothing stops it before obstacles")] = True
    """Without it only the limits of the base hold."""
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
    seed: Seed = 1


class ViewOptions(msgspec.Struct, frozen=True):
    """A view: where its page is served."""

    host: Annotated[str, option("listen at this address (default: %(default)s; $ZTEAM_VIEW_HOST)")] = "127.0.0.1"
    port: Annotated[int, option("listen at this port, 0 for any", typed=PORTS)] = DEFAULT_VIEW_PORT
    public_url: Annotated[
        str,
        option(
            "print this address: where browsers find the page behind a published port or a proxy ($ZTEAM_VIEW_URL)",
            "URL",
        ),
    ] = ""
    browser: Annotated[bool, option("print the address only")] = True
    layout: Annotated[Path | None, option("begin with this layout, which the page has saved", "FILE", type=Path)] = None
    token: Annotated[str, option("what a page needs to command (default: a new one; $ZTEAM_VIEW_TOKEN)")] = ""
    foxglove_port: Annotated[int | None, option("where they find it (default: %(default)s)", typed=PORTS)] = None
    """Where Foxglove finds the team; 0: any, None: nowhere."""
    foxglove_layout: Annotated[
        Path | None, option("write a layout of this team's topics for them, and end", "FILE", type=Path)
    ] = None
    name: str = ""
    """Its name on the bus; empty: a new one of its kind."""

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


class RecorderOptions(msgspec.Struct, frozen=True):
    """A recorder."""

    file: Path
    """Absolute for a recorder that a launcher starts."""
    keys: tuple[str, ...] = ()
    """Key expressions to record alone; none: all."""
    force: Annotated[bool, option("replace the file if it exists")] = False
    last: Annotated[
        float | None,
        option("keep the last seconds alone, and write them at the end", "SECONDS", typed=(1e-3, 1e6, "seconds")),
    ] = None
    seed: Seed = 1
    command: str = ""
    """What has started the run, for its readers."""
    launch: dict[str, Any] | None = None
    """The whole team, as `team.launch.recorded` reads it; None for a recorder that joins one."""


class ReplayOptions(msgspec.Struct, frozen=True):
    """A replay of a recording."""

    file: Path
    speed: Annotated[
        float, option("recorded seconds a second of the host", "X", typed=(1e-3, 1e3, "recorded seconds a second"))
    ] = 1.0
    begin: Annotated[
        float, option("begin so many seconds after its start", "SECONDS", flag="from", typed=(0.0, 1e9, "seconds"))
    ] = 0.0
    loop: Annotated[bool, option("begin again at the end")] = False
    pause: Annotated[bool, option("stand at the begin until it is resumed")] = False


def check_new_file(file: Path, *, force: bool) -> None:
    """Raise UsageError where a recording cannot begin in this file: an older one is kept unless `force`."""
    is_new = not file.exists()
    if not (is_new or force):
        raise UsageError(f"{file} exists: choose another file, or say --force to replace it")
    try:
        file.open("ab").close()
        if is_new:
            file.unlink()
    except OSError as error:
        raise UsageError(f"{file}: cannot write a recording: {error.strerror}") from None


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
    | RecorderOptions
    | ReplayOptions
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
