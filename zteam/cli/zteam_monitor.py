"""`zteam-monitor --team-size N`: run the start gate ("All robots GO!") and watch the team's health; with a monitor
running already, show that one's team."""

import argparse
from collections.abc import Callable, Sequence
from functools import partial

from zteam import names
from zteam.cli.arguments import add_go_timeout_option, add_option, add_options, read_options
from zteam.cli.options import Parser, add_bus_options, add_clock_option, run_process
from zteam.config.robot_ids import parse_robot_ids
from zteam.errors import UsageError
from zteam.node.process_options import MonitorOptions


def build_parser() -> Parser:
    parser = Parser(prog="zteam-monitor", description=__doc__)
    sizes = (1, names.MAX_ROBOT_ID + 1, "a whole number")
    add_option(parser, "--team-size", typed=sizes, metavar="N", help="wait for this many robots")
    parser.add_argument("--ids", nargs="+", metavar="ID", help="wait for these robots, e.g. --ids 0 1 2 3, --ids 0-3")
    add_options(parser, MonitorOptions)
    add_go_timeout_option(parser)
    add_clock_option(parser)
    add_bus_options(parser)
    return parser


def parse_team(size: int | None, ids: Sequence[str] | None) -> tuple[int, tuple[int, ...] | None]:
    """(team size, ids or None) of `--team-size` and `--ids`; size 0 without either: look at the monitor that runs.

    Raises UsageError if they contradict each other.
    """
    chosen = None if ids is None else parse_robot_ids(ids, "--ids")
    if size is None:
        return (0, None) if chosen is None else (len(chosen), chosen)
    if chosen is not None and len(chosen) != size:
        raise UsageError(f"--team-size {size} and --ids with {len(chosen)} robots disagree: leave one out")
    return size, chosen


def _read(args: argparse.Namespace) -> tuple[str, Callable[[], MonitorOptions]]:
    team_size, ids = parse_team(args.team_size, args.ids)
    if args.in_world and ids is None:
        raise UsageError("--in-world needs --ids")
    options = read_options(MonitorOptions, args, team_size=team_size, ids=ids)
    return names.MONITOR, lambda: options


main = partial(run_process, build_parser, _read, needs_output=False)
