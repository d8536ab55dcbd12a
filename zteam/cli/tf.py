"""`zteam tf echo A B | tree | monitor | positions | static`: show and set transforms between frames."""

import argparse
import sys
from collections.abc import Sequence

from zteam import names
from zteam.bus import Bus
from zteam.cli.arguments import MAX_RATE, negative_numbers, number
from zteam.cli.interrupts import leave
from zteam.cli.listening import SURVEY, add_timeout, limit_of, open_bus
from zteam.cli.options import Parser, add_bus_options, add_clock_option, bus_options, run
from zteam.cli.tf_displays import (
    NO_AGGREGATOR,
    TreeListener,
    ask_frames,
    find_last,
    show_figures,
    show_positions,
    show_tree,
)
from zteam.cli.tf_static import hold_static
from zteam.cli.tool_clock import open_clock, ticker
from zteam.errors import BusError, ZteamError
from zteam.messages import TransformStamped, to_json
from zteam.numbers import MAX_SECONDS
from zteam.services.transforms import TransformClient
from zteam.tf.text import format_transform

_MAX_STAMP = 4e9
"""Seconds: stamps of the host's clock count from 1970, now 1.8e9."""


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="zteam tf", description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="echo|tree|monitor|positions|static")
    echo = verbs.add_parser("echo", help="print the pose of frame B in frame A")
    tree = verbs.add_parser("tree", help="print or draw the tree: authority, rate and age of every frame")
    monitor = verbs.add_parser("monitor", help="measure rate, delay and jitter of every frame, and list conflicts")
    positions = verbs.add_parser("positions", help="print every robot's pose in map")
    static = verbs.add_parser(
        "static",
        help="hold a fixed transform until Ctrl+C",
        usage="zteam tf static X Y Z YAW PITCH ROLL PARENT CHILD (or QX QY QZ QW for the angles)",
    )
    static.add_argument("words", nargs="*", default=[], help="metres and radians, then the two frames")
    _add_echo_options(echo)
    tree.add_argument("-o", "--output", metavar="FILE.svg|png|pdf|dot", help="draw it; frames older than 1 s are red")
    monitor.add_argument(
        "--for",
        dest="seconds",
        type=number(0.01, MAX_SECONDS, "host seconds"),
        default=5.0,
        metavar="S",
        help="measure for S host seconds (default: %(default)s)",
    )
    often = positions.add_mutually_exclusive_group()
    often.add_argument("--once", action="store_true", help="print once (the default)")
    often.add_argument(
        "--rate", type=number(1e-3, MAX_RATE, "positions a second"), metavar="HZ", help="repeat until Ctrl+C"
    )
    for sub in (echo, tree, monitor, positions):
        sub.add_argument("--json", action="store_true", help="print JSON")
    for sub in (echo, positions):
        add_clock_option(sub)
    for sub in (echo, tree, monitor, positions, static):
        add_bus_options(sub)
    return parser


def _add_echo_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("target", metavar="A", help="target frame")
    parser.add_argument("source", metavar="B", help="source frame")
    parser.add_argument("--once", action="store_true", help="end after one transform")
    parser.add_argument(
        "--rate",
        type=number(1e-3, MAX_RATE, "transforms a second"),
        default=1.0,
        metavar="HZ",
        help="print at this rate (default: %(default)s)",
    )
    parser.add_argument(
        "--at",
        type=number(0.0, _MAX_STAMP, "seconds"),
        metavar="S",
        help="print the transform at S seconds of the team's clock, then end",
    )
    add_timeout(parser, "the transform")


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(negative_numbers(sys.argv[1:] if argv is None else argv))
    verbs = {
        "echo": _echo,
        "tree": show_tree,
        "monitor": show_figures,
        "positions": show_positions,
        "static": hold_static,
    }
    return run("zteam tf", args, lambda: verbs[args.verb](args))


def _echo(args: argparse.Namespace) -> int:
    target, source = names.strip_slash(args.target), names.strip_slash(args.source)
    (limit, quiet), bus = limit_of(args), open_bus(bus_options(args))
    try:
        if args.at is not None:
            # Ask the aggregator for the past: this process has received nothing of it.
            at = _ask_past(bus, target, source, args)
            print(to_json(at).decode() if args.json else format_transform(at))
            return 0
        listener = TreeListener(bus)

        def is_known() -> bool:
            return listener.buffer.can_transform(target, source, 0)[0]

        if not listener.waiter.wait(is_known, SURVEY if limit is None else min(SURVEY, limit), ""):
            # Of a publisher that has ended, the aggregator still knows the last transform.
            last = find_last(bus, target, source)
            if isinstance(last, TransformStamped):
                print(to_json(last).decode() if args.json else format_transform(last), flush=True)
                if args.once:
                    return 0
                last = "nothing newer has come"
            if not quiet and (limit is None or limit > SURVEY):
                print(f"{last} (waiting for it; Ctrl+C to give up)", file=sys.stderr, flush=True)
            if not listener.waiter.wait(is_known, None if limit is None else max(0.0, limit - SURVEY), ""):
                raise ZteamError(f"no transform within {limit:g} s: {last}")
        wait = None if args.once else ticker(open_clock(bus, args.clock), 1.0 / args.rate)
        while True:
            transform = listener.buffer.lookup_transform(target, source, 0)
            print(to_json(transform).decode() if args.json else format_transform(transform), flush=True)
            if wait is None:
                return 0
            wait()
    finally:
        bus.close()


def _ask_past(bus: Bus, target: str, source: str, args: argparse.Namespace) -> TransformStamped:
    try:
        return TransformClient(bus).lookup_transform(target, source, round(args.at * 1e9), args.timeout or 0.0)
    except BusError:
        if ask_frames(bus) is None:
            raise ZteamError(NO_AGGREGATOR) from None
        raise


if __name__ == "__main__":
    leave(main())
