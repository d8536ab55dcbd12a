"""`zteam node list`: list the processes that are alive, their hosts and their uptimes."""

import argparse
from functools import partial

from zteam.bus.graph import find_nodes
from zteam.bus.presence import ProcessInfo
from zteam.cli.listening import open_bus
from zteam.cli.options import Parser, add_bus_options, add_json, run_tool
from zteam.cli.tables import duration_text, format_table
from zteam.node.output import print_block, print_json


def build_parser() -> Parser:
    parser = Parser(prog="zteam node", description=__doc__)
    parser.add_verb("list", _list, "list the processes that are alive", add_json, add_bus_options)
    return parser


def _list(args: argparse.Namespace) -> None:
    with open_bus(args) as bus:
        found = find_nodes(bus)
    table = format_table(("process", "host", "pid", "up", "zteam"), list(map(_cells, found)))
    print_json(found) if args.json else print_block(table if found else "no processes (start a team with 'zteam up')")


def _cells(info: ProcessInfo) -> tuple[str, ...]:
    known = (str(info.pid), duration_text(max(0.0, info.age)), info.version) if info.pid else ("-", "-", "-")
    return info.name, info.host, *known


main = partial(run_tool, build_parser, None)
