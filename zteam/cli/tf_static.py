"""`zteam tf static`: hold a fixed transform for as long as the command runs."""

import argparse
import math
import sys
from collections.abc import Sequence

from zteam import names
from zteam.bus import Bus
from zteam.cli.listening import Waiter, find_key_users, near_keys, open_bus
from zteam.cli.options import bus_options, checked
from zteam.cli.tf_displays import ask_frames
from zteam.errors import UsageError, ZteamError
from zteam.geometry import quaternion_from_rpy, turn_problem
from zteam.numbers import is_number
from zteam.services.transforms import MAX_COORDINATE, StaticReply, StaticRequest
from zteam.tf.merge import TEAM_FILE

_COUNTS = {8: "yaw pitch roll", 9: "qx qy qz qw"}


def parse_static(words: Sequence[str], caller: str) -> StaticRequest:
    """The request of X Y Z YAW PITCH ROLL PARENT CHILD or X Y Z QX QY QZ QW PARENT CHILD. Raises UsageError.

    A publish period at the end, as in ROS 1, is accepted and ignored.
    """
    values = list(words)
    if len(values) in {9, 10} and _is_coordinate(values[-1]) and not _is_coordinate(values[-2]):
        values.pop()
    if len(values) not in _COUNTS or not all(map(_is_coordinate, values[:-2])):
        raise UsageError(
            "give X Y Z YAW PITCH ROLL PARENT CHILD, e.g. 0.1 0 0.2 0 0 0 robot_0/base_link robot_0/camera"
        )
    x, y, z, *angles = map(float, values[:-2])
    if len(angles) == 3:
        yaw, pitch, roll = angles
        for name, angle in zip(("YAW", "PITCH", "ROLL"), angles, strict=True):
            if problem := turn_problem(angle):
                raise UsageError(f"{name} {problem}")
        angles = list(quaternion_from_rpy(roll, pitch, yaw))
    elif abs(math.hypot(*angles) - 1.0) > 0.01:
        raise UsageError(f"QX QY QZ QW has the length {math.hypot(*angles):.3g}; a rotation has the length 1")
    parent, child = (names.strip_slash(name) for name in values[-2:])
    if parent == child:
        raise UsageError(f"PARENT and CHILD are both {child!r}: name two frames")
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
        waiter.wait(
            lambda: bool(aggregators - asked), None, "an aggregator: start one with 'zteam-tf'" if not asked else ""
        )
        fresh = aggregators - asked
        reply = bus.ask(names.service_key(names.AGGREGATOR, "static"), StaticReply, request)
        if reply.refused:
            raise ZteamError(f"refused: {_explain(bus, request, reply.refused)}")
        asked.update(fresh)
        print(f"{request.parent} -> {request.child} holds until Ctrl+C", flush=True)
        _warn_of_an_unknown_parent(bus, request)


def _warn_of_an_unknown_parent(bus: Bus, request: StaticRequest) -> None:
    """Warn if no process publishes the parent: the new frame then is in a tree of its own."""
    edges = {(frame.parent, child) for child, frame in (ask_frames(bus) or {}).items()}
    known = {name for edge in edges - {(request.parent, request.child)} for name in edge}
    if known and request.parent not in known:
        text = f"no process publishes the frame {request.parent!r}{near_keys(request.parent, known)}"
        print(f"zteam tf: {text} (see 'zteam tf tree')", file=sys.stderr, flush=True)


def _explain(bus: Bus, request: StaticRequest, refused: str) -> str:
    """Which process has the frame already, and what to do; else what the aggregator says."""
    frame = (ask_frames(bus) or {}).get(request.child)
    if frame is None or frame.authority == f"{names.STATIC_CALLER} {request.caller}":
        return refused
    edge, robot_id = f"{frame.parent} -> {request.child}", names.robot_id_of(request.child.partition("/")[0])
    if frame.authority == TEAM_FILE:
        return f"the team file of zteam-tf has {edge} already: change it there"
    if robot_id is None or frame.authority.startswith(f"{names.STATIC_CALLER} "):
        holder = frame.authority.replace(f"{names.STATIC_CALLER} ", "another 'zteam tf static', session ", 1)
        return f"{holder} has {edge} already: end that one, or name another child frame"
    key = names.robot_key(robot_id, names.TF_STATIC if frame.static else names.TF)
    publishers = frame.authority if frame.static else ", ".join(find_key_users(bus).publishers(key)) or frame.authority
    if names.is_robot_frame(request.child, names.ODOM):
        way_out = "to set a start pose, put it into [[static_transforms]] of the team file that zteam-tf reads"
    else:
        way_out = "nothing is left to do for this frame; for a frame of your own name another child"
    return f"{publishers} publishes {edge} already, on {key}: {way_out}"


def hold_static(args: argparse.Namespace) -> int:
    """Hold a fixed transform until Ctrl+C."""
    request = checked(args, lambda: parse_static(args.words, ""))
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
