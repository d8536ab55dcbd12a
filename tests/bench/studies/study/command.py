"""the study `lines`: teams for many seeds, each in one process; how well their lines hold and drive."""

import argparse
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from zteam.cli.arguments import number, whole
from zteam.cli.live_line import LiveLine, has_live_line
from zteam.cli.progress_text import bar, duration_text
from zteam.cli.tables import format_table
from zteam.clock import monotonic
from zteam.config.numbers import MAX_SECONDS, counted
from zteam.config.option import SEEDS
from zteam.config.resources import find_team, find_world
from zteam.errors import UsageError, ZteamError
from zteam.simulator.client import MAX_SPEED, MIN_SPEED

if TYPE_CHECKING:
    from studies.study.figures import CaseFigures
    from studies.study.one_run import Row, Task

CASES = ("line", "arena", "wanderer", "eight", "world", "amcl", "noise", "driven")
"""Of studies.study.cases."""
_BAR = 20
_LEGEND = [
    "failed, contacts: of all runs. held: share of the time within 3 m of the robot that it follows, worst follower.",
    "still: longest time in which no robot moved. share: the head's way / (its speed x the time), mean of the runs.",
]
_BESIDE_LEGEND = [
    "medians of the runs: driven, by robot; gaps of robots that follow each other in the last third of the time;",
    "safety stops of all robots; the longest stand of a robot. late: steps that came late, in the worst run.",
]


def add_study(parser: argparse.ArgumentParser) -> None:
    """Its options."""
    parser.add_argument(
        "what", nargs="+", metavar="CASE", help=f"{', '.join(CASES)}, or a team file; NAME=VALUE are its arguments"
    )
    parser.add_argument(
        "--seconds", type=number(1.0, MAX_SECONDS, "simulated seconds"), metavar="N",
        help="simulated seconds of each run (default: 900; 60 with --real-time)",
    )  # fmt: skip
    parser.add_argument("--seeds", metavar="A-B", help="the runs' seeds (default: 1-24; 1 with --real-time)")
    parser.add_argument(
        "--real-time",
        action="store_true",
        help="in real time, as the processes that zteam up starts, beside the same in lock-step",
    )
    parser.add_argument(
        "--speed", type=number(MIN_SPEED, MAX_SPEED, "simulated seconds a second"), metavar="X",
        help="simulated seconds a second of the host, with --real-time (default: 1)",
    )  # fmt: skip
    parser.add_argument("--world", metavar="WORLD", help="drive in this world in the place of the team's own")
    parser.add_argument(
        "--results",
        type=Path,
        metavar="FILE",
        help="keep results here, a line of JSON each; what it has is not run again",
    )
    parser.add_argument("--jobs", type=whole(1, 1000, "runs"), metavar="N", help="runs at a time (default: one a core)")
    bounds = parser.add_argument_group("bounds", "exit code 1 if a case misses one, or if a run fails")
    bounds.add_argument(
        "--contacts", type=whole(0, 10**9, "contacts"), metavar="N", help="at most so many, of all runs"
    )
    share = number(0.0, 1.0, "a share")
    bounds.add_argument("--held", type=share, metavar="SHARE", help="each follower in each run, at least")
    bounds.add_argument("--still", type=number(0.0, MAX_SECONDS, "seconds"), metavar="S", help="seconds, at most")
    bounds.add_argument("--share", type=share, metavar="SHARE", help="of the head's way, mean of the runs, at least")


def tasks_of(args: argparse.Namespace) -> "list[Task]":
    """The runs that a command line asks for. Raises UsageError."""
    from studies.study.one_run import Task

    if args.speed is not None and not args.real_time:
        raise UsageError("--speed needs --real-time")
    seeds = args.seeds or ("1" if args.real_time else "1-24")
    first, dash, last = seeds.partition("-")
    if not (first.isdecimal() and (last.isdecimal() or not dash)) or not int(first) <= int(last or first) <= SEEDS[1]:
        raise UsageError(f"--seeds {seeds}: give the first and the last one, such as 1-24, or one")
    world = str(find_world(args.world).resolve()) if args.world else None
    teams = [word for word in args.what if "=" not in word]
    for team in teams:
        if team not in CASES:
            find_team(team)
    arguments = dict(word.split("=", 1) for word in args.what if "=" in word)
    if "world" in teams and world is None:
        raise UsageError("the case world needs a world with robots: give --world FILE")
    seconds = args.seconds or (60.0 if args.real_time else 900.0)
    speed = (args.speed or 1.0) if args.real_time else None
    return [
        Task(team, seconds, seed, world, {} if team in CASES else arguments, args.real_time, speed)
        for team in teams
        for seed in range(int(first), int(last or first) + 1)
    ]


def measure_study(args: argparse.Namespace) -> "list[CaseFigures]":
    """Run what is not in the file of results yet, with a bar on a terminal. Raises ZteamError."""
    from msgspec.structs import replace

    from studies.study.figures import Bounds, summarize

    tasks = tasks_of(args)
    # All of lock-step first: it would take processor time from runs in real time.
    lockstep = _run([replace(task, speed=None) for task in tasks], args) if args.real_time else []
    rows, bounds = _run(tasks, args), Bounds(args.contacts, args.held, args.still, args.share)

    def of(what: str, rows: "Sequence[Row]") -> "list[Row]":
        return [row for row in rows if row.task.what == what]

    return [
        summarize(of(what, rows), bounds, of(what, lockstep)) for what in dict.fromkeys(task.what for task in tasks)
    ]


def _run(tasks: "Sequence[Task]", args: argparse.Namespace) -> "list[Row]":
    from studies.study.figures import run_study

    begin, known, ready = monotonic(), 0, 0
    with LiveLine(sys.stderr) if has_live_line(sys.stderr) else nullcontext() as live:

        def show(task: "Task | None", done: int, total: int) -> None:
            nonlocal known, ready
            known, ready = done if task is None else known, done
            if live is not None:
                line = progress_line(done, total, known, monotonic() - begin)
                live.show(line)

        try:
            return run_study(tasks, args.results, args.jobs, show)
        except KeyboardInterrupt:
            if args.results is not None:
                left = f"{args.results} has {ready} of {counted(len(tasks), 'run')}; the same command goes on"
                print(f"studies: stopped: {left}", file=sys.stderr)
            raise
        except OSError as error:
            raise ZteamError(f"--results {args.results}: {error.strerror or error}") from None


def progress_line(done: int, total: int, known: int, spent: float) -> str:
    """How many of all runs are done, and how long the rest takes if it goes on so; `known` were done at the start."""
    left = f", {duration_text(spent / (done - known) * (total - done))} left" if known < done < total else ""
    return f"{bar(done / total, _BAR)} {done} of {counted(total, 'run')}{left}"


def format_study(cases: "Sequence[CaseFigures]") -> str:
    """One row a case, then what was missed."""
    header = ["case", "runs", "s", "failed", "contacts", "held", "still, s", "share"]
    cells = [
        [
            case.what,
            f"{len(case.runs)}",
            f"{case.seconds:g}",
            f"{case.errors}",
            f"{case.contacts}",
            "-" if case.held is None else f"{case.held:.3f}",
            f"{case.still:.1f}",
            "-" if case.share is None else f"{case.share:.2f}",
        ]
        for case in cases
    ]
    missed = [f"{case.what}: MISSED: {text}" for case in cases for text in case.missed]
    beside = _beside_lockstep([case for case in cases if case.lockstep])
    return "\n".join([format_table(header, cells, numbers_from=1), *_LEGEND, *beside, *missed])


def _beside_lockstep(cases: "Sequence[CaseFigures]") -> list[str]:
    """Two rows a case, real time and lock-step, with the medians that are compared; nothing without a case."""
    from studies.study.agreement import medians_of

    cells = []
    for case in cases:
        for pace, rows in (("real time", case.runs), ("lock-step", case.lockstep)):
            runs = [row.outcome for row in rows if not row.outcome.error]
            if not runs:
                continue
            found = medians_of(runs)
            driven = " ".join(f"{metres:.1f}" for metres in found.driven.values())
            gaps = " ".join(f"{metres:.2f}" for metres in found.gaps.values()) or "-"
            late = f"{100 * max(run.late for run in runs):.1f}"
            cells.append([case.what, pace, driven, gaps, f"{found.safety_stops:g}", f"{found.stand:.1f}", late])
    header = ["case", "in", "driven, m", "gaps, m", "safety stops", "stood, s", "late, %"]
    return ["", format_table(header, cells, numbers_from=2), *_BESIDE_LEGEND] if cells else []


def exit_code(cases: "Sequence[Any]") -> int:
    """1 if a case misses a bound, or a run failed."""
    return int(any(case.missed for case in cases))
