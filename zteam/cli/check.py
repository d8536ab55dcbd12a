"""`zteam check NAME`: try a behaviour in awkward moments and small worlds, and say what it does wrong."""

import argparse
import contextlib
import os
import sys
from collections.abc import Iterable, Sequence
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
    from zteam.robot.trials.check import TrialResult
    from zteam.robot.trials.subject import Fault

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
    from zteam.robot.trials.check import run_trials, trial_names

    with Path(os.devnull).open("w") as nowhere, contextlib.redirect_stdout(nowhere):
        for result in run_trials(args.name, kind, dict(args.param)):
            results.append(result)
            if not args.json:
                print_line(_row(result), file=out)
    is_good = all(result.is_good for result in results)
    if args.json:
        print_json({"behavior": args.name, "good": is_good, "trials": results})
    else:
        left = len(trial_names(kind)) - len(results)
        if left:
            print_line(f"(the other {left} trials are left out, because these took too long)")
        print_block(f"\n{format_faults(args.name, results)}")
    return 0 if is_good else 1


def _row(result: "TrialResult") -> str:
    verdict = "WRONG" if not result.is_good else "remark" if result.faults else "ok"
    return f"{result.name:{_WIDTH}}  {verdict:6}  {result.note}".rstrip()


def format_faults(name: str, results: Sequence["TrialResult"]) -> str:
    """Each fault once, with the trials that show it."""
    found: dict[tuple[str, str, bool], list[tuple[Fault, str]]] = {}
    for result in results:
        for fault in result.faults:
            found.setdefault((fault.kind, fault.place, fault.is_remark), []).append((fault, result.name))
    wrong = [shown for key, shown in found.items() if not key[-1]]
    # What is wrong elsewhere needs no remark.
    remarks = [shown for key, shown in found.items() if key[-1] and (*key[:-1], False) not in found]
    count = {0: "nothing is wrong", 1: "one thing is wrong"}.get(len(wrong), f"{len(wrong)} things are wrong")
    lines = [f"{name}: {count} in {len(results)} trial{'s' if results[1:] else ''}"]
    for number, shown in enumerate(wrong, 1):
        lines += ["", *_paragraph(f"{number}. ", shown)]
    for shown in remarks:
        lines += ["", *_paragraph("remark: ", shown)]
    return "\n".join(lines)


def _paragraph(head: str, shown: Iterable[tuple["Fault", str]]) -> list[str]:
    (fault, _), *_ = shown
    trials = [name for _, name in shown]
    lines = [head + fault.text]
    parts = {"at": fault.place, "in": "; ".join(trials[:3]) + (f"; {len(trials) - 3} more" if trials[3:] else "")}
    parts["try"] = fault.hint
    return lines + [f"   {word}: {text}" for word, text in parts.items() if text]


main = partial(run_tool, build_parser, _check)
