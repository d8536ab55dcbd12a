"""`zteam stop`: stop robots where they are, whatever drives them, until `zteam stop --release`."""

import argparse
import sys
from functools import partial

from zteam.cli.listening import open_bus
from zteam.cli.options import Parser, add_bus_options, run_tool
from zteam.config.robot_ids import parse_robot_ids
from zteam.errors import ZteamError
from zteam.node.output import print_json, print_line
from zteam.robot.client import StopClient

_ENDS_TEAM = "to end a team, press Ctrl+C where 'zteam up' runs"
_EPILOG = f"""While a robot is stopped its process commands zero velocity, and the simulator holds its body. Both
confirm it; the exit code is 1 if one of them has not confirmed within 1 s. The robots keep their goals. A real base
without a robot process is not held.

This ends no process: {_ENDS_TEAM}."""


def build_parser() -> Parser:
    parser = Parser(prog="zteam stop", description=__doc__, epilog=_EPILOG)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("robots", nargs="*", metavar="ID", help="robots, e.g. 0 or 0-2 (default: all that are there)")
    parser.add_argument("--release", action="store_true", help="release them: they go on with what they were about")
    parser.add_argument("--json", action="store_true", help="print a JSON list with an object for each robot")
    add_bus_options(parser)
    return parser


def _read(args: argparse.Namespace) -> None:
    args.robots = parse_robot_ids(args.robots, "ID") if args.robots else None


def _stop(args: argparse.Namespace) -> int:
    with open_bus(args) as bus:
        client = StopClient(bus)
        results = (client.release if args.release else client.engage)(args.robots)
    if args.json:
        print_json(results)
    else:
        for result in results:
            print_line(str(result), file=sys.stdout if result.is_done else sys.stderr)
        if any(result.confirmed for result in results) and not args.release:
            print_line(f"they stand until 'zteam stop --release' ({_ENDS_TEAM})")
    if not results:
        raise ZteamError("no robot is there: neither a robot's process nor a simulator answers (see 'zteam doctor')")
    return 0 if all(result.is_done for result in results) else 1


main = partial(run_tool, build_parser, _stop, read=_read)
