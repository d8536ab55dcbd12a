"""`zteam up [TEAM]`: starts a whole team and watches over it; Ctrl+C stops it in order, a second one at once."""

import argparse
import logging
import os
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from zteam.cli.options import MAX_SEED, MIN_SEED, Parser, add_bus_options, bus_options, number, run, whole
from zteam.cli.zteam_sim import LOCKSTEP_TIMEOUTS, MIN_RUN
from zteam.errors import UsageError, ZteamError
from zteam.numbers import MAX_SECONDS
from zteam.resources import find_team, find_world

if TYPE_CHECKING:
    from zteam.launch.arguments import Pace
    from zteam.launch.run import Run
    from zteam.runtime.shutdown import Stop

log = logging.getLogger("zteam")

_COLORS = (36, 32, 33, 35, 34, 96, 92, 93, 95, 94)


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="zteam up", description=__doc__)
    parser.add_argument("team", nargs="?", default="line", help="a team file, or the name of a shipped one (line)")
    parser.add_argument("--world", metavar="FILE", help="a world file or shipped world, instead of the team file's")
    parser.add_argument("--seed", type=whole(MIN_SEED, MAX_SEED, "a seed"), help="instead of the team file's")
    parser.add_argument(
        "--for",
        dest="run_for",
        type=number(MIN_RUN, MAX_SECONDS, "simulated seconds"),
        metavar="SECONDS",
        help="end this many simulated seconds after GO",
    )
    parser.add_argument("--report", metavar="FILE", help="with --for: write the run's report as JSON")
    parser.add_argument("--speed", metavar="X", help="simulated seconds a second, or max (1; max in lock-step)")
    parser.add_argument(
        "--lockstep", action="store_true", help="tick by tick: the same seed gives the same run, as fast as it can"
    )
    parser.add_argument(
        "--lockstep-timeout",
        type=number(*LOCKSTEP_TIMEOUTS, "host seconds"),
        default=10.0,
        metavar="SECONDS",
        help="leave a living process behind that does not answer for so long (10)",
    )
    parser.add_argument(
        "--expect", nargs="+", default=[], metavar="NAME", help="own nodes that lock-step waits for at the start"
    )
    add_bus_options(parser)
    return parser


def _pace(args: argparse.Namespace, world: Path | None) -> "Pace":
    from zteam.cli.zteam_sim import parse_speed
    from zteam.launch.arguments import Pace

    if args.speed is not None:
        parse_speed(args.speed)
    if args.expect and not args.lockstep:
        raise UsageError("--expect needs --lockstep")
    if world is None and (args.lockstep or args.speed is not None):
        raise UsageError('--lockstep and --speed need a simulator: this team has none (world = "none")')
    return Pace(args.speed, args.lockstep, args.lockstep_timeout, tuple(args.expect))


def _check_writable(path: Path) -> None:
    """Raise UsageError where a report could not be written, before the run and not after it."""
    if path.is_dir() or not path.parent.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
        raise UsageError(f"--report {path}: no file can be written there")


class Printer:
    """Lines of all processes on one output, each behind its process's name, coloured on a terminal."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._color = sys.stdout.isatty() and "NO_COLOR" not in os.environ
        self._seen: dict[str, int] = {}

    def line(self, name: str, text: str) -> None:
        """Print one line of the process `name`."""
        with self._lock:
            number = self._seen.setdefault(name, len(self._seen))
            color = _COLORS[number % len(_COLORS)]
            prefix = f"\033[{color}m[{name}]\033[0m" if self._color else f"[{name}]"
            print(f"{prefix} {_without_own_name(name, text)}", flush=True)


def _without_own_name(name: str, text: str) -> str:
    return text.replace(f" [{name}]", "", 1)


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(argv)
    return run("up", args, lambda: _up(args), needs_output=False)


def _up(args: argparse.Namespace) -> int:
    from zteam.launch.check import check_team
    from zteam.launch.run import Run, RunOptions
    from zteam.runtime.shutdown import Stop
    from zteam.team_file import read_team_file

    if args.report and args.run_for is None:
        raise UsageError("--report needs --for SECONDS: a report is of a run with an end")
    bus = bus_options(args)
    if args.report:
        _check_writable(Path(args.report))
    file = read_team_file(find_team(args.team))
    world = check_team(file, find_world(args.world) if args.world else None)
    if world is None and args.run_for is not None:
        raise UsageError('--for needs a simulator: this team has none (world = "none")')
    options = RunOptions(
        file.team, file.path, world.resolve() if world else None, bus, args.seed, args.run_for, _pace(args, world)
    )
    stop = Stop()
    with Run(options, stop, Printer().line) as team_run:
        stop.install(on_repeat=team_run.hurry)
        return _run(team_run, stop, args)


def _run(team_run: "Run", stop: "Stop", args: argparse.Namespace) -> int:
    import msgspec

    from zteam.launch.report import format_report, write_report

    try:
        team_run.start()
        log.info("%d processes, router at %s; Ctrl+C stops them", len(team_run.plan.commands), team_run.endpoint)
        team_run.watch()
        report = team_run.finish()
    except ZteamError as error:
        if stop.requested:
            return 0
        raise error
    if stop.requested and args.run_for is not None:
        # Interrupted: a script that waits for the report must not take this for success.
        return 130
    if report is not None and args.run_for is not None:
        print(format_report(report))
        if args.report:
            write_report(Path(args.report), msgspec.json.format(msgspec.json.encode(report), indent=2) + b"\n")
    failed = sorted({process.name for process in team_run.supervisor.failures})
    if failed:
        raise ZteamError(f"{', '.join(failed)} failed: see the log above")
    return 0


if __name__ == "__main__":
    sys.exit(main())
