"""The output of `zteam tf tree`, `monitor` and `positions`."""

import argparse
from collections.abc import Mapping
from pathlib import Path

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.cli.listening import SURVEY, Waiter, near_keys, open_bus
from zteam.cli.options import bus_options
from zteam.cli.tables import format_table
from zteam.cli.tool_clock import open_clock, ticker
from zteam.errors import BusError, ZteamError
from zteam.messages import Clock, TFMessage, TransformStamped, ns_from_time
from zteam.numbers import counted, format_rate
from zteam.services.transforms import TransformClient
from zteam.tf import Buffer, FrameInfo, TransformException
from zteam.tf.drawing import PICTURES, draw_tree
from zteam.tf.statistics import FrameFigures, Watch
from zteam.tf.text import format_tree

_ENDED = 1_000_000_000
"""Nanoseconds behind the newest frame after which a frame has no publisher any more."""
_SEE_TREE = " (see 'zteam tf tree')"


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
        self.buffer.set_transforms(message.transforms, names.TF)
        self.waiter.notify()

    def _on_tf_static(self, _key: str, message: TFMessage) -> None:
        self.buffer.set_all_static(message.transforms, names.TF)
        self.waiter.notify()


NO_AGGREGATOR = "no aggregator runs: start one with 'zteam-tf' (a team of 'zteam up' has one)"


def ask_frames(bus: Bus) -> dict[str, FrameInfo] | None:
    """The aggregator's own data on every frame; None without an aggregator."""
    try:
        return bus.ask(names.service_key(names.AGGREGATOR, "frames"), dict[str, FrameInfo])
    except BusError:
        return None


def find_last(bus: Bus, target: str, source: str) -> TransformStamped | str:
    """The aggregator's newest transform between two frames.

    Without one, why: no aggregator, a frame that no process publishes, two trees, or a publisher that has ended.
    """
    frames = ask_frames(bus)
    if frames is None:
        return NO_AGGREGATOR
    known = _names(frames)
    missing = [frame for frame in (target, source) if frame not in known]
    if missing:
        return "; ".join(f"frame {frame!r} does not exist{near_keys(frame, known)}" for frame in missing) + _SEE_TREE
    try:
        return TransformClient(bus).lookup_transform(target, source)
    except (TransformException, BusError) as error:
        return (_ended(frames, target, source) or str(error).strip()) + _SEE_TREE


def _ended(frames: Mapping[str, FrameInfo], *ends: str) -> str:
    """The frame above these that is far behind the newest one of the tree, in words; empty if there is none."""
    above = set(ends)
    for end in ends:
        while end in frames:
            end = frames[end].parent
            above.add(end)
    moving = [(info.newest, child) for child, info in frames.items() if child in above and not info.static]
    newest = max((info.newest for info in frames.values()), default=0)
    stamp, child = min(moving, default=(newest, ""))
    if newest - stamp < _ENDED:
        return ""
    text = f"{child} was said last at {stamp / 1e9:.3f} s, {(newest - stamp) / 1e9:.1f} s before the newest frame"
    return f"{text}: its publisher ({frames[child].authority}) has ended"


def _names(frames: Mapping[str, FrameInfo]) -> set[str]:
    """The frames of a tree, its roots included."""
    return {*frames, *(info.parent for info in frames.values())}


def show_tree(args: argparse.Namespace) -> int:
    """Print the tree, as text or JSON, or draw it into a file."""
    path = Path(args.output) if args.output else None
    if path is not None and path.suffix.lower() not in PICTURES:
        args.parser.error(f"--output {path}: name a {', '.join(PICTURES[:-1])} or {PICTURES[-1]} file")
    bus = open_bus(bus_options(args))
    try:
        listener = TreeListener(bus)
        listener.waiter.wait(lambda: False, SURVEY, "")
        # Without an aggregator, use what was received.
        asked = ask_frames(bus)
        frames = asked or listener.buffer.frames()
    finally:
        bus.close()
    if path is not None:
        if not frames:
            raise ZteamError(_nothing(asked is not None, "no frames to draw"))
        draw_tree(frames, listener.now, path)
        print(f"{path}: {counted(len(_names(frames)), 'frame')}")
    elif args.json:
        print(msgspec.json.encode(frames).decode())
    elif not frames:
        print(_nothing(asked is not None, "no frames yet"))
    else:
        print(format_tree(frames, listener.now))
    return 0


def show_figures(args: argparse.Namespace) -> int:
    """Print rates, delays and jitter of every moving frame, and conflicts."""
    bus = open_bus(bus_options(args))
    try:
        watch = Watch()
        TreeListener(bus, watch).waiter.wait(lambda: False, args.seconds, "")
        asked = ask_frames(bus)
        frames = asked or {}
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
    header = ("frame", "authority", "rate", "jitter", "delay", "max delay")
    cells = [(f.child, _authority(frames, f.child), *_figures_text(f)) for f in figures]
    print(format_table(header, cells, numbers_from=2) if cells else _nothing(asked is not None, "no moving frame"))
    for conflict in conflicts:
        print(f"conflict: {conflict}")
    return 0


def _figures_text(figures: FrameFigures) -> tuple[str, ...]:
    rate = "-" if figures.rate is None else format_rate(figures.rate)
    return rate, _ms(figures.jitter), _ms(figures.mean_delay), _ms(figures.max_delay)


def _authority(frames: Mapping[str, FrameInfo], child: str) -> str:
    return frames[child].authority if child in frames else "unknown"


def _ms(seconds: float | None) -> str:
    return "-" if seconds is None else f"{seconds * 1e3:.1f} ms"


def _nothing(has_aggregator: bool, text: str) -> str:
    return f"{text} (see 'zteam doctor')" if has_aggregator else NO_AGGREGATOR


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
                none = "" if rows else _nothing(ask_frames(bus) is not None, "no robots")
                print("\n".join(map(_position_line, rows)) or none, flush=True)
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
    # Adding 0.0 turns a rounded -0.000 into 0.000.
    x, y, yaw = (round(value, 3) + 0.0 for value in (row.x, row.y, row.yaw))
    return f"{row.robot:10} x {x:8.3f}  y {y:8.3f}  yaw {yaw:7.3f}  at {row.stamp:.1f} s"
