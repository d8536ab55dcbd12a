"""`zteam map save FILE`: write the map that is on the bus as files of map_server, as map_saver does."""

import argparse
from functools import partial
from pathlib import Path
from typing import get_args

from zteam import names
from zteam.cli.listening import Waiter, check_key, open_bus, wait_for_message
from zteam.cli.options import Parser, add_bus_options, add_option, run_tool
from zteam.config.map_files import Mode
from zteam.config.numbers import MAX_SECONDS
from zteam.errors import UsageError, ZteamError
from zteam.messages import OccupancyGrid
from zteam.navigation.planning.maps import map_grid, to_three_values, write_map
from zteam.node.output import print_line


def build_parser() -> Parser:
    parser = Parser(prog="zteam map", description=__doc__)
    save = parser.add_verb("save", _save, "write the map that is on the bus to a file", add_bus_options)
    save.add_argument("file", metavar="FILE", help="the YAML file, with or without .yaml; the picture is put beside it")
    share = (0.0, 1.0, "a share")
    add_option(save, "--free", typed=share, default=0.25, metavar="SHARE", help="free up to this occupancy")
    add_option(save, "--occupied", typed=share, default=0.65, metavar="SHARE", help="occupied from this occupancy on")
    text = "trinary keeps free, occupied and unknown; scale and raw keep each value"
    add_option(save, "--mode", choices=get_args(Mode), default="trinary", help=text)
    save.add_argument("--fmt", choices=("pgm", "png"), help="of the picture (default: pgm; png in mode scale)")
    text = "save this grid, such as robot_1/global_costmap/costmap"
    save.add_argument("--topic", default=names.MAP, metavar="KEY", help=text)
    text = "give up without a map (default: wait)"
    add_option(save, "--timeout", typed=(1e-3, MAX_SECONDS, "host seconds"), metavar="SECONDS", help=text)
    save.set_defaults(once=False)
    return parser


def _read(args: argparse.Namespace) -> None:
    if args.free >= args.occupied:
        raise UsageError(f"--free {args.free:g}, --occupied {args.occupied:g}: the first is to be below the second")
    if args.mode == "scale" and args.fmt == "pgm":
        raise UsageError("--mode scale marks unknown cells by transparency: leave --fmt pgm out")


def _save(args: argparse.Namespace) -> None:
    key, path = check_key(args.topic), Path(args.file)
    if path.suffix not in (".yaml", ".yml"):
        path = path.with_name(f"{path.name}.yaml")
    waiter = Waiter()
    with open_bus(args) as bus:
        bus.subscribe(key, OccupancyGrid, waiter.receive, latched=True)
        try:
            wait_for_message(bus, waiter, lambda: bool(waiter.received), args, key, "map")
        except ZteamError as error:
            raise ZteamError(f"{error}; start zteam-sim WORLD or zteam-map MAP.yaml") from None
    grid = map_grid(waiter.received[-1], any_frame=key != names.MAP)
    if args.mode == "trinary":
        grid = to_three_values(grid, args.free, args.occupied)
    written = write_map(grid, path, mode=args.mode, suffix=f".{args.fmt}" if args.fmt else None)
    frame = grid.frame
    print_line(f"{frame.columns} x {frame.rows} cells of {frame.resolution:g} m: {', '.join(map(str, written))}")


main = partial(run_tool, build_parser, None, read=_read)
