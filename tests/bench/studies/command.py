"""Which studies there are, and what each one prints."""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import msgspec

from studies.chains.figures import ROWS as CHAINS
from studies.chains.figures import format_chains, measure_chains
from studies.faults import measure_faults
from studies.floor import format_floor, measure_floor
from studies.formations import format_formations, measure_formations
from studies.freezes import MODES, PROCESSES, SECONDS, format_freezes, measure_freezes
from studies.hops import format_hops, measure_hops
from studies.navigation.figures import ROWS as NAVIGATION
from studies.navigation.figures import format_navigation, measure_navigation
from studies.navigation.teams import TEAM_ROWS
from studies.recovery import ROWS as FAULTS
from studies.recovery import format_recovery, measure_recovery
from studies.secure import format_secure, measure_secure
from studies.steps import format_steps, measure_steps
from studies.study.cases import CASES
from studies.study.figures import Bounds, format_study, run_study, summarize
from studies.study.one_run import Row, Task
from studies.view.figures import PARTS, format_view, measure_view
from zteam.cli.interrupts import raise_from_now
from zteam.cli.options import Parser, add_log_options, add_option, option_type, run
from zteam.config.numbers import MAX_SECONDS, parse_number
from zteam.config.option import SEEDS
from zteam.config.resources import find_team, find_world
from zteam.errors import UsageError, ZteamError
from zteam.node.live_line import ProgressLine
from zteam.simulator.client import MAX_SPEED, MIN_SPEED

FORMATIONS = "formations"
"""The row of `robots` with all shapes (studies.formations)."""

Say = Callable[[str], None]
"""Shows how far a study is."""
Add = Callable[[argparse.ArgumentParser], None]
Shown = tuple[Any, str]
"""What a study found, for JSON, and the same as text."""


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(argv)
    return run("studies", args, lambda: _measure(args))


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="studies", description=__doc__)
    studies = parser.add_subparsers(dest="study", required=True, metavar="|".join(STUDIES))
    for name, (text, add, _) in STUDIES.items():
        sub = studies.add_parser(name, help=text)
        add(sub)
        sub.add_argument("--json", action="store_true", help="print JSON")
        add_log_options(sub, "warning")
    return parser


def _measure(args: argparse.Namespace) -> int:
    # The processes started here have to be ended.
    raise_from_now()
    with ProgressLine() as line:
        found, text = STUDIES[args.study][2](args, line.show)
    print(msgspec.json.encode(found).decode() if args.json else text)
    return int(args.study == "lines" and any(case.missed for case in found))


def _rows(say: Say) -> Callable[[str, int, int], None]:
    return lambda row, done, total: say(f"{row}: {done} of {total}")


def _add_rows(parser: argparse.ArgumentParser, option: str, rows: Sequence[str]) -> None:
    parser.add_argument(
        option, nargs="+", choices=rows, default=rows, metavar="ROW", help=f"only these ({', '.join(rows)})"
    )


def _add_world(parser: argparse.ArgumentParser) -> None:
    add_option(parser, "world", nargs="?", default="office", metavar="WORLD", help="a world")


def _add_seconds(parser: argparse.ArgumentParser, default: float, of: str = "simulated seconds") -> None:
    add_option(parser, "--seconds", typed=(1.0, MAX_SECONDS, "seconds"), default=default, metavar="S", help=of)


def _add_lines(parser: argparse.ArgumentParser) -> None:
    text = f"{', '.join(CASES)}, or a team file; NAME=VALUE are its arguments"
    parser.add_argument("what", nargs="+", metavar="CASE", help=text)
    text = "simulated seconds of each run (default: 900; 60 with --real-time)"
    add_option(parser, "--seconds", typed=(1.0, MAX_SECONDS, "simulated seconds"), metavar="N", help=text)
    parser.add_argument("--seeds", metavar="A-B", help="the runs' seeds (default: 1-24; 1 with --real-time)")
    text = "in real time, as the processes that zteam up starts, beside the same in lock-step"
    parser.add_argument("--real-time", action="store_true", help=text)
    text = "simulated seconds a second of the host, with --real-time (default: 1)"
    add_option(parser, "--speed", typed=(MIN_SPEED, MAX_SPEED, "simulated seconds a second"), metavar="X", help=text)
    parser.add_argument("--world", metavar="WORLD", help="drive in this world in the place of the team's own")
    text = "keep results here, a line of JSON each; what it has is not run again"
    parser.add_argument("--results", type=Path, metavar="FILE", help=text)
    add_option(parser, "--jobs", typed=(1, 1000, "runs"), metavar="N", help="runs at a time (default: one a core)")
    bounds = parser.add_argument_group("bounds", "exit code 1 if a case misses one, or if a run fails")
    for option, typed, metavar, text in (
        ("--contacts", (0, 10**9, "contacts"), "N", "at most so many, of all runs"),
        ("--stuck", (0, 10**9, "robots"), "N", "robots of narrow places, at most so many, of all runs"),
        ("--held", (0.0, 1.0, "a share"), "SHARE", "each follower in each run, at least"),
        ("--still", (0.0, MAX_SECONDS, "seconds"), "S", "seconds, at most"),
        ("--share", (0.0, 1.0, "a share"), "SHARE", "of the head's way, mean of the runs, at least"),
    ):
        add_option(bounds, option, typed=typed, metavar=metavar, help=text)


def tasks_of(args: argparse.Namespace) -> list[Task]:
    """The runs of `lines` that a command line asks for. Raises UsageError."""
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


def _lines(args: argparse.Namespace, say: Say) -> Shown:
    tasks = tasks_of(args)

    def run_all(tasks: Sequence[Task]) -> list[Row]:
        try:
            return run_study(tasks, args.results, args.jobs, lambda done, total: say(f"{done} of {total} runs"))
        except KeyboardInterrupt:
            if args.results is not None:
                print(f"studies: stopped: the same command goes on from {args.results}", file=sys.stderr)
            raise
        except OSError as error:
            raise ZteamError(f"--results {args.results}: {error.strerror or error}") from None

    # All of lock-step first: it would take processor time from runs in real time.
    lockstep = run_all([msgspec.structs.replace(task, speed=None) for task in tasks]) if args.real_time else []
    rows, bounds = run_all(tasks), Bounds(args.contacts, args.held, args.still, args.share, args.stuck)

    def of(what: str, rows: Sequence[Row]) -> list[Row]:
        return [row for row in rows if row.task.what == what]

    cases = dict.fromkeys(task.what for task in tasks)
    found = [summarize(of(what, rows), of(what, lockstep), bounds) for what in cases]
    return found, format_study(found)


def _add_robots(parser: argparse.ArgumentParser) -> None:
    text = "worlds to drive in (default: office)"
    parser.add_argument("worlds", nargs="*", default=["office"], metavar="WORLD", help=text)
    _add_rows(parser, "--rows", (*CHAINS, FORMATIONS))
    text = "drive only the first N tours; formations from the first N starts"
    add_option(parser, "--tours", typed=(1, 30, "tours"), metavar="N", help=text)
    text = "run each team in one process, several at once: the same figures"
    parser.add_argument("--in-process", action="store_true", help=text)


def _robots(args: argparse.Namespace, say: Say) -> Shown:
    rows = [row for row in args.rows if row != FORMATIONS]
    chains: list[Any] = []
    for world in map(find_world, args.worlds) if rows else ():
        chains += measure_chains(world, rows, args.tours, in_process=args.in_process, progress=_rows(say))
    if FORMATIONS not in args.rows:
        return chains, format_chains(chains)
    formations = measure_formations(args.tours, in_process=args.in_process, progress=_rows(say))
    return chains + formations, "\n\n".join(filter(None, [format_chains(chains), format_formations(formations)]))


def _add_navigation(parser: argparse.ArgumentParser) -> None:
    _add_world(parser)
    _add_rows(parser, "--rows", (*NAVIGATION, *TEAM_ROWS))
    text = "number of tours; two thirds as many random starts"
    add_option(parser, "--tours", typed=(1, 1000, "tours"), default=30, metavar="N", help=text)


def _navigation(args: argparse.Namespace, say: Say) -> Shown:
    found = list(measure_navigation(find_world(args.world), args.rows, args.tours, _rows(say)))
    return found, format_navigation(found)


def _add_faults(parser: argparse.ArgumentParser) -> None:
    add_option(parser, "team", nargs="?", default="chain", metavar="TEAM", help="a team")
    add_option(parser, "--seed", typed=(0, 2**63 - 1, "a seed"), default=1, metavar="N", help="of the plan")
    _add_seconds(parser, 600.0)
    parser.add_argument("--speed", metavar="X", help="not in lock-step but at this speed, or max")


def _faults(args: argparse.Namespace, say: Say) -> Shown:
    found = measure_faults(args.team, args.seed, args.seconds, args.speed, say)
    return found, msgspec.json.encode(found).decode()


def _add_view(parser: argparse.ArgumentParser) -> None:
    _add_world(parser)
    _add_seconds(parser, 10.0, "seconds of each measurement")
    add_option(parser, "--pairs", typed=(1, 100, "pairs"), default=10, metavar="N", help="pairs of runs")
    _add_rows(parser, "--parts", PARTS)


def _view(args: argparse.Namespace, say: Say) -> Shown:
    found = measure_view(find_world(args.world), args.seconds, args.pairs, tuple(args.parts), say)
    return found, format_view(found)


def _add_size(parser: argparse.ArgumentParser) -> None:
    _add_world(parser)
    add_option(parser, "--robots", typed=(1, 1000, "robots"), default=4, metavar="N", help="number of robots")
    add_option(parser, "--beams", typed=(2, 100_000, "beams"), default=1081, metavar="N", help="beams of a laser")


def _add_floor(parser: argparse.ArgumentParser) -> None:
    _add_size(parser)
    _add_seconds(parser, 20.0)


def _floor(args: argparse.Namespace, _say: Say) -> Shown:
    found = measure_floor(find_world(args.world), args.robots, args.beams, args.seconds)
    return found, format_floor(found)


def _hops(args: argparse.Namespace, _say: Say) -> Shown:
    found = measure_hops(find_world(args.world), args.robots, args.beams)
    return found, format_hops(found)


def _steps(args: argparse.Namespace, _say: Say) -> Shown:
    found = list(measure_steps(args.seconds))
    return found, format_steps(found)


def _add_freezes(parser: argparse.ArgumentParser) -> None:
    _add_rows(parser, "--processes", PROCESSES)
    _add_rows(parser, "--modes", tuple(MODES))
    parser.add_argument(
        "--seconds", nargs="+", type=option_type(parse_number, 1.0, 600.0, "seconds"), default=SECONDS, metavar="S"
    )
    parser.add_argument(
        "--seeds", nargs="+", type=option_type(parse_number, 0, 2**31, "a seed"), default=(1, 2), metavar="N"
    )


def _freezes(args: argparse.Namespace, say: Say) -> Shown:
    found = list(measure_freezes(args.processes, args.seconds, args.modes, args.seeds, say))
    return found, format_freezes(found)


def _add_recovery(parser: argparse.ArgumentParser) -> None:
    _add_rows(parser, "--faults", FAULTS)
    parser.add_argument("--lockstep", action="store_true", help="a team in lock-step, as fast as the host's clock")


def _recovery(args: argparse.Namespace, say: Say) -> Shown:
    found = measure_recovery(args.faults, args.lockstep, say)
    return found, format_recovery(found)


def _add_secure(parser: argparse.ArgumentParser) -> None:
    _add_seconds(parser, 60.0, "simulated seconds of each run")
    add_option(parser, "--rounds", typed=(1, 100, "rounds"), default=4, metavar="N", help="rounds")


def _secure(args: argparse.Namespace, say: Say) -> Shown:
    found = measure_secure(args.seconds, args.rounds, say)
    return found, format_secure(found)


STUDIES: dict[str, tuple[str, Add, Callable[[argparse.Namespace, Say], Shown]]] = {
    "lines": ("lines from many seeds: how well they hold and drive", _add_lines, _lines),
    "robots": ("how well robots follow each other, and hold formations", _add_robots, _robots),
    "nav": ("planning, costmaps, localisation, and robots that navigate", _add_navigation, _navigation),
    "faults": ("a team under random faults: recovery, violations, leaks, memory", _add_faults, _faults),
    "view": ("age of frames, memory, cost in lock-step, drawing", _add_view, _view),
    "floor": ("a team in lock-step beside bare Zenoh with the same messages", _add_floor, _floor),
    "hops": ("the steps of a tick, each alone", _add_size, _hops),
    "freezes": ("a line whose processes are frozen, each in turn", _add_freezes, _freezes),
    "recovery": ("a team whose processes are killed, each in turn", _add_recovery, _recovery),
    "secure": ("certificates: their cost, and how soon a revoked robot is out", _add_secure, _secure),
    "steps": (
        "a robot's step: velocity mux, behaviour and safety layer, scene by scene",
        lambda parser: _add_seconds(parser, 20.0, "simulated seconds of each scene"),
        _steps,
    ),
}
"""By name: what it measures, its options, and what runs it."""
