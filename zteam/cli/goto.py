"""`zteam goto 1 X Y [YAW]`: send a robot to a pose in the map, wait until it is there, and say how it ended."""

import argparse
import math
import sys
from collections.abc import Sequence

from zteam import names
from zteam.bus import Bus
from zteam.bus.presence import ProcessInfo
from zteam.cli.arguments import negative_numbers, number
from zteam.cli.goal_progress import Progress, goal_report, result_text
from zteam.cli.interrupts import leave
from zteam.cli.listening import Waiter, open_bus
from zteam.cli.options import Parser, add_bus_options, add_clock_option, bus_options, checked, run
from zteam.cli.sim import parse_pose
from zteam.cli.tool_clock import open_clock, still_text
from zteam.clock import STILL, AutoClock, Every, monotonic, to_seconds, wait_until
from zteam.errors import BusError, UsageError
from zteam.geometry import Pose2
from zteam.numbers import MAX_SECONDS
from zteam.services.navigation import GO_TO, GoalWatch, NavigationClient, TaskResult, goal_message, navigation_query
from zteam.services.simulator import absence_of

_USAGE = "zteam goto ID X Y [YAW] [--no-wait] [--timeout SECONDS] [--json] or zteam goto --cancel ID"
_LOOK = 0.25
"""Host seconds between two looks at the robot."""


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="zteam goto", description=__doc__, usage=_USAGE)
    parser.add_argument("robot", metavar="ID", help="robot id")
    parser.add_argument(
        "pose", nargs="*", default=[], metavar="X Y [YAW]", help="in map: metres, metres, radians (default: 0)"
    )
    parser.add_argument("--cancel", action="store_true", help="give the robot's goal up instead: it stops")
    parser.add_argument("--no-wait", action="store_true", help="end with 0 once the goal is sent")
    parser.add_argument(
        "--timeout",
        type=number(1e-3, MAX_SECONDS, "host seconds"),
        metavar="SECONDS",
        help="cancel the goal if it is not reached within so many host seconds",
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON; progress goes to standard error")
    add_clock_option(parser)
    add_bus_options(parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(negative_numbers(sys.argv[1:] if argv is None else argv))
    robot_id, pose = checked(args, lambda: parse_goal(args))
    if pose is None:
        return run("zteam goto", args, lambda: _cancel(args, robot_id))
    return run("zteam goto", args, lambda: _go(args, robot_id, pose))


def parse_goal(args: argparse.Namespace) -> tuple[int, Pose2 | None]:
    """The robot and its goal, None to cancel. Raises UsageError."""
    robot_id = names.parse_robot_id(args.robot.strip())
    if args.cancel:
        if args.pose or args.no_wait or args.timeout:
            raise UsageError(f"--cancel takes a robot and nothing else: zteam goto --cancel {robot_id}")
        return robot_id, None
    if len(args.pose) not in (2, 3):
        raise UsageError("give X Y, or X Y YAW, in the map: metres, metres, radians")
    return robot_id, Pose2(*parse_pose([*args.pose, "0"][:3]))


def _check_robot(bus: Bus, robot_id: int) -> None:
    """Raise BusError for a robot that neither the world nor a process knows."""
    absence = absence_of(bus, robot_id)
    keys = navigation_query(robot_id, "info"), names.service_key(names.robot_name(robot_id), "info")
    if absence and not any(bus.query(key, ProcessInfo) for key in keys):
        raise BusError(absence)


def _cancel(args: argparse.Namespace, robot_id: int) -> int:
    bus = open_bus(bus_options(args))
    try:
        _check_robot(bus, robot_id)
        client = NavigationClient(bus, robot_id, open_clock(bus, args.clock).now)
        had_goal = client.cancel()
    finally:
        bus.close()
    if args.json:
        print(f'{{"robot":{robot_id},"canceled":{str(had_goal).lower()}}}')
    else:
        print(f"{client.name}: {'the goal is canceled' if had_goal else 'there was no goal'}")
    return 0


def _go(args: argparse.Namespace, robot_id: int, pose: Pose2) -> int:
    bus = open_bus(bus_options(args))
    try:
        _check_robot(bus, robot_id)
        clock, waiter = open_clock(bus, args.clock), Waiter()
        client = NavigationClient(bus, robot_id, clock.now, on_change=waiter.notify)
        begin, watch = clock.steady(), client.send(goal_message(pose))
        with Progress(client) as progress:
            try:
                _follow(args, client, watch, waiter, clock, progress)
            except KeyboardInterrupt:
                _give_up(client, "interrupted")
                progress.say(result_text(client, watch, to_seconds(clock.steady() - begin)))
                raise
    finally:
        bus.close()
    seconds = to_seconds(clock.steady() - begin)
    if args.json:
        print(goal_report(client, watch, seconds))
    elif watch.ended and watch.result != TaskResult.SUCCEEDED:
        print(f"zteam goto: {result_text(client, watch, seconds)}", file=sys.stderr)
    else:
        print(result_text(client, watch, seconds))
    return 0 if watch.result == TaskResult.SUCCEEDED or (args.no_wait and not watch.ended) else 1


def _follow(
    args: argparse.Namespace,
    client: NavigationClient,
    watch: GoalWatch,
    waiter: Waiter,
    clock: AutoClock,
    progress: Progress,
) -> None:
    """Wait for the end of the goal; with --no-wait until it is sent."""
    begin, told = monotonic(), False
    moved_at, now, nag = begin, clock.steady(), Every(math.inf)

    def is_over() -> bool:
        return watch.ended or (args.no_wait and not client.is_pending)

    while not is_over():
        with waiter.changed:
            wait_until(waiter.changed, is_over, _LOOK)
        client.look()
        progress.show(watch)
        if client.taker == GO_TO and not told:
            told = True
            progress.say(f"{client.name} has no navigation: its behaviour go_to drives it, by its laser alone")
        if clock.steady() != now:
            moved_at, now = monotonic(), clock.steady()
        elif clock.simulated and monotonic() - moved_at > STILL and nag.due():
            progress.say(still_text(clock))
        if args.timeout is not None and monotonic() - begin >= args.timeout and not is_over():
            waited = f" (waiting for {client.waits_for})" if client.is_pending else ""
            _give_up(client, f"not reached within {args.timeout:g} s{waited}")


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


if __name__ == "__main__":
    leave(main())
