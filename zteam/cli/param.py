"""`zteam param list | get | set | dump`: a behaviour's parameters while it runs."""

import argparse
import math
from collections.abc import Callable, Sequence
from fnmatch import fnmatchcase
from functools import partial
from typing import Any

import msgspec

from zteam import names
from zteam.cli.behaviors import exact_text, format_parameters
from zteam.cli.listening import check_key, open_bus
from zteam.cli.options import Parser, add_bus_options, add_json, run_tool
from zteam.config.robot_ids import parse_robot_ids
from zteam.config.toml_values import parse_value
from zteam.errors import BusError, UsageError, did_you_mean
from zteam.node.output import print_block, print_json, print_line
from zteam.robot.client import DescribeReply, ParametersClient

Robots = dict[str, DescribeReply]
"""What each robot told, by name."""
Act = Callable[[argparse.Namespace, ParametersClient, Robots], int]
_ROBOTS = "robots: robot_0, 'robot_*', or ids such as 0 or 0-3"


def build_parser() -> Parser:
    parser = Parser(prog="zteam param", description=__doc__)

    def verb(name: str, act: Act, text: str) -> Parser:
        return parser.add_verb(name, act, text, add_json, add_bus_options)

    verb("list", _list, "list the parameters of robots and their values").add_argument(
        "robots", nargs="?", default="*", metavar="NAME", help=f"{_ROBOTS} (default: all)"
    )
    get = verb("get", _get, "print the value of a parameter")
    get.add_argument("robots", metavar="NAME", help=_ROBOTS)
    get.add_argument("parameter", metavar="PARAM")
    change = verb("set", _set, "set parameters from the robot's next step on: all of them, or none if one is refused")
    change.add_argument("robots", metavar="NAME", help=_ROBOTS)
    text = "the value as in a team file: 0.4, true, text, [1, 2]"
    change.add_argument("pairs", nargs="+", metavar="PARAM VALUE", help=text)
    dump = verb("dump", _dump, "print the parameters as TOML, for the robot's table in a team file")
    dump.add_argument("robots", metavar="NAME", help="one robot: robot_0 or 0")
    return parser


def _read(args: argparse.Namespace) -> None:
    if args.verb == "set":
        args.values = parse_pairs(args.pairs)


def _answer(args: argparse.Namespace) -> int:
    with open_bus(args) as bus:
        client = ParametersClient(bus)
        code: int = args.act(args, client, find_robots(client, args.robots))
        return code


def parse_pairs(words: Sequence[str]) -> dict[str, Any]:
    """The values by name of the words PARAM VALUE [PARAM VALUE …]. Raises UsageError."""
    values: dict[str, Any] = {}
    if len(words) % 2:
        raise UsageError(f"set {' '.join(words)!r}: give each parameter a value, e.g. speed 0.3 turn_rate 1.0")
    for name, text in zip(words[::2], words[1::2], strict=True):
        if name in values:
            raise UsageError(f"set {name}: it is given twice")
        values[name] = parse_value(text.strip())
        if isinstance(values[name], float) and not math.isfinite(values[name]):
            raise UsageError(f"set {name} {text.strip()}: give a finite number")
    return values


def find_robots(client: ParametersClient, text: str) -> Robots:
    """The robots that a user names, in the order of their ids, and their parameters. Raises UsageError, BusError."""
    pattern = names.strip_slash(text).replace("$*", "*")
    if pattern[:1].isdigit():
        wanted = [names.robot_name(robot_id) for robot_id in parse_robot_ids([pattern], "NAME")]
    elif "*" not in pattern:
        wanted = [check_key(text)]
    else:
        found = client.describe_all()
        wanted = sorted(filter(lambda name: fnmatchcase(name, pattern), found), key=_order)
        if not wanted:
            there = ", ".join(sorted(found, key=_order)) or "none: start a team with 'zteam up'"
            raise BusError(f"no process {text} with parameters; there is {there}")
        return {name: found[name] for name in wanted}
    # The others may not answer.
    return {name: client.describe(name) for name in wanted}


def _order(name: str) -> tuple[int, str]:
    return names.robot_id_of(name) or 0, name


def _list(args: argparse.Namespace, _client: ParametersClient, robots: Robots) -> int:
    if args.json:
        for_json = []
        for name, reply in robots.items():
            rows = [{**msgspec.structs.asdict(each), "value": reply.values.get(each.name)} for each in reply.parameters]
            for_json.append({"name": name, "behavior": reply.behavior, "parameters": rows})
        print_json(for_json)
        return 0
    for name, reply in robots.items():
        print_line(f"{name}: {reply.behavior}")
        print_block(format_parameters(reply.parameters, reply.values) if reply.parameters else "  no parameters")
    return 0


def _get(args: argparse.Namespace, _client: ParametersClient, robots: Robots) -> int:
    found = {name: reply.values[args.parameter] for name, reply in robots.items() if args.parameter in reply.values}
    texts = {name: exact_text(value) for name, value in found.items()}
    lines = texts.values() if len(robots) == 1 else [f"{name}: {text}" for name, text in texts.items()]
    print_json(found) if args.json else print_line(*lines)
    lacking = []
    for name, reply in robots.items():
        if name not in found:
            hint, takes = did_you_mean(args.parameter, reply.values), ", ".join(reply.values) or "no parameters"
            lacking.append(f"{name}: no parameter {args.parameter!r}{hint}; {reply.behavior} takes {takes}")
    if lacking:
        # The other robots have been served.
        raise UsageError("\n".join(lacking))
    return 0


def _set(args: argparse.Namespace, client: ParametersClient, robots: Robots) -> int:
    done: dict[str, dict[str, Any]] = {}
    refused = []
    for robot in robots:
        try:
            now = client.set(robot, args.values)
        except UsageError as error:
            refused.append(str(error))
        else:
            done[robot] = {name: now[name] for name in args.values}
    lines = [f"{robot}: {', '.join(_assignments(now))}" for robot, now in done.items()]
    print_json(done) if args.json else print_line(*lines)
    if refused:
        raise UsageError("\n".join(refused))
    return 0


def _dump(args: argparse.Namespace, _client: ParametersClient, robots: Robots) -> int:
    if len(robots) > 1:
        raise UsageError(f"dump {args.robots}: name one robot")
    (reply,) = robots.values()
    # TOML has no null: a parameter that is none is left out.
    table = {name: value for name, value in reply.values.items() if value is not None}
    if reply.behavior == "follow":
        table = {"follow": table.pop("leader"), **table}
    else:
        table = {"behavior": reply.behavior, **table}
    print_json(table) if args.json else print_line(*_assignments(table))
    return 0


def _assignments(values: dict[str, Any]) -> list[str]:
    return [f"{name} = {exact_text(value)}" for name, value in values.items()]


main = partial(run_tool, build_parser, _answer, read=_read)
