"""`zteam tf echo A B | tree | monitor | positions | static`: show and set transforms between frames."""

import argparse
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from zteam import names
from zteam.bus import Bus
from zteam.bus.graph import SURVEY, near_keys
from zteam.cli.listening import Waiter, add_timeout, limit_of, open_bus
from zteam.cli.options import (
    MAX_RATE,
    Parser,
    add_bus_options,
    add_clock_option,
    add_json,
    add_option,
    checked,
    run_tool,
)
from zteam.cli.tables import format_table, in_ms
from zteam.cli.tool_clock import open_clock, ticker
from zteam.clock import pause
from zteam.config.numbers import MAX_SECONDS, counted, format_rate, parse_number
from zteam.config.problems import problems_of
from zteam.errors import BusError, UsageError, ZteamError
from zteam.geometry import yaw_from_quaternion
from zteam.messages import TFMessage, TransformStamped, ns_from_time, to_json
from zteam.node.output import print_block, print_json, print_line
from zteam.transforms import FrameInfo, TransformException
from zteam.transforms.client import (
    MAX_COORDINATE,
    StaticReply,
    StaticRequest,
    TransformClient,
    TreeListener,
    find_frames,
)
from zteam.transforms.drawing import PICTURES, draw_tree, format_transform, format_tree
from zteam.transforms.rigid import floats_of
from zteam.transforms.statistics import TransformWatch

NO_AGGREGATOR = "no aggregator runs: start one with 'zteam-tf' (a team of 'zteam up' has one)"
_SEE_TREE = " (see 'zteam tf tree')"
_MAX_STAMP = 4e9
"""Seconds: stamps of the host's clock count from 1970, now 1.8e9."""


def build_parser() -> Parser:
    parser = Parser(prog="zteam tf", description=__doc__)
    shared = add_json, add_bus_options
    echo = parser.add_verb("echo", _echo, "print the pose of frame B in frame A", *shared)
    echo.add_argument("target", metavar="A", help="target frame")
    echo.add_argument("source", metavar="B", help="source frame")
    echo.add_argument("--once", action="store_true", help="end after one transform")
    rate = (1e-3, MAX_RATE, "transforms a second")
    add_option(echo, "--rate", typed=rate, default=1.0, metavar="HZ", help="print at this rate")
    text = "print the transform at S seconds of the team's clock, then end"
    add_option(echo, "--at", typed=(0.0, _MAX_STAMP, "seconds"), metavar="S", help=text)
    add_timeout(echo, "the transform")
    text = "print or draw the tree: authority, rate and age of every frame"
    tree = parser.add_verb("tree", _show_tree, text, *shared)
    tree.add_argument("-o", "--output", metavar="FILE.svg|png|pdf|dot", help="draw it; frames older than 1 s are red")
    text = "measure rate, delay and jitter of every frame, and list conflicts"
    monitor, seconds = parser.add_verb("monitor", _show_figures, text, *shared), (0.01, MAX_SECONDS, "host seconds")
    text = "measure for S host seconds"
    add_option(monitor, "--for", dest="seconds", typed=seconds, default=5.0, metavar="S", help=text)
    positions = parser.add_verb("positions", _show_positions, "print every robot's pose in map", *shared)
    rate, text = (1e-3, MAX_RATE, "positions a second"), "repeat until Ctrl+C (default: print once)"
    add_option(positions, "--rate", typed=rate, metavar="HZ", help=text)
    static = parser.add_verb("static", _hold_static, "hold a fixed transform until Ctrl+C", add_bus_options)
    static.usage = "zteam tf static X Y Z YAW PITCH ROLL PARENT CHILD (or QX QY QZ QW for the angles)"
    static.add_argument("words", nargs="*", default=[], help="metres and radians, then the two frames")
    for sub in (echo, positions):
        add_clock_option(sub)
    return parser


def _echo(args: argparse.Namespace) -> None:
    target, source = names.strip_slash(args.target), names.strip_slash(args.source)
    limit = limit_of(args)

    def show(transform: TransformStamped) -> None:
        print_json(to_json(transform)) if args.json else print_block(format_transform(transform))

    with open_bus(args) as bus:
        if args.at is not None:
            # This process has received nothing of the past.
            show(_ask(bus, target, source, round(args.at * 1e9), args.timeout or 0.0))
            return
        waiter = Waiter()
        listener = TreeListener(bus, waiter.notify)

        def is_known() -> bool:
            return listener.buffer.can_transform(target, source, 0)[0]

        if not waiter.wait(is_known, SURVEY if limit is None else min(SURVEY, limit), ""):
            try:
                # Of a publisher that has ended, the aggregator still knows the last transform.
                show(_ask(bus, target, source))
                if args.once:
                    return
                why = "nothing newer has come"
            except ZteamError as error:
                why = str(error)
            if limit is None or (limit > SURVEY and args.timeout is not None):
                print_line(f"{why} (waiting for it; Ctrl+C to give up)", file=sys.stderr)
            if not waiter.wait(is_known, None if limit is None else max(0.0, limit - SURVEY), ""):
                raise ZteamError(f"no transform within {limit:g} s: {why}")
        wait = None if args.once else ticker(open_clock(bus, args.clock), 1.0 / args.rate)
        while True:
            show(listener.buffer.lookup_transform(target, source, 0))
            if wait is None:
                return
            wait()


def _ask(bus: Bus, target: str, source: str, time: int = 0, timeout: float = 0.0) -> TransformStamped:
    """The aggregator's transform between two frames at a time (ns; 0 = newest). Raises ZteamError that says why not."""
    try:
        return TransformClient(bus).lookup_transform(target, source, time, timeout)
    except (TransformException, BusError) as error:
        frames, why = find_frames(bus), str(error).strip()
    if frames is None:
        raise ZteamError(NO_AGGREGATOR)
    known = _names_in(frames)
    lack = [f"frame {name!r} does not exist{near_keys(name, known)}" for name in (target, source) if name not in known]
    raise ZteamError(("; ".join(lack) or why) + _SEE_TREE)


def _names_in(frames: Mapping[str, FrameInfo]) -> set[str]:
    """The frames of a tree, its roots included."""
    return {*frames, *(info.parent for info in frames.values())}


def _show_tree(args: argparse.Namespace) -> None:
    path = Path(args.output) if args.output else None
    if path is not None and path.suffix.lower() not in PICTURES:
        args.parser.error(f"--output {path}: name a {', '.join(PICTURES[:-1])} or {PICTURES[-1]} file")
    with open_bus(args) as bus:
        listener = TreeListener(bus)
        pause(SURVEY)
        # Without an aggregator, use what was received.
        asked = find_frames(bus)
        frames = asked or listener.buffer.frames()
    nothing = "" if frames else _nothing(asked is not None, "no frames yet")
    if path is not None:
        if nothing:
            raise ZteamError(nothing)
        draw_tree(frames, listener.now, path)
        print_line(f"{path}: {counted(len(_names_in(frames)), 'frame')}")
    elif args.json:
        print_json(frames)
    elif nothing:
        print_line(nothing)
    else:
        print_block(format_tree(frames, listener.now))


def _show_figures(args: argparse.Namespace) -> None:
    watch = TransformWatch()
    with open_bus(args) as bus:
        listener = TreeListener(bus)
        bus.subscribe(names.TF, TFMessage, lambda _, message: watch.take(message.transforms, listener.now))
        pause(args.seconds)
        frames, conflicts = find_frames(bus), list[str]()
        with suppress(BusError):
            conflicts = bus.ask(names.service_key(names.AGGREGATOR, "conflicts"), list[str])
    authorities = {child: info.authority for child, info in (frames or {}).items()}
    rows = [(figures, authorities.get(figures.child, "unknown")) for figures in watch.figures()]
    nothing = "" if rows else _nothing(frames is not None, "no moving frame")
    if args.json:
        found = [{**msgspec.to_builtins(figures), "authority": authority} for figures, authority in rows]
        print_json({"frames": found, "conflicts": conflicts})
        return
    header = ("frame", "authority", "rate", "jitter", "delay", "max delay")
    cells = list[tuple[str, ...]]()
    for f, name in rows:
        rate = "-" if f.rate is None else format_rate(f.rate)
        cells.append((f.child, name, rate, *map(in_ms, (f.jitter, f.mean_delay, f.max_delay))))
    print_block(nothing or format_table(header, cells, numbers_from=2))
    for conflict in conflicts:
        print_line(f"conflict: {conflict}")


def _nothing(has_aggregator: bool, text: str) -> str:
    """What is said where there is nothing to show. Raises ZteamError if that is for want of an aggregator."""
    if not has_aggregator:
        raise ZteamError(NO_AGGREGATOR)
    return f"{text} (see 'zteam doctor')"


def _show_positions(args: argparse.Namespace) -> None:
    with open_bus(args) as bus:
        listener = TreeListener(bus)
        pause(SURVEY)
        wait = None if args.rate is None else ticker(open_clock(bus, args.clock), 1.0 / args.rate)
        while True:
            found = _find_positions(listener.buffer.frames(), listener.buffer.lookup_transform)
            # Nothing new comes while the world stands still.
            found = found or _find_positions(find_frames(bus) or (), TransformClient(bus).lookup_transform)
            nothing = "" if found else _nothing(find_frames(bus) is not None, "no robots")
            if args.json:
                print_json(found)
            else:
                print_line(*([nothing] if nothing else map(_format_position, found)))
            if wait is None:
                return
            wait()


def _find_positions(frames: Iterable[str], look_up: Callable[[str, str], TransformStamped]) -> list[dict[str, Any]]:
    """The pose in `map` of every robot that has a base; one without a path to it has a reason, `why`, instead."""
    found = []
    for child in frames:
        if names.is_robot_frame(child, names.BASE_FOOTPRINT):
            place: dict[str, Any] = dict.fromkeys(("x", "y", "yaw", "stamp"))
            why = ""
            try:
                at = look_up(names.MAP_FRAME, child)
                x, y, _z, *turn = floats_of(at.transform)
                stamp = ns_from_time(at.header.stamp) / 1e9
                place = {"x": x, "y": y, "yaw": yaw_from_quaternion(*turn), "stamp": stamp}
            except (TransformException, BusError) as error:
                why = str(error).strip()
            found.append({"robot": child.partition("/")[0], **place, "why": why})
    return sorted(found, key=lambda each: names.robot_id_of(each["robot"]) or 0)


def _format_position(found: dict[str, Any]) -> str:
    if found["why"]:
        return f"{found['robot']:10} unknown: {found['why']}"
    return "{robot:10} x {x:z8.3f}  y {y:z8.3f}  yaw {yaw:z7.3f}  at {stamp:.1f} s".format(**found)


def _hold_static(args: argparse.Namespace) -> None:
    """Hold a fixed transform for as long as the command runs.

    The request goes to every aggregator that appears: one that was restarted has lost earlier requests.
    """
    request = checked(args, lambda: parse_static(args.words, ""))
    waiter, aggregators, asked = Waiter(), set[str](), set[str]()

    def on_token(key: str, alive: bool) -> None:
        (aggregators.add if alive else aggregators.discard)(key)
        if not alive:
            asked.discard(key)
        waiter.notify()

    with open_bus(args) as bus:
        request.caller = bus.instance
        bus.declare_token(names.token_key(names.STATIC_CALLER, bus.instance))
        bus.watch_tokens([names.tokens_key(names.AGGREGATOR)], on_token)
        try:
            while True:
                missing = "" if asked else "an aggregator: start one with 'zteam-tf'"
                waiter.wait(lambda: bool(aggregators - asked), None, missing)
                fresh = aggregators - asked
                reply = bus.ask(names.service_key(names.AGGREGATOR, "static"), StaticReply, request)
                if reply.refused:
                    raise ZteamError(f"refused: {reply.refused}")
                asked.update(fresh)
                print_line(f"{request.parent} -> {request.child} holds until Ctrl+C")
                frames = find_frames(bus) or {}
                frames.pop(request.child, None)
                if (known := _names_in(frames)) and request.parent not in known:
                    text = f"no process publishes the frame {request.parent!r}{near_keys(request.parent, known)}"
                    print_line(f"zteam tf: {text}{_SEE_TREE}", file=sys.stderr)
        except KeyboardInterrupt:
            return


def parse_static(words: Sequence[str], caller: str) -> StaticRequest:
    """The request of X Y Z YAW PITCH ROLL PARENT CHILD or X Y Z QX QY QZ QW PARENT CHILD. Raises UsageError."""
    from zteam.team.file.entries import StaticTransform, static_transform

    turn = {8: ("yaw", "pitch", "roll"), 9: ("qx", "qy", "qz", "qw")}.get(len(words))
    form = "X Y Z YAW PITCH ROLL PARENT CHILD, e.g. 0.1 0 0.2 0 0 0 robot_0/base_link robot_0/camera"
    if turn is None:
        raise UsageError(f"give {form}")
    try:
        numbers = [parse_number(word, -MAX_COORDINATE, MAX_COORDINATE, "numbers") for word in words[:-2]]
    except UsageError as error:
        raise UsageError(f"give {form}; {error}") from None
    keys = ("x", "y", "z", *turn, "parent", "child")
    given = dict(zip(keys, (*numbers, *words[-2:]), strict=True))
    for problem in problems_of(given, StaticTransform):
        raise UsageError(str(problem))
    found = static_transform(msgspec.convert(given, StaticTransform))
    return StaticRequest(found.header.frame_id, found.child_frame_id, caller, *floats_of(found.transform))


main = partial(run_tool, build_parser, None)
