"""`zteam goals FILE`: send goals to robots: each reaches its own in turn, all robots at the same time.

`--pause` and `--resume` pause the lists that are under way, and go on with them.
"""

import argparse
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path

from zteam import names
from zteam.cli.goto import goal_facts, left_of, result_text, state_text
from zteam.cli.interrupts import INTERRUPTED
from zteam.cli.listening import open_bus
from zteam.cli.options import Parser, add_bus_options, add_clock_option, add_option, bus_options, run_tool
from zteam.cli.tables import format_table
from zteam.clock import monotonic
from zteam.config.robot_ids import parse_robot_ids
from zteam.errors import BusError, UsageError
from zteam.navigation.client import goal_text
from zteam.navigation.goals import Dispatcher, Errand, Rounds, read_goals
from zteam.node.live_line import LiveLine, has_live_line
from zteam.node.node import Node
from zteam.node.output import print_block, print_json, print_line
from zteam.node.process_node import run_node
from zteam.robot.client import pause_lists

_EPILOG = """FILE is YAML, a list of goals in the frame map (metres, radians; yaw is 0 where it is left out):

  - {robot: 1, x: 22.0, y: 17.0, yaw: 1.57}
  - {robot: 2, x: 4.5, y: 30.0}
  - {robot: 1, x: 3.0, y: 4.0}
"""
_PERIOD = 0.5
"""Host seconds between two looks of what is shown."""
_TELL_AFTER = 3.0
"""Host seconds after which it says what a robot waits for."""
_HEAD = ("robot", "state", "left", "time", "recoveries", "reached", "failed", "goal")


def build_parser() -> Parser:
    parser = Parser(prog="zteam goals", description=__doc__, epilog=_EPILOG)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("file", nargs="?", metavar="FILE", help="the goals")
    text = "begin again with the first goal when the last has ended, until Ctrl+C"
    parser.add_argument("--loop", action="store_true", help=text)
    text = "drive to all goals so many times"
    add_option(parser, "--rounds", typed=(1, 10**9, "rounds"), default=1, metavar="N", help=text)
    text = "these robots share the goals that name no robot: each free one takes the next, e.g. 0-3 or 0,2"
    parser.add_argument("--spread", metavar="IDS", help=text)
    for option, text in (("--pause", "send these robots no further goal of a list"), ("--resume", "go on with it")):
        text += ", wherever it is sent from (default: all robots)"
        what.add_argument(option, nargs="?", const="", metavar="IDS", help=text)
    add_option(parser, "--name", dest="process", default=names.GOALS, help="call this process so on the bus")
    parser.add_argument("--json", action="store_true", help="print each goal that has ended as a JSON line")
    add_clock_option(parser)
    add_bus_options(parser)
    return parser


def _read(args: argparse.Namespace) -> None:
    args.spread = () if args.spread is None else parse_robot_ids([args.spread], "--spread")
    for option in ("pause", "resume"):
        if getattr(args, option):
            setattr(args, option, parse_robot_ids([getattr(args, option)], f"--{option}"))
    if not args.process.isidentifier():
        raise UsageError(f"--name {args.process!r}: use letters, digits and '_'")


def _pause(args: argparse.Namespace) -> int:
    paused = args.resume is None
    robots = args.pause if paused else args.resume
    with open_bus(args) as bus:
        done = pause_lists(bus, robots or None, paused=paused)
    absent = sorted(set(robots or ()) - set(done))
    if absent or not done:
        raise BusError(f"no list of goals for {', '.join(map(names.robot_name, absent)) or 'any robot'}")
    text = f"{', '.join(map(names.robot_name, done))}: {'no further goals for now' if paused else 'goes on'}"
    print_json({"robots": done, "is_paused": paused}) if args.json else print_line(text)
    return 0


def _act(args: argparse.Namespace) -> int:
    if args.pause is not None or args.resume is not None:
        return _pause(args)
    # A mistake in the file is told before anything is opened.
    goals = read_goals(Path(args.file), spread=bool(args.spread))
    rounds = Rounds(goals, args.spread, None if args.loop else args.rounds)
    made: list[Dispatcher] = []

    def body(node: Node) -> None:
        node.bus.check_right(*(names.robot_key(robot_id, names.GOAL_POSE) for robot_id in rounds.robots))
        dispatcher = Dispatcher(node, rounds)
        made.append(dispatcher)
        with open_display(dispatcher, as_json=args.json):
            node.run(dispatcher.step)

    code = run_node(args.process, bus_options(args), body, args.clock, make=Node)
    if code or not made:
        return code
    if not (made[0].is_done or args.loop):
        return INTERRUPTED
    return 0 if made[0].all_reached else 1


@contextmanager
def open_display(dispatcher: Dispatcher, *, as_json: bool) -> Iterator[None]:
    """Show within this context how the robots do, on a thread of its own, and at the end the sums."""
    closed, begin, told = threading.Event(), monotonic(), dict[int, str]()
    has_live = not as_json and has_live_line(sys.stdout)
    with LiveLine(sys.stdout) if has_live else nullcontext() as live:
        say = print_line if live is None else live.print

        def show() -> None:
            for ended in dispatcher.take_ended():
                client = dispatcher.errands[ended.robot].client
                facts = {**goal_facts(client, ended.watch, ended.seconds), "line": ended.goal.line}
                text = f"{result_text(client, ended.watch, ended.seconds)} (line {ended.goal.line})"
                say(text) if not as_json else print_json(facts)
            for robot_id, errand in dispatcher.errands.items():
                waits = errand.client.waits_for
                if waits and waits != told.get(robot_id) and monotonic() - begin > _TELL_AFTER:
                    told[robot_id] = waits
                    print_line(f"{errand.client.name}: waiting for {waits}", file=sys.stderr)
            if live is not None:
                live.show(table(dispatcher))

        def look() -> None:
            while not closed.wait(_PERIOD):
                show()

        thread = threading.Thread(target=look, name="display", daemon=True)
        thread.start()
        try:
            yield
        finally:
            closed.set()
            thread.join()
            show()
    if not as_json:
        print_block(table(dispatcher))


def table(dispatcher: Dispatcher) -> str:
    """One row a robot: what it does, and how many goals it has reached."""
    return format_table(_HEAD, [_row(errand) for errand in dispatcher.errands.values()])


def _row(errand: Errand) -> tuple[str, ...]:
    sums = (str(errand.reached), str(errand.failed))
    watch = errand.watch
    if watch is None:
        state = "paused" if errand.is_paused else "no goal"
        return errand.client.name, state, "", "", "", *sums, ""
    row = errand.client.name, state_text(errand.client, watch), *left_of(watch.status)
    return *row, *sums, goal_text(watch.goal)


main = partial(run_tool, build_parser, _act, read=_read, needs_output=False)
