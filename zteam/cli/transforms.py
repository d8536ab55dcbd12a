"""`zteam tf echo A B | tree | static`: transforms between frames, under tf's words."""

import argparse
import math
import sys
from collections.abc import Sequence

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.cli.listening import SURVEY, Waiter, open_bus
from zteam.cli.options import add_bus_options, bus_options, run
from zteam.clock import Ticker
from zteam.errors import BusError, UsageError, ZteamError
from zteam.geometry import quaternion_from_rpy
from zteam.messages import Clock, TFMessage, ns_from_time, to_json
from zteam.nodes.tf_messages import FrameReply, StaticReply, StaticRequest
from zteam.tf import Buffer, FrameInfo
from zteam.tf.text import format_transform, format_tree

_COUNTS = {8: "yaw pitch roll", 9: "qx qy qz qw"}


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = argparse.ArgumentParser(prog="zteam tf", description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="echo|tree|static")
    echo = verbs.add_parser("echo", help="print the pose of frame B in frame A")
    echo.add_argument("target", metavar="A")
    echo.add_argument("source", metavar="B")
    echo.add_argument("--once", action="store_true", help="end after one")
    echo.add_argument("--json", action="store_true")
    echo.add_argument("--rate", type=float, default=1.0, metavar="HZ", help="(default: %(default)s)")
    echo.add_argument("--timeout", type=float, metavar="S", help="fail after S seconds without the transform")
    tree = verbs.add_parser("tree", help="print the tree with rates, ages and who says so")
    tree.add_argument("--json", action="store_true")
    static = verbs.add_parser(
        "static",
        help="hold a fixed transform until Ctrl+C",
        usage="zteam tf static X Y Z YAW PITCH ROLL PARENT CHILD  (or QX QY QZ QW for the angles)",
    )
    for sub in (echo, tree, static):
        add_bus_options(sub)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    # The numbers of `static` may be negative, which argparse would take for options.
    args, rest = build_parser().parse_known_args(argv)
    if args.verb == "static":
        return run("zteam tf", args, lambda: _static(args, rest))
    if rest:
        build_parser().error(f"unrecognized arguments: {' '.join(rest)}")
    verb = _echo if args.verb == "echo" else _tree
    return run("zteam tf", args, lambda: verb(args))


class _Listener:
    """A buffer fed from the aggregator's tree."""

    def __init__(self, bus: Bus) -> None:
        self.buffer = Buffer()
        self.waiter = Waiter()
        self.now = 0
        bus.subscribe(names.CLOCK, Clock, self._on_clock)
        bus.subscribe(names.TF, TFMessage, self._on_tf)
        bus.subscribe(names.TF_STATIC, TFMessage, self._on_tf_static, latched=True)

    def _on_clock(self, _key: str, message: Clock) -> None:
        self.now = ns_from_time(message.clock)

    def _on_tf(self, _key: str, message: TFMessage) -> None:
        for transform in message.transforms:
            self.buffer.set_transform(transform, names.TF)
        self.waiter.notify()

    def _on_tf_static(self, _key: str, message: TFMessage) -> None:
        self.buffer.set_all_static(message.transforms, names.TF)
        self.waiter.notify()


def _echo(args: argparse.Namespace) -> int:
    target, source = names.strip_slash(args.target), names.strip_slash(args.source)
    if not args.rate > 0:
        raise UsageError(f"--rate {args.rate}: give transforms a second")
    bus = open_bus(bus_options(args))
    try:
        listener = _Listener(bus)

        def there() -> bool:
            return listener.buffer.can_transform(target, source, 0)[0]

        if not listener.waiter.wait(there, args.timeout, f"the transform from {source} to {target}"):
            why = listener.buffer.can_transform(target, source, 0)[1]
            raise ZteamError(f"no transform within {args.timeout:g} s: {why.strip()} (see 'zteam tf tree')")
        ticker = Ticker(1.0 / args.rate)
        while True:
            transform = listener.buffer.lookup_transform(target, source, 0)
            print(to_json(transform).decode() if args.json else format_transform(transform), flush=True)
            if args.once:
                return 0
            ticker.wait()
    finally:
        bus.close()


def _tree(args: argparse.Namespace) -> int:
    bus = open_bus(bus_options(args))
    try:
        listener = _Listener(bus)
        listener.waiter.wait(lambda: False, SURVEY, "")
        try:
            told = bus.ask(names.service_key(names.AGGREGATOR, "frames"), dict[str, FrameReply])
            frames = {child: FrameInfo(*msgspec.structs.astuple(frame)) for child, frame in told.items()}
        except BusError:
            # Without an aggregator's own word, what was heard has to do.
            frames = listener.buffer.frames()
    finally:
        bus.close()
    if args.json:
        print(msgspec.json.encode({child: info._asdict() for child, info in frames.items()}).decode())
    elif not frames:
        print("no frames (is zteam-tf running? see 'zteam doctor')")
    else:
        print(format_tree(frames, listener.now))
    return 0


def parse_static(words: Sequence[str], instance: str) -> StaticRequest:
    """X Y Z YAW PITCH ROLL PARENT CHILD, or with a quaternion; ROS 1's period at the end is taken and ignored."""
    values = list(words)
    if len(values) in {9, 10} and _is_number(values[-1]) and not _is_number(values[-2]):
        values.pop()
    if len(values) not in _COUNTS or not all(map(_is_number, values[:-2])):
        raise UsageError(
            "give X Y Z YAW PITCH ROLL PARENT CHILD or X Y Z QX QY QZ QW PARENT CHILD, "
            "e.g. zteam tf static 0.1 0 0.2 0 0 0 robot_0/base_link robot_0/camera"
        )
    x, y, z, *angles = map(float, values[:-2])
    if len(angles) == 3:
        yaw, pitch, roll = angles
        angles = list(quaternion_from_rpy(roll, pitch, yaw))
    parent, child = (names.strip_slash(name) for name in values[-2:])
    return StaticRequest(parent, child, instance, x, y, z, *angles)


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _hold(bus: Bus, request: StaticRequest) -> None:
    """Ask every aggregator that comes: a restarted one knows nothing of what its predecessor was asked for."""
    waiter, aggregators, told = Waiter(), set[str](), set[str]()

    def on_token(key: str, alive: bool) -> None:
        (aggregators.add if alive else aggregators.discard)(key)
        if not alive:
            told.discard(key)
        waiter.notify()

    bus.watch_tokens([names.tokens_key(names.AGGREGATOR)], on_token)
    while True:
        waiter.wait(lambda: bool(aggregators - told), None, "the aggregator (zteam-tf)" if not told else "")
        fresh = aggregators - told
        reply = bus.ask(names.service_key(names.AGGREGATOR, "static"), StaticReply, request)
        if reply.refused:
            raise ZteamError(f"refused: {reply.refused}")
        told.update(fresh)
        print(f"{request.parent} -> {request.child} holds until Ctrl+C", flush=True)


def _static(args: argparse.Namespace, words: Sequence[str]) -> int:
    request = parse_static(words, "")
    bus = open_bus(bus_options(args))
    try:
        request.instance = bus.instance
        bus.declare_token(names.token_key(names.STATIC_CALLER, bus.instance))
        _hold(bus, request)
    except KeyboardInterrupt:
        return 0
    finally:
        bus.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
