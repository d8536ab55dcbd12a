"""`zteam tf echo A B | tree | monitor | positions | static`: show and set transforms between frames."""

import argparse
import sys
from collections.abc import Sequence

from zteam import names
from zteam.bus import Bus
from zteam.cli.arguments import MAX_RATE, negative_numbers, number
from zteam.cli.listening import Waiter, open_bus
from zteam.cli.options import Parser, add_bus_options, add_clock_option, bus_options, run
from zteam.cli.tf_displays import TreeListener, show_figures, show_positions, show_tree
from zteam.cli.tool_clock import open_clock, ticker
from zteam.errors import UsageError, ZteamError
from zteam.geometry import quaternion_from_rpy
from zteam.messages import to_json
from zteam.numbers import MAX_SECONDS, is_number
from zteam.services.transforms import MAX_COORDINATE, StaticReply, StaticRequest
from zteam.services.transforms_client import TransformClient
from zteam.tf.text import format_transform

_MAX_STAMP = 4e9
"""Seconds: stamps of the host's clock count from 1970, now 1.8e9."""
_COUNTS = {8: "yaw pitch roll", 9: "qx qy qz qw"}


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
    tree.add_argument("-o", "--output", metavar="FILE.svg|dot", help="draw it; frames older than 1 s are red")
    monitor.add_argument(
        "--for",
        dest="seconds",
        type=number(0.01, MAX_SECONDS, "host seconds"),
        default=5.0,
        metavar="S",
        help="measure for S host seconds (default: %(default)s)",
    )
    positions.add_argument(
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
    parser.add_argument(
        "--timeout",
        type=number(0.0, MAX_SECONDS, "host seconds"),
        metavar="S",
        help="fail after S host seconds without the transform",
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(negative_numbers(sys.argv[1:] if argv is None else argv))
    verbs = {
        "echo": _echo,
        "tree": show_tree,
        "monitor": show_figures,
        "positions": show_positions,
        "static": _static,
    }
    return run("zteam tf", args, lambda: verbs[args.verb](args))


def _echo(args: argparse.Namespace) -> int:
    target, source = names.strip_slash(args.target), names.strip_slash(args.source)
    bus = open_bus(bus_options(args))
    try:
        if args.at is not None:
            # Ask the aggregator for the past: this process has received nothing of it.
            at = TransformClient(bus).lookup_transform(target, source, round(args.at * 1e9), args.timeout or 0.0)
            print(to_json(at).decode() if args.json else format_transform(at))
            return 0
        listener = TreeListener(bus)

        def is_known() -> bool:
            return listener.buffer.can_transform(target, source, 0)[0]

        if not listener.waiter.wait(is_known, args.timeout, f"the transform from {source} to {target}"):
            why = listener.buffer.can_transform(target, source, 0)[1]
            raise ZteamError(f"no transform within {args.timeout:g} s: {why.strip()} (see 'zteam tf tree')")
        wait = None if args.once else ticker(open_clock(bus, args.clock), 1.0 / args.rate)
        while True:
            transform = listener.buffer.lookup_transform(target, source, 0)
            print(to_json(transform).decode() if args.json else format_transform(transform), flush=True)
            if wait is None:
                return 0
            wait()
    finally:
        bus.close()


def parse_static(words: Sequence[str], caller: str) -> StaticRequest:
    """The request of X Y Z YAW PITCH ROLL PARENT CHILD or X Y Z QX QY QZ QW PARENT CHILD. Raises UsageError.

    A publish period at the end, as in ROS 1, is accepted and ignored.
    """
    values = list(words)
    if len(values) in {9, 10} and _is_coordinate(values[-1]) and not _is_coordinate(values[-2]):
        values.pop()
    if len(values) not in _COUNTS or not all(map(_is_coordinate, values[:-2])):
        raise UsageError(
            "give X Y Z YAW PITCH ROLL PARENT CHILD or X Y Z QX QY QZ QW PARENT CHILD, "
            "e.g. zteam tf static 0.1 0 0.2 0 0 0 robot_0/base_link robot_0/camera"
        )
    x, y, z, *angles = map(float, values[:-2])
    if len(angles) == 3:
        yaw, pitch, roll = angles
        angles = list(quaternion_from_rpy(roll, pitch, yaw))
    parent, child = (names.strip_slash(name) for name in values[-2:])
    return StaticRequest(parent, child, caller, x, y, z, *angles)


def _is_coordinate(text: str) -> bool:
    return is_number(text, MAX_COORDINATE)


def _hold(bus: Bus, request: StaticRequest) -> None:
    """Send the request to every aggregator that appears: one that was restarted has lost earlier requests."""
    waiter, aggregators, asked = Waiter(), set[str](), set[str]()

    def on_token(key: str, alive: bool) -> None:
        (aggregators.add if alive else aggregators.discard)(key)
        if not alive:
            asked.discard(key)
        waiter.notify()

    bus.watch_tokens([names.tokens_key(names.AGGREGATOR)], on_token)
    while True:
        waiter.wait(lambda: bool(aggregators - asked), None, "the aggregator (zteam-tf)" if not asked else "")
        fresh = aggregators - asked
        reply = bus.ask(names.service_key(names.AGGREGATOR, "static"), StaticReply, request)
        if reply.refused:
            raise ZteamError(f"refused: {reply.refused}")
        asked.update(fresh)
        print(f"{request.parent} -> {request.child} holds until Ctrl+C", flush=True)


def _static(args: argparse.Namespace) -> int:
    request = parse_static(args.words, "")
    bus = open_bus(bus_options(args))
    try:
        request.caller = bus.instance
        bus.declare_token(names.token_key(names.STATIC_CALLER, bus.instance))
        _hold(bus, request)
    except KeyboardInterrupt:
        return 0
    finally:
        bus.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
