"""`zteam check NAME`: try a behaviour in awkward moments and small worlds, and say what it does wrong."""

import argparse
import contextlib
import os
import sys
from functools import partial
from pathlib import Path

from zteam.cli.options import Parser, add_log_options, add_path_option, folders_of, run_tool
from zteam.cli.processes import add_param_option
from zteam.config.numbers import counted
from zteam.node.output import print_block, print_json, print_line
from zteam.robot.behaviors.registry import find_behavior, look_in


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
    # The trials import the simulator, which takes a moment: mistakes on the command line are reported before.
    from zteam.robot.trials.check import all_trials, format_faults, run_trials

    with Path(os.devnull).open("w") as nowhere, contextlib.redirect_stdout(nowhere):
        for result in run_trials(args.name, kind, dict(args.param)):
            results.append(result)
            if not args.json:
                verdict = "WRONG" if result.faults else "ok"
                print_line(f"{result.name:31}  {verdict:6}  {result.note}".rstrip(), file=out)
    is_good = not any(result.faults for result in results)
    if args.json:
        print_json({"behavior": args.name, "good": is_good, "trials": results})
    else:
        left = len(all_trials(kind)) - len(results)
        if left:
            print_line(f"(the other {left} trials are left out, because these took too long)")
        faults = format_faults(results)
        found = counted(len(faults), "fault") if faults else "no faults"
        print_block("\n".join(["", *faults, f"{args.name}: {found} in {len(results)} trials"]))
    return 0 if is_good else 1


main = partial(run_tool, build_parser, _check)
