"""`zteam-map MAP.yaml`: serve a map without a simulator, as map_server does: on `map`, for late subscribers too."""

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path

from zteam import names
from zteam.cli.options import Parser, add_bus_options, run_process
from zteam.node.process_options import MapOptions


def build_parser() -> Parser:
    """The command line."""
    parser = Parser(prog="zteam-map", description=__doc__)
    parser.add_argument(
        "map", metavar="MAP.yaml", help="map_server's file beside its picture: image, resolution, origin, mode, …"
    )
    add_bus_options(parser)
    return parser


def _read(args: argparse.Namespace) -> tuple[str, Callable[[], MapOptions]]:
    return names.MAP_SERVER, lambda: MapOptions(Path(args.map))


main = partial(run_process, build_parser, _read)
