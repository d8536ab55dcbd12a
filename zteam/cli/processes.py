"""The commands of a team's processes, such as `zteam-sim`: each makes the options of its kind from a command line."""

import argparse
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from zteam import names
from zteam.cli.options import (
    Parser,
    add_bus_options,
    add_clock_option,
    add_go_timeout_option,
    add_option,
    add_options,
    add_path_option,
    add_repeated,
    bus_options,
    check_together,
    checked,
    folders_of,
    option_type,
    parse_speed,
    read_options,
    run,
)
from zteam.config.numbers import parse_number
from zteam.config.problems import problems_of
from zteam.config.resources import find_world
from zteam.config.robot_ids import format_robot_ids, parse_robot_ids
from zteam.config.simulation_options import LockStepOptions, Options, SimOptions
from zteam.config.toml_values import parse_value
from zteam.errors import UsageError
from zteam.geometry import FAR, Pose2
from zteam.messages.base import BaseOverride
from zteam.node import process_options

if TYPE_CHECKING:
    from zteam.team.file.entries import Team

Read = tuple[str, Callable[[], process_options.ProcessOptions]]
"""The name of a process, and what makes its options once the log is there."""
_EXAMPLES = {"--param": "speed=0.4", "--base": "max_vel_x=0.4"}


def _add_team_file(parser: Parser, text: str) -> None:
    parser.add_argument("team", nargs="?", metavar="TEAM.toml", help=f"read {text} from this team file")
    parser.add_argument("arguments", nargs="*", metavar="NAME=VALUE", help="arguments of the team file")


def _load_team(args: argparse.Namespace) -> "Team | None":
    """The team file of a command line, if any. Raises UsageError and ConfigError."""
    from zteam.team.file.reading import load_team
    from zteam.team.file.sources import parse_arguments

    return load_team(Path(args.team), parse_arguments(args.arguments)) if args.team else None


def _add_simulator(parser: Parser) -> None:
    """`zteam-sim WORLD`: run the simulator. It reads Stage's world files; a robot's id is its place in the file."""
    parser.add_argument("world", metavar="WORLD", help="a .world file, or the name of a shipped world such as office")
    add_options(parser, SimOptions, "seed", "has_map")
    robots = parser.add_argument_group("robots")
    text = "add a robot to the world's own, e.g. 7:erratic:2.0:3.5:1.57"
    add_repeated(robots, "--add", "ID:MODEL:X:Y:YAW", text, type=option_type(_parse_addition))
    add_options(robots, SimOptions, "world_robots")
    text = "measure the gap between two robots, e.g. 1:0"
    add_repeated(robots, "--gap", "FOLLOWER:LEADER", text, type=option_type(_parse_gap))
    time = parser.add_argument_group("time (docs/time.md)")
    add_options(time, SimOptions, "run_for", "until", "speed", "paused")
    time.add_argument("--lockstep", action="store_true", help="begin a tick when every participant has answered")
    add_options(time, LockStepOptions)
    add_options(parser.add_argument_group("contacts, sensors and the map (docs/simulator.md)"), Options)


def _simulation_options(args: argparse.Namespace) -> Options:
    try:
        alphas = None if args.odom_alphas is None else tuple(map(float, args.odom_alphas.split(",")))
        if alphas is not None and len(alphas) != 4:
            raise ValueError("--odom-alphas takes four numbers, such as 0.05,0.01,0.02,0.01")
        return read_options(Options, args, odom_alphas=alphas)
    except ValueError as error:
        raise UsageError(str(error)) from None


def _parse_gap(text: str) -> tuple[int, int]:
    """(follower, leader) of FOLLOWER:LEADER."""
    follower, colon, leader = text.partition(":")
    if not colon:
        raise UsageError(f"{text!r} is not FOLLOWER:LEADER, e.g. 1:0")
    return names.parse_robot_id(follower), names.parse_robot_id(leader)


def _parse_addition(text: str) -> tuple[int, str, Pose2]:
    """(id, model, pose in `map`) of ID:MODEL:X:Y:YAW."""
    try:
        robot_id, model, x, y, yaw = text.split(":")
    except ValueError:
        raise UsageError(f"{text!r} is not ID:MODEL:X:Y:YAW, e.g. 7:erratic:2.0:3.5:1.57") from None
    pose = Pose2(*(parse_number(word, -FAR, FAR, "metres and radians") for word in (x, y, yaw)))
    return names.parse_robot_id(robot_id), model, pose


def _read_simulator(args: argparse.Namespace) -> Read:
    check_together(args, {"--expect": ("--lockstep",), "--no-gate": ("--lockstep",)}, {})
    options = read_options(
        SimOptions,
        args,
        world=Path(args.world),
        added=tuple(args.add),
        follows=dict(args.gap),
        engine=_simulation_options(args),
        speed=parse_speed(args.speed or ("max" if args.lockstep else "1")),
        lockstep=read_options(LockStepOptions, args) if args.lockstep else None,
    )
    # Once the log is there: a world that is not found is logged like one that cannot be read.
    return names.SIMULATOR, lambda: msgspec.structs.replace(options, world=find_world(args.world))


def _add_robot(parser: Parser) -> None:
    """`zteam-robot --id N`: run one robot's behaviour: read its sensors, write its velocity command."""
    robot_id = option_type(names.parse_robot_id)
    parser.add_argument("--id", type=robot_id, required=True, metavar="N", help=f"robot id, 0 to {names.MAX_ROBOT_ID}")
    what = parser.add_mutually_exclusive_group()
    text = "run forward, avoid, wander, follow or package.module:Class (default: forward)"
    what.add_argument("--behavior", default="forward", metavar="NAME", help=text)
    what.add_argument("--follow", type=robot_id, metavar="ID", help="follow this robot")
    text = "with --follow: along the trail of the head of the chain (default), or straight to the leader"
    parser.add_argument("--law", choices=("trail", "direct"), help=text)
    add_param_option(parser)
    text, parse = "set footprint or a limit instead of what base_info tells", partial(parse_param, option="--base")
    add_repeated(parser, "--base", "KEY=VALUE", f"{text}, e.g. {_EXAMPLES['--base']}", type=option_type(parse))
    add_path_option(parser)
    add_options(parser, process_options.RobotOptions)
    add_clock_option(parser)


def add_param_option(parser: argparse.ArgumentParser) -> None:
    text = f"set a parameter of the behaviour, e.g. {_EXAMPLES['--param']}"
    add_repeated(parser, "--param", "KEY=VALUE", text, type=option_type(parse_param))


def parse_param(text: str, option: str = "--param") -> tuple[str, Any]:
    """(key, value) of KEY=VALUE; the value is TOML as in a team file (0.4, true, "text", [1, 2]), else a string."""
    key, equals, value = text.partition("=")
    if not equals or not key.isidentifier():
        raise UsageError(f"{text!r} is not KEY=VALUE, e.g. {option} {_EXAMPLES[option]}")
    return key, parse_value(value)


def read_base(pairs: Iterable[tuple[str, Any]]) -> BaseOverride:
    """What the options `--base KEY=VALUE` set. Raises UsageError."""
    given = dict(pairs)
    for problem in problems_of(given, BaseOverride):
        raise UsageError(f"--base {problem}")
    return msgspec.convert(given, BaseOverride)


def _read_robot(args: argparse.Namespace) -> Read:
    params = dict(args.param)
    check_together(args, {"--law": ("--follow",)}, {})
    for flag, name in (("law", "law"), ("follow", "leader")):
        if getattr(args, flag) is not None:
            if name in params:
                raise UsageError(f"--{flag} names the {name} already: leave --param {name} out")
            params[name] = getattr(args, flag)
    if args.follow == args.id:
        raise UsageError(f"--follow {args.follow}: a robot cannot follow itself")
    spec = args.behavior if args.follow is None else "follow"
    if spec == "follow" and "leader" not in params:
        raise UsageError("--behavior follow: the leader is missing; say --follow ID instead")
    base, where = read_base(args.base), folders_of(args)
    options = read_options(
        process_options.RobotOptions, args, robot_id=args.id, behavior=spec, params=params, base=base, folders=where
    )
    return names.robot_name(args.id), lambda: options


def _add_navigation(parser: Parser) -> None:
    """`zteam-nav --id N`: localise a robot, plan its way to a goal, and drive there; with `--ids`, several robots."""
    _add_team_file(parser, "the parameters of the robots")
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--id", metavar="N", help="the robot")
    which.add_argument("--ids", nargs="+", metavar="ID", help="several robots in this process, e.g. --ids 1-4")
    parser.add_argument("--params", metavar="FILE.yaml", help="a parameter file as Nav2 has them")
    text = "set a parameter, e.g. amcl.max_particles=5000, controller_server.FollowPath.desired_linear_vel=0.4"
    add_repeated(parser, "--param", "NODE.NAME=VALUE", text)
    text = "how to find out where a robot is: by its laser (amcl, the default), from the simulator, or not at all"
    add_option(parser, "--localizer", choices=("amcl", "fake", "none"), help=text)
    add_options(parser, process_options.NavigationOptions)
    add_clock_option(parser)


def _read_navigation(args: argparse.Namespace) -> Read:
    ids = [names.parse_robot_id(args.id)] if args.ids is None else sorted(parse_robot_ids(args.ids, "--ids"))
    return names.navigation_name(ids[0]), lambda: _navigation_options(args, ids)


def _navigation_table(args: argparse.Namespace) -> dict[str, Any]:
    """What the options set, as the table `navigation` of a team file."""
    given = {"params": args.params, "localizer": args.localizer}
    table: dict[str, Any] = {name: text for name, text in given.items() if text is not None}
    for text in args.param:
        key, equals, value = text.partition("=")
        node, dot, name = key.partition(".")
        if not (equals and dot and node and name) or node in ("params", "localizer"):
            raise UsageError(f"--param {text!r} is not NODE.NAME=VALUE, e.g. --param amcl.max_particles=5000")
        table.setdefault(node, {})[name] = parse_value(value)
    return table


def _navigation_options(args: argparse.Namespace, ids: Iterable[int]) -> process_options.NavigationOptions:
    """What the command line and the team file say. Raises UsageError and ConfigError."""
    from zteam.team.file.entries import navigation_of

    team = _load_team(args)
    entries = {entry.id: entry for entry in team.robots} if team else {}
    lacking = [robot_id for robot_id in ids if entries and robot_id not in entries]
    if lacking:
        raise UsageError(f"{args.team} has no robot {format_robot_ids(lacking)}")
    given, robots = _navigation_table(args), {}
    for robot_id in ids:
        entry = entries.get(robot_id)
        if entry is None:
            robots[robot_id] = process_options.NavigatedRobot(given)
            continue
        own = navigation_of(entry) or {}
        folder = Path(args.team).parent if own.get("params") is not None and args.params is None else Path()
        source = f"{args.team}: robot {robot_id}, navigation"
        # What the command line gives for a node joins what the file gives for it.
        nodes = {node: {**own[node], **table} for node, table in given.items() if isinstance(own.get(node), Mapping)}
        robots[robot_id] = process_options.NavigatedRobot({**own, **given, **nodes}, folder, source, entry.base)
    return process_options.NavigationOptions(robots, args.seed)


def _add_map(parser: Parser) -> None:
    """`zteam-map MAP.yaml`: serve a map without a simulator, as map_server does: on `map`, for late subscribers too."""
    text = "map_server's file beside its picture: image, resolution, origin, mode, …"
    parser.add_argument("map", metavar="MAP.yaml", help=text)


def _add_aggregator(parser: Parser) -> None:
    """`zteam-tf [TEAM.toml]`: merge every robot's transforms into one tree on `tf` and `tf_static`."""
    _add_team_file(parser, "static transforms and robot descriptions")
    add_options(parser, process_options.AggregatorOptions)
    add_clock_option(parser)


def _aggregator_options(args: argparse.Namespace) -> process_options.AggregatorOptions:
    """What the command line and the team file say. Raises UsageError and ConfigError."""
    from zteam.team.launch.plan import aggregator_options

    team = _load_team(args)
    options = aggregator_options(team, Path(args.team).parent) if team else process_options.AggregatorOptions()
    return msgspec.structs.replace(options, rate=args.rate)


def _add_monitor(parser: Parser) -> None:
    """`zteam-monitor --team-size N`: run the start gate ("All robots GO!") and watch the team's health; with a
    monitor running already, show that one's team."""
    team, sizes = parser.add_mutually_exclusive_group(), (1, names.MAX_ROBOT_ID + 1, "a whole number")
    add_option(team, "--team-size", typed=sizes, metavar="N", help="wait for this many robots")
    team.add_argument("--ids", nargs="+", metavar="ID", help="wait for these robots, e.g. --ids 0 1 2 3, --ids 0-3")
    add_options(parser, process_options.MonitorOptions)
    add_go_timeout_option(parser)
    add_clock_option(parser)


def _read_monitor(args: argparse.Namespace) -> Read:
    check_together(args, {"--in-world": ("--ids",)}, {})
    # Without either it looks at the monitor that runs.
    ids = None if args.ids is None else parse_robot_ids(args.ids, "--ids")
    team_size = len(ids) if ids else args.team_size or 0
    options = read_options(process_options.MonitorOptions, args, team_size=team_size, ids=ids)
    return names.MONITOR, lambda: options


def _add_view(parser: Parser) -> None:
    """`zteam view`: see the team in a browser, and drive it with the mouse (docs/view.md)."""
    parser.add_argument("--foxglove", action="store_true", help="show the team to Foxglove and Lichtblick too")
    add_options(parser, process_options.ViewOptions.from_environment())
    parser.set_defaults(foxglove_port=process_options.DEFAULT_FOXGLOVE_PORT)
    # What a test waits for.
    parser.add_argument("--name", default="", help=argparse.SUPPRESS)


def _view_options(args: argparse.Namespace) -> process_options.ViewOptions:
    options = read_options(
        process_options.ViewOptions, args, foxglove_port=args.foxglove_port if args.foxglove else None
    )
    return msgspec.structs.replace(options, browser=options.browser and sys.stdout.isatty())


def _add_recorder(parser: Parser) -> None:
    """`zteam record`: record what comes over the bus until Ctrl+C (docs/recording.md)."""
    text = "a key or key expression to record alone, such as 'robot_0/**' (default: all)"
    parser.add_argument("keys", nargs="*", metavar="KEY", help=text)
    parser.add_argument("-o", "--output", required=True, metavar="FILE.mcap", help="write this file")
    add_options(parser, process_options.RecorderOptions)


def _read_recorder(args: argparse.Namespace) -> Read:
    from zteam.bus.transport import problem_of

    file = Path(args.output)
    for key in args.keys:
        if problem := problem_of(key):
            raise UsageError(problem)
    process_options.check_new_file(file, force=args.force)
    options = read_options(process_options.RecorderOptions, args, file=file, command="zteam record")
    return names.RECORDER, lambda: options


def _add_replay(parser: Parser) -> None:
    """`zteam replay`: publish a recording under its names, for tools and the view, until Ctrl+C (docs/recording.md)."""
    parser.add_argument("file", metavar="FILE.mcap", help="what zteam has recorded")
    add_options(parser, process_options.ReplayOptions)


def _replay_options(args: argparse.Namespace) -> process_options.ReplayOptions:
    return read_options(process_options.ReplayOptions, args, file=Path(args.file))


_KINDS: dict[str, tuple[Callable[[Parser], None], Callable[[argparse.Namespace], Read]]] = {
    "zteam-sim": (_add_simulator, _read_simulator),
    "zteam-robot": (_add_robot, _read_robot),
    "zteam-nav": (_add_navigation, _read_navigation),
    "zteam-map": (_add_map, lambda args: (names.MAP_SERVER, lambda: process_options.MapOptions(Path(args.map)))),
    "zteam-tf": (_add_aggregator, lambda args: (names.AGGREGATOR, partial(_aggregator_options, args))),
    "zteam-monitor": (_add_monitor, _read_monitor),
    "zteam-record": (_add_recorder, _read_recorder),
    "zteam-replay": (_add_replay, lambda args: (names.REPLAY, partial(_replay_options, args))),
    "zteam-view": (_add_view, lambda args: (names.VIEW, partial(_view_options, args))),
}
"""What adds the options of each command, with its help as docstring, and what reads them. Raises UsageError."""


_TITLES = {"zteam-view": "zteam view", "zteam-record": "zteam record", "zteam-replay": "zteam replay"}
"""What users type."""


def build_parser(command: str) -> Parser:
    add, _ = _KINDS[command]
    parser = Parser(prog=_TITLES.get(command, command), description=add.__doc__)
    add(parser)
    add_bus_options(parser)
    return parser


def read(command: str, args: argparse.Namespace) -> Read:
    """What a command line says. Raises UsageError."""
    return _KINDS[command][1](args)


def main(command: str, argv: Sequence[str] | None = None) -> int:
    """Be the process; its exit code."""
    args = build_parser(command).parse_args(argv)
    name, make_options = checked(args, lambda: read(command, args))

    def be() -> int:
        from zteam.team.member import run_member

        clock = getattr(args, "clock", None)
        return run_member(name, make_options(), lambda small: bus_options(args, small=small), clock)

    return run(name, args, be, needs_output=command not in ("zteam-monitor", "zteam-view"))
