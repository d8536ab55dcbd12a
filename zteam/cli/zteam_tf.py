"""`zteam-tf [TEAM.toml]`: merge every robot's transforms into one tree on `tf` and `tf_static`."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from zteam import names
from zteam.cli.arguments import MAX_RATE, number
from zteam.cli.interrupts import leave
from zteam.cli.options import Parser, add_bus_options, add_clock_option, bus_options, run


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="zteam-tf", description=__doc__)
    parser.add_argument(
        "team", nargs="?", metavar="TEAM.toml", help="read static transforms and robot descriptions from this team file"
    )
    parser.add_argument("arguments", nargs="*", metavar="NAME=VALUE", help="arguments of the team file")
    parser.add_argument(
        "--rate",
        type=number(1e-3, MAX_RATE, "bundles a second"),
        metavar="HZ",
        help="publish at this rate (default: once per tick)",
    )
    add_clock_option(parser)
    add_bus_options(parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(argv)
    return run(names.AGGREGATOR, args, lambda: _aggregate(args))


def _aggregate(args: argparse.Namespace) -> int:
    from zteam.nodes.transforms.node import run_aggregator
    from zteam.runtime.node import Node
    from zteam.runtime.process import run_node
    from zteam.team_file import load_team, parse_arguments, static_transform
    from zteam.tf.urdf import read_description

    team = load_team(Path(args.team), parse_arguments(args.arguments)) if args.team else None
    configured = [static_transform(entry) for entry in team.static_transforms] if team else []
    described = {robot.id: robot.description for robot in team.robots if robot.description} if team else {}
    descriptions = {robot_id: read_description(Path(args.team).parent / name) for robot_id, name in described.items()}

    def body(node: Node) -> None:
        run_aggregator(node, configured, descriptions, args.rate)

    return run_node(names.AGGREGATOR, bus_options(args, small=True), body, args.clock)


if __name__ == "__main__":
    leave(main())
