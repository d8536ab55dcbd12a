"""`zteam chaos kill | pause | cut | slow NAME`, `--plan FILE`, `--random SEED --for S`: faults on purpose, and how the
team recovers."""

import argparse
import sys
from functools import partial
from typing import TYPE_CHECKING

from zteam import names
from zteam.bus import Bus
from zteam.bus.presence import find_processes
from zteam.cli.listening import open_bus
from zteam.cli.options import Parser, add_bus_options, add_option, check_together, run_tool
from zteam.cli.tables import format_table
from zteam.config.fault import KINDS, Fault
from zteam.config.numbers import MAX_SECONDS
from zteam.errors import UsageError, ZteamError
from zteam.node.output import print_block, print_json, print_line

if TYPE_CHECKING:
    from zteam.team.chaos.carry_out import ChaosReport


def build_parser() -> Parser:
    parser = Parser(prog="zteam chaos", description=__doc__, epilog="docs/tools.md says what each fault does.")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("fault", nargs="?", metavar="|".join(KINDS), help="what happens to one process")
    parser.add_argument("name", nargs="?", metavar="NAME", help="the process: robot_1, sim, tf, router, …")
    what.add_argument("--plan", metavar="FILE", help="carry out the faults of this file")
    what.add_argument("--random", metavar="SEED", help="carry out faults that this seed draws; needs --for")
    text = "how long the fault lasts (default: 3), or over how many simulated seconds --random draws"
    add_option(parser, "--for", dest="seconds", typed=(1e-3, MAX_SECONDS, "seconds"), metavar="S", help=text)
    text = "slow: seconds each way (default: 0.5)"
    add_option(parser, "--delay", typed=(0.0, MAX_SECONDS, "seconds"), metavar="S", help=text)
    add_option(parser, "--rate", typed=(1.0, 1e12, "bytes a second"), metavar="B", help="slow: bytes a second")
    parser.add_argument("--print", action="store_true", help="with --random: print the plan, and carry out nothing")
    parser.add_argument("--json", action="store_true", help="print the report as one line of JSON")
    add_bus_options(parser)
    return parser


def _read(args: argparse.Namespace) -> None:
    if args.fault is not None and (args.fault not in KINDS or args.name is None):
        raise UsageError(f"{args.fault}: say {', '.join(KINDS)} and a process, as in 'zteam chaos pause robot_1'")
    if args.fault != "slow" and (args.delay is not None or args.rate is not None):
        raise UsageError("--delay and --rate belong to slow")
    if args.plan is not None and args.seconds is not None:
        raise UsageError("--plan: the plan says how long each fault lasts: leave --for out")
    check_together(args, {"--random": ("--for",), "--print": ("--random",)}, {})


def _work(args: argparse.Namespace) -> int:
    from zteam.monitor.observer import TeamObserver
    from zteam.simulator.client import find_status
    from zteam.team.chaos.carry_out import Watchdog, carry_out
    from zteam.team.chaos.means import choose_plan, describe, means_on_bus, plan_text

    with open_bus(args) as bus:
        status = find_status(bus)
        lockstep = status is not None and status.lockstep
        if args.fault is not None:
            delay = args.delay if args.delay is not None else 0.5 if args.rate is None else 0.0
            seconds = 3.0 if args.seconds is None else args.seconds
            fault = Fault(at=0.0, fault=args.fault, name=args.name, seconds=seconds, delay=delay, rate=args.rate)
            plan: tuple[Fault, ...] = (fault,)
        else:
            plan = choose_plan(args.plan or args.random, args.seconds, _processes(bus), lockstep=lockstep)
        if args.random is not None:
            text = plan_text(plan, f"zteam chaos --random {args.random} --for {args.seconds:g}: {describe(plan)}")
            print_block(text, file=sys.stdout if args.print else sys.stderr)
        if args.print:
            return 0
        watchdog = Watchdog(TeamObserver(bus), lockstep=lockstep, simulated=status is not None)
        means, say = means_on_bus(bus, lockstep=lockstep), partial(print_line, file=sys.stderr)
        report = carry_out(plan, watchdog, means, say=say)
    problem = report.faults[0].problem if args.fault is not None and report.faults else ""
    if problem and not report.violations:
        raise ZteamError(problem)
    print_json(report) if args.json else print_report(report)
    return 1 if report.violations else 0


def _processes(bus: Bus) -> list[str]:
    """The processes of the team: those that hold a name, but for launchers, views and static frames; and the router."""
    from zteam.node.kinds import ROUTER

    beside = (names.LAUNCHER, names.STATIC_CALLER, names.GOALS)
    found = {info.name for info in find_processes(bus)}
    return [*sorted(name for name in found if name not in beside and not names.is_view(name)), ROUTER]


def print_report(report: "ChaosReport") -> None:
    from zteam.team.chaos.carry_out import HEADER, rows, summary

    if report.faults:
        print_block(format_table(HEADER, rows(report)))
    print_block(summary(report))


main = partial(run_tool, build_parser, _work, read=_read)
