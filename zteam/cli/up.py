"""`zteam up [TEAM]`: start and supervise a whole team; Ctrl+C stops it in order, a second Ctrl+C at once."""

import argparse
import logging
import os
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from zteam.cli.arguments import LOCKSTEP_TIMEOUTS, MAX_SEED, MIN_RUN, MIN_SEED, number, parse_speed, whole
from zteam.cli.options import Parser, add_bus_options, bus_options, checked, run
from zteam.errors import UsageError, ZteamError
from zteam.numbers import MAX_SECONDS, counted
from zteam.resources import find_team, find_world

if TYPE_CHECKING:
    from zteam.cli.up_display import Display
    from zteam.launch.arguments import Pace
    from zteam.launch.report import RunReport
    from zteam.launch.run import Run
    from zteam.runtime.shutdown import Stop
    from zteam.team_file import Team

log = logging.getLogger("zteam")

_COLORS = (36, 32, 33, 35, 34, 96, 92, 93, 95, 94)


def build_parser() -> argparse.ArgumentParser:
    """The command line."""
    parser = Parser(prog="zteam up", description=__doc__)
    parser.add_argument(
        "team", nargs="?", default="line", help="a team file, or the name of a shipped one (default: %(default)s)"
    )
    parser.add_argument(
        "--world", metavar="FILE", help="use this world file or shipped world (default: the team file's)"
    )
    parser.add_argument(
        "--seed", type=whole(MIN_SEED, MAX_SEED, "a seed"), help="use this seed (default: the team file's)"
    )
    parser.add_argument(
        "--for",
        dest="run_for",
        type=number(MIN_RUN, MAX_SECONDS, "simulated seconds"),
        metavar="SECONDS",
        help="end this many simulated seconds after GO",
    )
    parser.add_argument("--report", metavar="FILE", help="write the run's report as JSON; needs --for")
    parser.add_argument(
        "--speed", metavar="X", help="simulated seconds per host second, or max (default: 1; max in lock-step)"
    )
    _add_lockstep_options(parser)
    add_bus_options(parser)
    return parser


def _add_lockstep_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--lockstep", action="store_true", help="wait for every process in each tick: equal seeds give equal runs"
    )
    parser.add_argument(
        "--lockstep-timeout",
        type=number(*LOCKSTEP_TIMEOUTS, "host seconds"),
        default=10.0,
        metavar="SECONDS",
        help="stop waiting for a live process that does not answer for so long (default: %(default)g)",
    )
    parser.add_argument(
        "--expect",
        nargs="+",
        default=[],
        metavar="NAME",
        help="wait for these nodes of your own before the first tick; needs --lockstep",
    )


def _check_options(args: argparse.Namespace) -> None:
    """Raise UsageError if an option is wrong, or needs another one."""
    if args.speed is not None:
        parse_speed(args.speed)
    if args.expect and not args.lockstep:
        raise UsageError("--expect needs --lockstep")
    if args.report and args.run_for is None:
        raise UsageError("--report needs --for SECONDS: only a run with an end has a report")


def _pace(args: argparse.Namespace, world: Path | None) -> "Pace":
    from zteam.launch.arguments import Pace

    if world is None and (args.lockstep or args.speed is not None):
        raise UsageError('--lockstep and --speed need a simulator: this team has none (world = "none")')
    return Pace(args.speed, args.lockstep, args.lockstep_timeout, tuple(args.expect))


class Printer:
    """Prints the lines of all processes, each after the name of its process; coloured on a terminal."""

    def __init__(self, write: Callable[[str], None]) -> None:
        self._write = write
        self._lock = threading.Lock()
        self._color = sys.stdout.isatty() and "NO_COLOR" not in os.environ
        self._seen: dict[str, int] = {}

    def line(self, name: str, text: str) -> None:
        """Print one line of the process `name`."""
        with self._lock:
            number = self._seen.setdefault(name, len(self._seen))
            color = _COLORS[number % len(_COLORS)]
            prefix = f"\033[{color}m[{name}]\033[0m" if self._color else f"[{name}]"
            self._write(f"{prefix} {_without_own_name(name, text)}")


def _without_own_name(name: str, text: str) -> str:
    return text.replace(f" [{name}]", "", 1)


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = build_parser().parse_args(argv)
    checked(args, lambda: _check_options(args))
    return run("up", args, lambda: _up(args), needs_output=False)


def _up(args: argparse.Namespace) -> int:
    from zteam.cli.up_display import open_display
    from zteam.launch.check import check_team
    from zteam.launch.report import check_writable
    from zteam.launch.run import Run, RunOptions
    from zteam.runtime.shutdown import Stop
    from zteam.team_file import read_team_file

    bus = bus_options(args)
    if args.report:
        check_writable(Path(args.report))
    file = read_team_file(find_team(args.team))
    world = check_team(file, find_world(args.world) if args.world else None)
    if world is None and args.run_for is not None:
        raise UsageError('--for needs a simulator: this team has none (world = "none")')
    if args.seed is not None:
        _note_unused_seed(args.seed, file.team, world)
    options = RunOptions(
        file.team, file.path, world.resolve() if world else None, bus, args.seed, args.run_for, _pace(args, world)
    )
    stop = Stop()
    with ExitStack() as stack:
        display = stack.enter_context(open_display(args.log_format, args.run_for))
        team_run = stack.enter_context(Run(options, stop, Printer(display.print).line))
        stop.install(on_repeat=team_run.hurry)
        try:
            report = _run(team_run, display, args.connect)
        except ZteamError:
            if stop.requested:
                return 0
            raise
    return _conclude(team_run, report, stop, args)


def _note_unused_seed(seed: int, team: "Team", world: Path | None) -> None:
    from zteam.launch.randomness import random_parts
    from zteam.world import load_world

    if not random_parts(team, load_world(world) if world else None):
        log.info(
            "--seed %d changes nothing: this team draws no random numbers (noise of lasers or odometry, dazzle, "
            "the behaviour wander, behaviours of your own)",
            seed,
        )


def _run(team_run: "Run", display: "Display", connect: str | None) -> "RunReport | None":
    from zteam.bus.options import DEFAULT_ENDPOINT

    processes = counted(len(team_run.plan.commands), "process", "processes")
    display.say(f"starting {processes}")
    team_run.start()
    log.info("%s, router at %s; Ctrl+C stops them", processes, team_run.endpoint)
    if connect is None and team_run.endpoint != DEFAULT_ENDPOINT:
        log.warning(
            "%s is in use; for tools and nodes of this team: export ZTEAM_CONNECT=%s",
            DEFAULT_ENDPOINT, team_run.endpoint,
        )  # fmt: skip
    with display.following(team_run.team_watch):
        team_run.watch()
    display.say("stopping")
    return team_run.finish()


def _conclude(team_run: "Run", report: "RunReport | None", stop: "Stop", args: argparse.Namespace) -> int:
    import msgspec

    from zteam.launch.report import format_report, write_report

    if stop.requested and args.run_for is not None:
        # There is no report: a script must not take this for success.
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
