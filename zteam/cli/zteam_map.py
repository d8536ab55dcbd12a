"""`zteam-map MAP.yaml`: serve a map without a simulator, as map_server does: on `map`, for late subscribers too."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from zteam import names
from zteam.cli.interrupts import leave
from zteam.cli.options import Parser, add_bus_options, bus_options, run


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="zteam-map", description=__doc__)
    parser.add_argument(
        "map", metavar="MAP.yaml", help="map_server's file beside its picture: image, resolution, origin, mode, …"
    )
    add_bus_options(parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(argv)
    return run(names.MAP_SERVER, args, lambda: _serve(args))


def _serve(args: argparse.Namespace) -> int:
    from zteam.nodes.map_server.node import run_map_server
    from zteam.planning.map_files import read_map
    from zteam.runtime.node import Node
    from zteam.runtime.process import run_node

    # A mistake in the file is told before anything is opened.
    grid = read_map(Path(args.map))

    def body(node: Node) -> None:
        run_map_server(node, grid, args.map)

    return run_node(names.MAP_SERVER, bus_options(args), body, "wall")


if __name__ == "__main__":
    leave(main())
