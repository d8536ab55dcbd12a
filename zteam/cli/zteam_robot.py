"""`zteam-robot --id N`: run one robot's behaviour: read its sensors, write its velocity command."""

import argparse
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import msgspec

from zteam import names
from zteam.cli.arguments import add_options, add_path_option, add_repeated, folders_of, option_type, read_options
from zteam.cli.options import Parser, add_bus_options, add_clock_option, run_process
from zteam.config.problems import problems_of
from zteam.config.toml_values import parse_value
from zteam.errors import UsageError
from zteam.messages.base import BaseOverride
from zteam.node.process_options import RobotOptions

_EXAMPLES = {"--param": "speed=0.4", "--base": "max_vel_x=0.4"}


def build_parser() -> Parser:
    parser = Parser(prog="zteam-robot", description=__doc__)
    robot_id = option_type(names.parse_robot_id)
    parser.add_argument("--id", type=robot_id, required=True, metavar="N", help=f"robot id, 0 to {names.MAX_ROBOT_ID}")
    what = parser.add_mutually_exclusive_group()
    text = "run forward, avoid, wander, follow or package.module:Class (default: forward)"
    what.add_argument("--behavior", metavar="NAME", help=text)
    what.add_argument("--follow", type=robot_id, metavar="ID", help="follow this robot")
    text = "with --follow: along the trail of the head of the chain (default), or straight to the leader"
    parser.add_argument("--law", choices=("trail", "direct"), help=text)
    add_param_option(parser)
    text, parse = "set footprint or a limit instead of what base_info tells", partial(parse_param, option="--base")
    add_repeated(parser, "--base", "KEY=VALUE", f"{text}, e.g. {_EXAMPLES['--base']}", type=option_type(parse))
    add_path_option(parser)
    add_options(parser, RobotOptions)
    add_clock_option(parser)
    add_bus_options(parser)
    return parser


def add_param_option(parser: argparse.ArgumentParser) -> None:
    """Add `--param`, whose values are pairs."""
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


def _read(args: argparse.Namespace) -> tuple[str, Callable[[], RobotOptions]]:
    """What the options say. Raises UsageError."""
    params = dict(args.param)
    spec = "forward" if args.behavior is None else args.behavior
    if args.law is not None:
        if args.follow is None:
            raise UsageError(f"--law {args.law} says how to follow: say --follow ID too")
        if "law" in params:
            raise UsageError("--law names the law already: leave --param law out")
        params["law"] = args.law
    if args.follow is not None:
        if args.follow == args.id:
            raise UsageError(f"--follow {args.follow}: a robot cannot follow itself")
        if "leader" in params:
            raise UsageError("--follow names the leader already: leave --param leader out")
        spec, params = "follow", {"leader": args.follow, **params}
    elif spec == "follow" and "leader" not in params:
        raise UsageError("--behavior follow: the leader is missing; say --follow ID instead")
    base, folders = read_base(args.base), folders_of(args)
    options = read_options(
        RobotOptions, args, robot_id=args.id, behavior=spec, params=params, base=base, folders=folders
    )
    return names.robot_name(args.id), lambda: options


main = partial(run_process, build_parser, _read)
