"""`zteam check NAME`: try a behaviour in awkward moments and small worlds, and say what it does wrong."""

import argparse
import contextlib
import os
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from zteam.cli.arguments import add_path_option, folders_of
from zteam.cli.options import Parser, add_log_options, run_tool
from zteam.cli.output import print_block, print_json, print_line
from zteam.cli.zteam_robot import add_param_option
from zteam.robot.behaviors.registry import find_behavior, look_in

# Trials import the simulator, which takes a moment: a mistake in the command line is said before.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from zteam.robot.trials.check import Fault, TrialResult

_WIDTH = 31
"""Columns of a trial's name."""


def build_parser() -> Parser:
    parser = Parser(prog="zteam check", description=__doc__)
    parser.add_argument("name", metavar="NAME", help="package.module:Class, or a name such as wander")
    add_param_option(parser)
    add_path_option(parser)
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_log_options(parser)
    return parser


def _check(args: argparse.Namespace) -> int:
    out, results = sys.stdout, []
    look_in(folders_of(args))
    # What the author's own code prints must not come among the results, and its steps are hundreds.
    with contextlib.redirect_stdout(sys.stderr):
        kind = find_behavior(args.name)
    from zteam.robot.trials.check import all_trials, run_trials

    with Path(os.devnull).open("w") as nowhere, contextlib.redirect_stdout(nowhere):
        for result in run_trials(args.name, kind, dict(args.param)):
            results.append(result)
            if not args.json:
                verdict = "WRONG" if result.faults else "ok"
                print_line(f"{result.name:{_WIDTH}}  {verdict:6}  {result.note}".rstrip(), file=out)
    is_good = not any(result.faults for result in results)
    if args.json:
        print_json({"behavior": args.name, "good": is_good, "trials": results})
    else:
        left = len(all_trials(kind)) - len(results)
        if left:
            print_line(f"(the other {left} trials are left out, because these took too long)")
        print_block(f"\n{format_faults(args.name, results)}")
    return 0 if is_good else 1


def format_faults(name: str, results: Sequence["TrialResult"]) -> str:
    """Each fault once, with the trials that show it."""
    found: dict[tuple[str, str], tuple[Fault, list[str]]] = {}
    for result in results:
        for fault in result.faults:
            found.setdefault((fault.kind, fault.place), (fault, []))[1].append(result.name)
    count = {0: "nothing is wrong", 1: "one thing is wrong"}.get(len(found), f"{len(found)} things are wrong")
    lines = [f"{name}: {count} in {len(results)} trial{'s' if results[1:] else ''}"]
    for number, (fault, trials) in enumerate(found.values(), 1):
        more = f"; {len(trials) - 3} more" if trials[3:] else ""
        parts = {"at": fault.place, "in": "; ".join(trials[:3]) + more, "try": fault.hint}
        lines += ["", f"{number}. {fault.text}", *(f"   {word}: {text}" for word, text in parts.items() if text)]
    return "\n".join(lines)


main = partial(run_tool, build_parser, _check)
