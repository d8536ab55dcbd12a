"""`zteam goto 1 X Y [YAW]`: send a robot to a pose in the map, wait until it is there, and say how it ended."""

import argparse
import math
import sys
from functools import partial
from typing import Any

from zteam import names
from zteam.bus import Bus
from zteam.bus.presence import ProcessInfo
from zteam.cli.listening import open_bus
from zteam.cli.options import Parser, add_bus_options, add_clock_option, add_option, run_tool
from zteam.cli.sim import parse_pose
from zteam.cli.tables import duration_text
from zteam.cli.tool_clock import open_clock, still_text
from zteam.clock import AutoClock, monotonic, to_seconds
from zteam.config.numbers import MAX_SECONDS, counted
from zteam.errors import BusError, UsageError
from zteam.geometry import Pose2
from zteam.messages import NavigationState, NavigationStatus
from zteam.messages.planar import pose2_of
from zteam.navigation.client import GO_TO, GoalWatch, NavigationClient, TaskResult, goal_message, goal_text
from zteam.node.live_line import PERIOD, ProgressLine
from zteam.node.output import print_json, print_line
from zteam.node.stopping import STOPPED
from zteam.robot.client import navigation_query
from zteam.simulator.client import absence_of

_LOOK = 0.25
"""Host seconds between two looks at the robot."""
_TELL_AFTER = 2.0
"""Host seconds after which it says what it waits for."""


def build_parser() -> Parser:
    parser = Parser(prog="zteam goto", description=__doc__)
    parser.add_argument("robot", metavar="ID", help="robot id")
    text = "in map: metres, metres, radians (default: 0)"
    parser.add_argument("pose", nargs="*", default=[], metavar="X Y [YAW]", help=text)
    text = "the frame of X Y YAW: map (default), base_link, odom or any other of the tree"
    parser.add_argument("--frame", default=names.MAP_FRAME, help=text)
    parser.add_argument("--cancel", action="store_true", help="give the robot's goal up instead: it stops")
    parser.add_argument("--no-wait", action="store_true", help="end with 0 once the goal is sent")
    text = "cancel the goal if it is not reached within so many host seconds"
    add_option(parser, "--timeout", typed=(1e-3, MAX_SECONDS, "host seconds"), metavar="SECONDS", help=text)
    parser.add_argument("--json", action="store_true", help="print the result as JSON; progress goes to standard error")
    add_clock_option(parser)
    add_bus_options(parser)
    return parser


def _read(args: argparse.Namespace) -> None:
    args.robot = names.parse_robot_id(args.robot.strip())
    if args.cancel:
        if args.pose or args.no_wait or args.timeout:
            raise UsageError(f"--cancel takes a robot and nothing else: zteam goto --cancel {args.robot}")
    elif len(args.pose) not in (2, 3):
        raise UsageError("give X Y, or X Y YAW, in the map: metres, metres, radians")
    else:
        args.pose = Pose2(*parse_pose([*args.pose, "0"][:3]))


def _send(args: argparse.Namespace) -> int:
    with open_bus(args) as bus:
        absence = absence_of(bus, args.robot)
        keys = navigation_query(args.robot, "info"), names.service_key(names.robot_name(args.robot), "info")
        if absence and not any(bus.query(key, ProcessInfo) for key in keys):
            raise BusError(absence)
        return (_cancel if args.cancel else _go)(args, bus)


def _cancel(args: argparse.Namespace, bus: Bus) -> int:
    client = NavigationClient(bus, args.robot, open_clock(bus, args.clock).now)
    had_goal = client.cancel()
    text = f"{client.name}: {'the goal is canceled' if had_goal else 'there was no goal'}"
    print_json({"robot": args.robot, "canceled": had_goal}) if args.json else print_line(text)
    return 0


def _go(args: argparse.Namespace, bus: Bus) -> int:
    bus.check_right(names.robot_key(args.robot, names.GOAL_POSE))
    clock = open_clock(bus, args.clock)
    client = NavigationClient(bus, args.robot, clock.now)
    begin, watch = clock.steady(), client.send(goal_message(args.pose, args.frame))
    with ProgressLine() as progress:
        try:
            _follow(args, client, clock, progress)
        except KeyboardInterrupt:
            _give_up(client, "interrupted")
            progress.say(result_text(client, watch, to_seconds(clock.steady() - begin)))
            raise
    seconds = to_seconds(clock.steady() - begin)
    if args.json:
        print_json(goal_facts(client, watch, seconds))
    elif watch.ended and watch.result != TaskResult.SUCCEEDED:
        print_line(f"zteam goto: {result_text(client, watch, seconds)}", file=sys.stderr)
    else:
        print_line(result_text(client, watch, seconds))
    return 0 if watch.result == TaskResult.SUCCEEDED or (args.no_wait and not watch.ended) else 1


def _follow(args: argparse.Namespace, client: NavigationClient, clock: AutoClock, progress: ProgressLine) -> None:
    """Wait for the end of the client's goal; with --no-wait until it is sent."""
    watch = client.watch
    assert watch is not None
    begin, said = monotonic(), set[str]()

    def is_over() -> bool:
        return watch.ended or (args.no_wait and not client.is_pending)

    def say_once(text: str) -> None:
        if text not in said:
            said.add(text)
            progress.say(text)

    while not is_over():
        client.wait(is_over, _LOOK)
        client.look()
        waited = monotonic() - begin
        if client.waits_for and waited > _TELL_AFTER:
            say_once(f"waiting for {client.waits_for} (Ctrl+C to give up)")
        if client.is_stopped:
            say_once(f"{client.name} is {STOPPED}: it goes on when it is released")
        if client.taker == GO_TO:
            say_once(f"{client.name} has no navigation: its behaviour go_to drives it, by its laser alone")
        if progress.is_live or (watch.status is not None and waited > PERIOD):
            progress.show(f"{client.name}: {progress_text(client, watch)}")
        if clock.stands and waited > _TELL_AFTER:
            say_once(still_text(clock))
        if args.timeout is not None and waited >= args.timeout and not is_over():
            lack = f" (waiting for {client.waits_for})" if client.is_pending else ""
            _give_up(client, f"not reached within {args.timeout:g} s{lack}")


def _give_up(client: NavigationClient, why: str) -> None:
    """Cancel the goal; `why` is its end, whatever navigation says."""
    watch = client.watch
    assert watch is not None
    was_pending = client.is_pending
    watch.end(TaskResult.CANCELED, why)
    if not was_pending:
        try:
            client.cancel()
        except BusError as error:
            watch.text = f"{why}; it cannot be canceled: {error}"


def state_text(client: NavigationClient, watch: GoalWatch) -> str:
    """What the robot does for this goal, in a word or two."""
    if watch.ended:
        return watch.result.name.lower()
    if client.is_pending:
        return "waiting"
    if watch.status is None:
        return "sent"
    try:
        return NavigationState(watch.status.state).name.lower()
    except ValueError:
        # Of a newer navigation.
        return f"state {watch.status.state}"


def left_of(status: NavigationStatus | None) -> tuple[str, str, str]:
    """Metres and time that are left, and the number of recoveries; empty where nothing is known."""
    if status is None:
        return "", "", ""
    metres = f"{status.distance_remaining:.1f} m" if math.isfinite(status.distance_remaining) else ""
    seconds = status.estimated_time_remaining.sec + status.estimated_time_remaining.nanosec / 1e9
    return metres, duration_text(seconds) if seconds > 0.0 else "", str(status.recoveries)


def _recoveries(status: NavigationStatus | None) -> str:
    return f", {counted(status.recoveries, 'recovery', 'recoveries')}" if status and status.recoveries else ""


def progress_text(client: NavigationClient, watch: GoalWatch) -> str:
    """How far it is: state, metres and time that are left, recoveries, and why it does not get on."""
    if client.is_pending:
        return f"waiting for {client.waits_for}"
    metres, time, _ = left_of(watch.status)
    left = (f", {metres} left" if metres else "") + (f", about {time}" if time else "")
    why = STOPPED if client.is_stopped else watch.status.text if watch.status else ""
    return f"{state_text(client, watch)}{left}{_recoveries(watch.status)}{f', {why}' if why else ''}"


def result_text(client: NavigationClient, watch: GoalWatch, seconds: float) -> str:
    place = goal_text(watch.goal)
    if not watch.ended:
        return f"{client.name}: goal sent: {place}"
    ends = {TaskResult.SUCCEEDED: "reached", TaskResult.CANCELED: "canceled", TaskResult.FAILED: "aborted"}
    why = f": {watch.text}" if watch.text and watch.result != TaskResult.SUCCEEDED else ""
    return f"{client.name}: goal {ends[watch.result]} after {seconds:.1f} s{_recoveries(watch.status)}: {place}{why}"


def goal_facts(client: NavigationClient, watch: GoalWatch, seconds: float) -> dict[str, Any]:
    status = watch.status
    return {
        "robot": client.robot_id,
        "goal": pose2_of(watch.goal.pose)._asdict(),
        "result": watch.result.name.lower() if watch.ended else "sent",
        "text": watch.text,
        "seconds": round(seconds, 3),
        "recoveries": status.recoveries if status else 0,
        "distance_remaining": status.distance_remaining if status else None,
        "driven_by": client.taker,
    }


main = partial(run_tool, build_parser, _send, read=_read)
