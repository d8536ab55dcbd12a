"""The output of `zteam tf tree`, `monitor` and `positions`."""

import argparse
from collections.abc import Mapping
from pathlib import Path

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.cli.listening import SURVEY, Waiter, open_bus
from zteam.cli.options import bus_options
from zteam.cli.tool_clock import open_clock, ticker
from zteam.errors import BusError, UsageError
from zteam.messages import Clock, TFMessage, ns_from_time
from zteam.services.transforms import FrameReply
from zteam.tf import Buffer, FrameInfo, TransformException
from zteam.tf.drawing import tree_as_dot, tree_as_svg
from zteam.tf.statistics import Watch
from zteam.tf.text import format_tree


class TreeListener:
    """Fills a buffer, and a watch if there is one, from the aggregator's tree."""

    def __init__(self, bus: Bus, watch: Watch | None = None) -> None:
        self.buffer = Buffer()
        self._watch = watch
        self.waiter = Waiter()
        self.now = 0
        bus.subscribe(names.CLOCK, Clock, self._on_clock)
        bus.subscribe(names.TF, TFMessage, self._on_tf)
        bus.subscribe(names.TF_STATIC, TFMessage, self._on_tf_static, latched=True)

    def _on_clock(self, _key: str, message: Clock) -> None:
        self.now = ns_from_time(message.clock)
        self.buffer.take_time(self.now)

    def _on_tf(self, _key: str, message: TFMessage) -> None:
        if self._watch is not None:
            self._watch.take(message.transforms, self.now)
        for transform in message.transforms:
            self.buffer.set_transform(transform, names.TF)
        self.waiter.notify()

    def _on_tf_static(self, _key: str, message: TFMessage) -> None:
        self.buffer.set_all_static(message.transforms, names.TF)
        self.waiter.notify()


def _ask_frames(bus: Bus) -> dict[str, FrameInfo] | None:
    """The aggregator's own data on every frame; None without an aggregator."""
    try:
        replies = bus.ask(names.service_key(names.AGGREGATOR, "frames"), dict[str, FrameReply])
    except BusError:
        return None
    return {child: FrameInfo(*msgspec.structs.astuple(frame)) for child, frame in replies.items()}


def show_tree(args: argparse.Namespace) -> int:
    """Print the tree, as text or JSON, or draw it into a file."""
    drawings = {".svg": tree_as_svg, ".dot": tree_as_dot}
    path = Path(args.output) if args.output else None
    if path is not None and path.suffix not in drawings:
        raise UsageError(f"{path}: name a .svg or .dot file")
    bus = open_bus(bus_options(args))
    try:
        listener = TreeListener(bus)
        listener.waiter.wait(lambda: False, SURVEY, "")
        # Without an aggregator, use what was received.
        frames = _ask_frames(bus) or listener.buffer.frames()
    finally:
        bus.close()
    if path is not None:
        try:
            path.write_text(drawings[path.suffix](frames, listener.now), encoding="utf-8")
        except OSError as error:
            raise UsageError(f"{path}: cannot write the tree: {error.strerror or error}") from None
        print(f"{path}: {len(frames)} frames")
    elif args.json:
        print(msgspec.json.encode({child: info._asdict() for child, info in frames.items()}).decode())
    elif not frames:
        print("no frames (is zteam-tf running? see 'zteam doctor')")
    else:
        print(format_tree(frames, listener.now))
    return 0


def show_figures(args: argparse.Namespace) -> int:
    """Print rates, delays and jitter of every moving frame, and conflicts."""
    bus = open_bus(bus_options(args))
    try:
        watch = Watch()
        TreeListener(bus, watch).waiter.wait(lambda: False, args.seconds, "")
        frames = _ask_frames(bus) or {}
        try:
            conflicts = bus.ask(names.service_key(names.AGGREGATOR, "conflicts"), list[str])
        except BusError:
            conflicts = []
    finally:
        bus.close()
    figures = watch.figures()
    if args.json:
        rows = [{**msgspec.to_builtins(f), "authority": _authority(frames, f.child)} for f in figures]
        print(msgspec.json.encode({"frames": rows, "conflicts": conflicts}).decode())
        return 0
    print(f"{'frame':34} {'authority':12} {'rate':>9} {'jitter':>9} {'delay':>9} {'max':>9}")
    for f in figures:
        cells = _cell(f.rate, "Hz"), _cell(f.jitter, "s"), _cell(f.mean_delay, "s"), _cell(f.max_delay, "s")
        print(f"{f.child:34} {_authority(frames, f.child):12} " + " ".join(f"{cell:>9}" for cell in cells))
    if not figures:
        print("no moving frame (is zteam-tf running? see 'zteam doctor')")
    for conflict in conflicts:
        print(f"conflict: {conflict}")
    return 0


def _authority(frames: Mapping[str, FrameInfo], child: str) -> str:
    return frames[child].authority if child in frames else "unknown"


def _cell(value: float | None, unit: str) -> str:
    return "-" if value is None else f"{value:.3f} {unit}"


class _Position(msgspec.Struct):
    """A robot's pose in `map`, or the reason why it is unknown."""

    robot: str
    x: float | None = None
    y: float | None = None
    yaw: float | None = None
    stamp: float | None = None
    why: str = ""


def show_positions(args: argparse.Namespace) -> int:
    """Print every robot's pose in `map`, once or at a rate."""
    bus = open_bus(bus_options(args))
    try:
        listener = TreeListener(bus)
        listener.waiter.wait(lambda: False, SURVEY, "")
        wait = None if args.rate is None else ticker(open_clock(bus, args.clock), 1.0 / args.rate)
        while True:
            rows = _find_positions(listener.buffer)
            if args.json:
                print(msgspec.json.encode(rows).decode(), flush=True)
            else:
                print("\n".join(map(_position_line, rows)) or "no robots (see 'zteam node list')", flush=True)
            if wait is None:
                return 0
            wait()
    finally:
        bus.close()


def _find_positions(buffer: Buffer) -> list[_Position]:
    """The pose of every robot that has a base; a robot without a path to `map` gets a reason instead of a pose."""
    found = []
    for child in buffer.frames():
        if names.is_robot_frame(child, names.BASE_FOOTPRINT):
            robot = child.partition("/")[0]
            try:
                pose, stamp = buffer.lookup_pose2(names.MAP_FRAME, child, 0)
                found.append(_Position(robot, pose.x, pose.y, pose.yaw, stamp / 1e9))
            except TransformException as error:
                found.append(_Position(robot, why=str(error).strip()))
    return sorted(found, key=lambda row: names.robot_id_of(row.robot) or 0)


def _position_line(row: _Position) -> str:
    if row.x is None or row.y is None or row.yaw is None or row.stamp is None:
        return f"{row.robot:10} unknown: {row.why}"
    return f"{row.robot:10} x {row.x:8.3f}  y {row.y:8.3f}  yaw {row.yaw:7.3f}  at {row.stamp:.1f} s"
