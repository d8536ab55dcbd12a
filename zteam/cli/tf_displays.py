"""The output of `zteam tf tree`, `monitor` and `positions`."""

import argparse
from collections.abc import Mapping
from contextlib import closing, suppress
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
from zteam.tf.drawing import PICTURES, draw_tree, format_tree
from zteam.tf.statistics import Watch

_ENDED = 1_000_000_000
"""Nanoseconds behind the newest frame after which a frame has no publisher any more."""
_SEE_TREE = " (see 'zteam tf tree')"


class TreeListener:
    """Fills a buffer from the aggregator's tree."""

    def __init__(self, bus: Bus) -> None:
        self.buffer = Buffer()
        self.waiter = Waiter()
        self.now = 0
        bus.subscribe(names.CLOCK, Clock, self._on_clock)
        bus.subscribe(names.TF, TFMessage, self._on_tf)
        bus.subscribe(names.TF_STATIC, TFMessage, self._on_tf_static, latched=True)

    def _on_clock(self, _key: str, message: Clock) -> None:
        self.now = ns_from_time(message.clock)
        self.buffer.take_time(self.now)

    def _on_tf(self, _key: str, message: TFMessage) -> None:
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
    with closing(open_bus(bus_options(args))) as bus:
        listener = TreeListener(bus)
        listener.waiter.wait(lambda: False, SURVEY, "")
        # Without an aggregator, use what was received.
        asked = ask_frames(bus)
        frames = asked or listener.buffer.frames()
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
    watch = Watch()
    with closing(open_bus(bus_options(args))) as bus:
        listener = TreeListener(bus)
        bus.subscribe(names.TF, TFMessage, lambda _, message: watch.take(message.transforms, listener.now))
        listener.waiter.wait(lambda: False, args.seconds, "")
        frames, conflicts = ask_frames(bus), list[str]()
        with suppress(BusError):
            conflicts = bus.ask(names.service_key(names.AGGREGATOR, "conflicts"), list[str])
    authorities = {child: info.authority for child, info in (frames or {}).items()}
    rows = [(figures, authorities.get(figures.child, "unknown")) for figures in watch.figures()]
    if args.json:
        found = [{**msgspec.to_builtins(figures), "authority": authority} for figures, authority in rows]
        print(msgspec.json.encode({"frames": found, "conflicts": conflicts}).decode())
        return 0
    header = ("frame", "authority", "rate", "jitter", "delay", "max delay")
    cells = [
        (f.child, authority, _hz(f.rate), _ms(f.jitter), _ms(f.mean_delay), _ms(f.max_delay)) for f, authority in rows
    ]
    print(format_table(header, cells, numbers_from=2) if cells else _nothing(frames is not None, "no moving frame"))
    for conflict in conflicts:
        print(f"conflict: {conflict}")
    return 0


def _hz(rate: float | None) -> str:
    return "-" if rate is None else format_rate(rate)


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
    with closing(open_bus(bus_options(args))) as bus:
        listener = TreeListener(bus)
        listener.waiter.wait(lambda: False, SURVEY, "")
        wait = None if args.rate is None else ticker(open_clock(bus, args.clock), 1.0 / args.rate)
        while True:
            found = _find_positions(listener.buffer)
            if args.json:
                print(msgspec.json.encode([position for position, _ in found]).decode(), flush=True)
            elif found:
                print("\n".join(line for _, line in found), flush=True)
            else:
                print(_nothing(ask_frames(bus) is not None, "no robots"), flush=True)
            if wait is None:
                return 0
            wait()


def _find_positions(buffer: Buffer) -> list[tuple[_Position, str]]:
    """The pose of every robot that has a base, and its line; one without a path to `map` has a reason instead."""
    found = []
    for child in buffer.frames():
        if names.is_robot_frame(child, names.BASE_FOOTPRINT):
            robot = child.partition("/")[0]
            try:
                pose, stamp = buffer.lookup_pose2(names.MAP_FRAME, child, 0)
            except TransformException as error:
                position = _Position(robot, why=str(error).strip())
                line = f"{robot:10} unknown: {position.why}"
            else:
                position = _Position(robot, *pose, stamp / 1e9)
                # Adding 0.0 turns a rounded -0.000 into 0.000.
                x, y, yaw = (round(value, 3) + 0.0 for value in pose)
                line = f"{robot:10} x {x:8.3f}  y {y:8.3f}  yaw {yaw:7.3f}  at {stamp / 1e9:.1f} s"
            found.append((position, line))
    return sorted(found, key=lambda each: names.robot_id_of(each[0].robot) or 0)
