"""`zteam-tf [TEAM.toml]`: merge every robot's transforms into one tree on `tf` and `tf_static`."""

import argparse
from functools import partial
from pathlib import Path

import msgspec

from zteam import names
from zteam.cli.arguments import add_options
from zteam.cli.options import Parser, add_bus_options, add_clock_option, run_process
from zteam.node.process_options import AggregatorOptions


def build_parser() -> argparse.ArgumentParser:
    parser = Parser(prog="zteam-tf", description=__doc__)
    parser.add_argument(
        "team", nargs="?", metavar="TEAM.toml", help="read static transforms and robot descriptions from this team file"
    )
    parser.add_argument("arguments", nargs="*", metavar="NAME=VALUE", help="arguments of the team file")
    add_options(parser, AggregatorOptions)
    add_clock_option(parser)
    add_bus_options(parser)
    return parser


def _options(args: argparse.Namespace) -> AggregatorOptions:
    """What the command line and the team file say. Raises UsageError and ConfigError."""
    from zteam.team.file.reading import load_team
    from zteam.team.file.sources import parse_arguments
    from zteam.team.launch.plan import aggregator_options

    if not args.team:
        return AggregatorOptions(rate=args.rate)
    team = load_team(Path(args.team), parse_arguments(args.arguments))
    return msgspec.structs.replace(aggregator_options(team, Path(args.team).parent), rate=args.rate)


main = partial(run_process, build_parser, lambda args: (names.AGGREGATOR, partial(_options, args)))
