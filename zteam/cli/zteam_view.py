"""`zteam view`: see the team in a browser, and drive it with the mouse (docs/view.md)."""

import argparse
from functools import partial

from zteam import names
from zteam.cli.arguments import add_options, read_options
from zteam.cli.options import Parser, add_bus_options, run_process
from zteam.node.process_options import DEFAULT_FOXGLOVE_PORT, ViewOptions


def build_parser() -> Parser:
    parser = Parser(prog="zteam view", description=__doc__)
    parser.add_argument("--foxglove", action="store_true", help="show the team to Foxglove and Lichtblick too")
    add_options(parser, ViewOptions.from_environment())
    parser.set_defaults(foxglove_port=DEFAULT_FOXGLOVE_PORT)
    # What a test waits for.
    parser.add_argument("--name", default="", help=argparse.SUPPRESS)
    add_bus_options(parser)
    return parser


def _options(args: argparse.Namespace) -> ViewOptions:
    return read_options(ViewOptions, args, foxglove_port=args.foxglove_port if args.foxglove else None)


main = partial(run_process, build_parser, lambda args: (names.VIEW, partial(_options, args)), needs_output=False)
