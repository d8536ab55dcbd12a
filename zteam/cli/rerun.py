"""`zteam rerun FILE.mcap`: run a recording again, as processes or in this process, and compare each tick."""

import argparse
import os
import shlex
import sys
import tempfile
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from zteam.cli.interrupts import INTERRUPTED
from zteam.cli.options import (
    Parser,
    add_bus_options,
    add_go_timeout_option,
    add_option,
    bus_options,
    check_together,
    run_tool,
)
from zteam.config.numbers import counted
from zteam.config.resources import find_team
from zteam.errors import UsageError, ZteamError, log
from zteam.names import RECORDER, TICK
from zteam.node.output import print_line

if TYPE_CHECKING:
    from zteam.team.launch.plan import TeamLaunch
    from zteam.team.run.team_run import TeamRun

DIFFERENT, NOT_RUN = 1, 2
"""Exit codes."""


def build_parser() -> Parser:
    parser = Parser(prog="zteam rerun", description=__doc__, epilog="docs/recording.md says what repeats.")
    parser.add_argument("file", type=Path, metavar="FILE.mcap", help="a recording of a run in lock-step")
    parser.add_argument("--in-process", action="store_true", help="run the whole team in this process")
    parser.add_argument("--bus", action="store_true", help="open a team with --in-process to tools, at a router")
    parser.add_argument("--team", metavar="FILE", help="give the same inputs to this team instead")
    text = "pause after this tick, for tools and the page"
    add_option(parser, "--pause-at", typed=(1, 10**12, "a tick"), metavar="TICK", help=text)
    parser.add_argument("--keep", type=Path, metavar="FILE.mcap", help="keep the recording of the second run")
    add_go_timeout_option(parser)
    add_bus_options(parser)
    # Of `zteam up`, whose run it is.
    parser.set_defaults(run_for=None, chaos=None, secure=None, listen=None, report=None)
    return parser


def _rerun(args: argparse.Namespace) -> int:
    from zteam.record.again import read_run
    from zteam.simulator.recorded_ticks import write_ticks
    from zteam.team.file.reading import read_team_file
    from zteam.team.launch.check import check_team
    from zteam.team.launch.plan import options_of, with_recording
    from zteam.team.launch.recorded import restore
    from zteam.team.run.again import end_again
    from zteam.version import __version__

    run = read_run(args.file)
    if run.version != __version__:
        log.warning("%s is of zteam %s, and this is %s", args.file, run.version, __version__)
    with tempfile.TemporaryDirectory() as folder:
        try:
            launch, changed = restore(run.contents, Path(folder))
        except UsageError as error:
            raise UsageError(f"{args.file}: cannot be run again: {error}") from None
        for name in changed:
            log.warning("the source of %s is another one than that of the recording", name)
        if args.team:
            file = read_team_file(find_team(args.team))
            world = check_team(file)
            if world is None:
                raise UsageError(f"{args.team}: real robots cannot be run again")
            launch = msgspec.structs.replace(launch, team=file.team, team_file=file.path, world=world.resolve())
        if args.in_process and not args.bus and launch.team.nodes:
            raise UsageError("a node is a process, which cannot reach a team in one process: say --bus too")
        took_part = frozenset[str]().union(*(each.members for each in run.ticks.values()))
        started = {*options_of(launch), *(node.name for node in launch.team.nodes), RECORDER}
        if unknown := took_part - started:
            joined = ", ".join(sorted(unknown))
            raise UsageError(
                f"{args.file}: cannot be run again: {joined} joined by hand, or was a function of a program"
            )
        ticks, made = Path(folder, "ticks"), args.keep or Path(folder, "again.mcap")
        write_ticks(ticks, run.sent)
        # The first tick waits for those that took part in it.
        pace = msgspec.structs.replace(
            launch.pace,
            speed=None,
            paused=False,
            expect=tuple(run.ticks[1].members & started),
            recorded=ticks,
            pause_at=args.pause_at,
        )
        faults = tuple(filter(launch.is_simulated, launch.faults))
        launch = msgspec.structs.replace(launch, pace=pace, run_for=None, until=run.last + 1, faults=faults)
        launch = with_recording(launch, made, shlex.join(["zteam", *sys.argv[1:]]), force=False)
        try:
            code = _run(launch, args, lambda team: end_again(team, run.ticks))
        except ZteamError as error:
            # Not 1, which says that the runs differ.
            raise UsageError(str(error)) from None
        # A pause is ended by hand.
        if code and (args.pause_at is None or code != INTERRUPTED):
            return NOT_RUN
        return _compare(args.file, made, is_part=args.pause_at is not None)


def _run(launch: "TeamLaunch", args: argparse.Namespace, on_start: "Callable[[TeamRun], None]") -> int:
    from zteam.cli.up import run_launch

    if args.in_process:
        return run_launch(launch, bus_options(args), args, None, on_start)
    from zteam.team.launch.warm_parent import WarmParent

    with closing(WarmParent()) as parent:
        parent.prepare()
        return run_launch(launch, bus_options(args), args, parent, on_start)


def _compare(recorded: Path, made: Path, *, is_part: bool) -> int:
    """Print how they compare; `is_part`: the second run may have ended earlier. The exit code."""
    from zteam.record.comparing import compare
    from zteam.record.recording import Recording

    last = max((entry.tick for entry in Recording(made).entries(TICK)), default=0)
    found = compare(recorded, made, until=last if is_part else None)
    # Those of the first file are known already.
    for note in found.notes:
        log.warning("%s", note)
    if found.difference is None:
        print_line(f"{counted(found.ticks, 'tick')}, the same")
        return 0
    print_line(f"the runs differ (A: {recorded}, B: this one): {found.difference.text}")
    return DIFFERENT


def _check(args: argparse.Namespace) -> None:
    check_together(args, {"--bus": ("--in-process",)}, {})
    asks_to_connect = (args.connect or "") != os.environ.get("ZTEAM_CONNECT", "")
    if args.in_process and not args.bus and asks_to_connect:
        raise UsageError("--connect needs processes, or --bus: none can join a team with --in-process")


main = partial(run_tool, build_parser, _rerun, name="rerun", read=_check, needs_output=False)
