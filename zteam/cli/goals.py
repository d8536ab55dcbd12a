"""`zteam goals FILE`: send goals to robots: each reaches its own in turn, all robots at the same time."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from zteam import names
from zteam.cli.arguments import whole
from zteam.cli.interrupts import INTERRUPTED, leave
from zteam.cli.options import Parser, add_bus_options, add_clock_option, bus_options, checked, run
from zteam.errors import UsageError
from zteam.robot_ids import parse_robot_ids

_EPILOG = """FILE is YAML, a list of goals in the frame map (metres, radians; yaw is 0 where it is left out):

  - {robot: 1, x: 22.0, y: 17.0, yaw: 1.57}
  - {robot: 2, x: 4.5, y: 30.0}
  - {robot: 1, x: 3.0, y: 4.0}
"""
MAX_ROUNDS = 10**9


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(
        prog="zteam goals",
        description=__doc__,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("file", metavar="FILE", help="the goals")
    parser.add_argument(
        "--loop", action="store_true", help="begin again with the first goal when the last has ended, until Ctrl+C"
    )
    parser.add_argument(
        "--rounds",
        type=whole(1, MAX_ROUNDS, "rounds"),
        default=1,
        metavar="N",
        help="drive to all goals so many times (default: %(default)s)",
    )
    parser.add_argument(
        "--spread",
        metavar="IDS",
        help="these robots share the goals that name no robot: each free one takes the next, e.g. 0-3 or 0,2",
    )
    parser.add_argument("--name", default=names.GOALS, help="call this process so on the bus (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print each goal that has ended as a JSON line")
    add_clock_option(parser)
    add_bus_options(parser)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(argv)
    spread = checked(args, lambda: parse_robot_ids([args.spread], "--spread") if args.spread is not None else ())
    checked(args, lambda: _check_name(args.name))
    return run(args.name, args, lambda: _send(args, spread), needs_output=False)


def _check_name(name: str) -> None:
    if not name.isidentifier():
        raise UsageError(f"--name {name!r}: use letters, digits and '_'")


def _send(args: argparse.Namespace, spread: tuple[int, ...]) -> int:
    from zteam.cli.goals_display import open_display
    from zteam.nodes.goals.file import read_goals
    from zteam.nodes.goals.node import Dispatcher
    from zteam.nodes.goals.rounds import Rounds
    from zteam.runtime.node import Node
    from zteam.runtime.process_node import run_node

    # A mistake in the file is told before anything is opened.
    goals = read_goals(Path(args.file), spread=bool(spread))
    rounds = Rounds(goals, spread, None if args.loop else args.rounds)
    made: list[Dispatcher] = []

    def body(node: Node) -> None:
        dispatcher = Dispatcher(node, rounds)
        made.append(dispatcher)
        with open_display(dispatcher, as_json=args.json):
            node.run(dispatcher.step)

    code = run_node(args.name, bus_options(args), body, args.clock, make=Node)
    if code or not made:
        return code
    if not (made[0].is_done or args.loop):
        return INTERRUPTED
    return 0 if made[0].all_reached else 1


if __name__ == "__main__":
    leave(main())
