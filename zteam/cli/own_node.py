"""A node of the user's own, given as `module:function`: the `team` fixture starts it."""

import argparse
from functools import partial

from zteam.cli.interrupts import leave
from zteam.cli.options import Parser, add_bus_options, run_process
from zteam.node.process_options import NodeOptions


def build_parser() -> Parser:
    """The command line."""
    parser = Parser(prog="zteam-node", description=__doc__)
    parser.add_argument("name", help="its name on the bus")
    parser.add_argument("body", metavar="MODULE:FUNCTION", help="the function of the node, as for zteam.run")
    add_bus_options(parser)
    return parser


def _read(args: argparse.Namespace) -> "tuple[str, partial[NodeOptions]]":
    return args.name, partial(NodeOptions, args.name, args.body)


main = partial(run_process, "zteam-node", NodeOptions, build_parser, _read)

if __name__ == "__main__":
    leave(main())
