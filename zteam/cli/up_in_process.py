"""`zteam up --in-process`: the whole team in this process, with the same lines as with one process each."""

import argparse
import gc
import os
import sys
from contextlib import nullcontext
from typing import TYPE_CHECKING

from zteam import names
from zteam.cli.up import conclude, log
from zteam.cli.up_display import Display, Printer, open_display
from zteam.errors import ZteamError
from zteam.in_process.run import InProcessRun
from zteam.numbers import counted
from zteam.runtime.logs import passing_lines
from zteam.runtime.shutdown import Stop, exit_hard_later

if TYPE_CHECKING:
    from zteam.bus import BusOptions
    from zteam.in_process.run import Outside
    from zteam.launch.kinds import Pace, TeamLaunch
    from zteam.launch.report import RunReport


def carry_out(launch: "TeamLaunch", bus: "BusOptions", args: argparse.Namespace) -> int:
    """Run the team to its end; the exit code."""
    stop = Stop()
    with (
        open_display(args.log_format, args.run_for) as display,
        _open_outside(bus, launch.pace) if args.bus else nullcontext() as outside,
    ):
        line = Printer(display.print).line
        _give_terminal_to_debugger(display)
        with passing_lines(line, names.LAUNCHER), InProcessRun(launch, stop, line, outside=outside) as team_run:
            give_back = stop.install(on_repeat=_end_now)
            # Code of a behaviour that does not return holds the whole process.
            cancel = exit_hard_later(stop, hung=1)
            try:
                report = team_run.beside_simulator(lambda: _run(team_run, display, outside, args.go_timeout))
            except ZteamError:
                if not stop.requested:
                    raise
                return 0
        cancel()
        give_back()
    return conclude(team_run.failed, report, stop, launch.has_end, args.report)


def _open_outside(bus: "BusOptions", pace: "Pace") -> "Outside":
    from zteam.in_process.run import Outside

    return Outside(bus, pace)


def _run(
    team_run: InProcessRun, display: Display, outside: "Outside | None", go_timeout: float | None
) -> "RunReport | None":
    nodes = counted(len(team_run.parts), "node")
    display.say(f"starting {nodes}")
    team_run.start()
    where = "without a router" if outside is None else f"router at {outside.endpoint}"
    log.info("%s in this process, %s; Ctrl+C stops them", nodes, where)
    if outside is not None:
        outside.warn_of_endpoint()
    gc.freeze()
    with display.following(team_run.team_overview):
        team_run.watch(go_timeout)
    display.say("stopping")
    return team_run.finish()


def _give_terminal_to_debugger(display: Display) -> None:
    """Draw no live line from the first `breakpoint()` on. A hook of `breakpoint` itself would show up in its stack."""

    def hear(event: str, _arguments: object) -> None:
        if event == "builtins.breakpoint":
            display.leave_terminal()

    sys.addaudithook(hear)


def _end_now() -> None:
    """The user asked a second time."""
    os._exit(130)
