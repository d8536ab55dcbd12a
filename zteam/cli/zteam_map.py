"""`zteam-map MAP.yaml`: serve a map without a simulator, as map_server does: on `map`, for late subscribers too."""

from functools import partial
from pathlib import Path

from zteam import names
from zteam.cli.options import Parser, add_bus_options, run_process
from zteam.node.process_options import MapOptions


def build_parser() -> Parser:
    parser = Parser(prog="zteam-map", description=__doc__)
    text = "map_server's file beside its picture: image, resolution, origin, mode, …"
    parser.add_argument("map", metavar="MAP.yaml", help=text)
    add_bus_options(parser)
    return parser


main = partial(run_process, build_parser, lambda args: (names.MAP_SERVER, lambda: MapOptions(Path(args.map))))
