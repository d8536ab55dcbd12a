"""`zteam-nav --id N`: localise a robot, plan its way to a goal, and drive there; with `--ids`, several robots."""

import argparse
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from zteam import names
from zteam.cli.arguments import add_option, add_options, add_repeated
from zteam.cli.options import Parser, add_bus_options, add_clock_option, run_process
from zteam.config.robot_ids import format_robot_ids, parse_robot_ids
from zteam.config.toml_values import parse_value
from zteam.errors import UsageError
from zteam.node.process_options import NavigatedRobot, NavigationOptions


def build_parser() -> Parser:
    parser = Parser(prog="zteam-nav", description=__doc__)
    parser.add_argument(
        "team", nargs="?", metavar="TEAM.toml", help="read the parameters of the robots from this team file"
    )
    parser.add_argument("arguments", nargs="*", metavar="NAME=VALUE", help="arguments of the team file")
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--id", metavar="N", help="the robot")
    which.add_argument("--ids", nargs="+", metavar="ID", help="several robots in this process, e.g. --ids 1-4")
    parser.add_argument("--params", metavar="FILE.yaml", help="a parameter file as Nav2 has them")
    text = "set a parameter, e.g. amcl.max_particles=5000, controller_server.FollowPath.desired_linear_vel=0.4"
    add_repeated(parser, "--param", "NODE.NAME=VALUE", text)
    text = "how to find out where a robot is: by its laser (amcl, the default), from the simulator, or not at all"
    add_option(parser, "--localizer", choices=("amcl", "fake", "none"), help=text)
    add_options(parser, NavigationOptions)
    add_clock_option(parser)
    add_bus_options(parser)
    return parser


def _read(args: argparse.Namespace) -> tuple[str, Callable[[], NavigationOptions]]:
    ids = [names.parse_robot_id(args.id)] if args.ids is None else sorted(parse_robot_ids(args.ids, "--ids"))
    return names.navigation_name(ids[0]), lambda: _options(args, ids)


def _table(args: argparse.Namespace) -> dict[str, Any]:
    """What the options set, as the table `navigation` of a team file. Raises UsageError."""
    given = {"params": args.params, "localizer": args.localizer}
    table: dict[str, Any] = {name: text for name, text in given.items() if text is not None}
    for text in args.param:
        key, equals, value = text.partition("=")
        node, dot, name = key.partition(".")
        if not (equals and dot and node and name) or node in ("params", "localizer"):
            raise UsageError(f"--param {text!r} is not NODE.NAME=VALUE, e.g. --param amcl.max_particles=5000")
        table.setdefault(node, {})[name] = parse_value(value)
    return table


def _options(args: argparse.Namespace, ids: Iterable[int]) -> NavigationOptions:
    """What the command line and the team file say. Raises UsageError and ConfigError."""
    from zteam.team.file.entries import navigation_of
    from zteam.team.file.reading import load_team
    from zteam.team.file.sources import parse_arguments

    team = load_team(Path(args.team), parse_arguments(args.arguments)) if args.team else None
    entries = {entry.id: entry for entry in team.robots} if team else {}
    lacking = [robot_id for robot_id in ids if entries and robot_id not in entries]
    if lacking:
        raise UsageError(f"{args.team} has no robot {format_robot_ids(lacking)}")
    given, robots = _table(args), {}
    for robot_id in ids:
        entry = entries.get(robot_id)
        if entry is None:
            robots[robot_id] = NavigatedRobot(given)
            continue
        own = navigation_of(entry) or {}
        folder = Path(args.team).parent if own.get("params") is not None and args.params is None else Path()
        source = f"{args.team}: robot {robot_id}, navigation"
        # What the command line gives for a node joins what the file gives for it.
        nodes = {node: {**own[node], **table} for node, table in given.items() if isinstance(own.get(node), Mapping)}
        robots[robot_id] = NavigatedRobot({**own, **given, **nodes}, folder, source, entry.base)
    return NavigationOptions(robots, args.seed)


main = partial(run_process, build_parser, _read)
