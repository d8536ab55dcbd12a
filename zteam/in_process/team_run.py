"""`zteam.run_team`: a whole team in the caller's own process, in lock-step."""

import logging
import threading
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from zteam.clock import monotonic
from zteam.errors import UsageError, ZteamError
from zteam.in_process.run import Body, InProcessRun, NodeThread, Outside
from zteam.in_process.user_calls import prefixing_lines
from zteam.launch.check import check_team, refuse_nodes
from zteam.launch.kinds import Pace, TeamLaunch
from zteam.launch.process import exit_text
from zteam.launch.report import RunReport
from zteam.resources import find_team, find_world
from zteam.runtime.shutdown import Stop, stopping_in_order
from zteam.team_file.reading import read_team_file
from zteam.team_file.sources import argument_texts

if TYPE_CHECKING:
    from zteam.bus import BusOptions
log = logging.getLogger("zteam")


def run_team(
    team: str | Path,
    *,
    seconds: float | None = None,
    until: int | None = None,
    seed: int | None = None,
    world: str | Path | None = None,
    nodes: Mapping[str, Body] | None = None,
    bus: "BusOptions | None" = None,
    arguments: Mapping[str, Any] | None = None,
) -> RunReport:
    """Run a team file or shipped team in this process, in lock-step and as fast as possible; the report of the run.

    The run ends `seconds` simulated seconds after GO, or before tick `until`. `seed` and `world` replace those of the
    team file. `nodes` are own nodes by name, each a `body(node)` as for `zteam.run`; the first tick waits for them.
    `arguments` are the team file's, by name. With `bus`, such as `BusOptions.from_environment()`, tools and other
    processes find the team there while it runs.

    Raises what ended a node of the team: an error of a behaviour or of an own node ends the run. Called in the main
    thread, it takes SIGINT and SIGTERM; Ctrl+C ends the run in order and raises KeyboardInterrupt.
    """
    began = monotonic()
    launch = _launch(team, world, seed, seconds, until, nodes or {}, arguments or {}, has_bus=bus is not None)
    stop, signals = Stop(), Stop()
    signals.on_request(lambda: stop.request(signals.reason))

    def on_end(node: NodeThread) -> None:
        stop.request(f"{node.name} ended")

    in_main = threading.current_thread() is threading.main_thread()
    with (
        nullcontext() if bus is None else _open_outside(bus, launch.pace) as outside,
        stopping_in_order(signals) if in_main else nullcontext(),
        InProcessRun(launch, stop, _say_nothing, nodes, lambda: monotonic() - began, on_end, outside) as run,
        prefixing_lines(),
    ):
        report = run.beside_simulator(lambda: _carry_out(run))
    return _checked(run, report)


def _launch(
    team: str | Path,
    world: str | Path | None,
    seed: int | None,
    seconds: float | None,
    until: int | None,
    nodes: Mapping[str, Body],
    arguments: Mapping[str, Any],
    *,
    has_bus: bool,
) -> TeamLaunch:
    if seconds is None and until is None:
        raise UsageError("run_team: give seconds or until: without an end there is no report")
    path = find_team(team)
    file = read_team_file(path, argument_texts(arguments))
    chosen = check_team(file, find_world(world) if world is not None else None)
    if not has_bus:
        refuse_nodes(file, "give run_team a bus, or use zteam up")
    if chosen is None:
        raise UsageError('run_team needs a simulator: this team has none (world = "none")')
    pace = Pace(lockstep=True, expect=tuple(nodes))
    return TeamLaunch(
        file.team, chosen.resolve(), seed, team_file=path.resolve(), run_for=seconds, until=until, pace=pace
    )


def _open_outside(bus: "BusOptions", pace: Pace) -> Outside:
    outside = Outside(bus, pace)
    log.info("router at %s", outside.endpoint)
    outside.warn_of_endpoint()
    return outside


def _say_nothing(_name: str, _text: str) -> None:
    """The monitor's events reach the log on the bus; a program has no use for its table."""


def _carry_out(run: InProcessRun) -> RunReport | None:
    run.start()
    run.watch()
    return run.finish()


def _checked(run: InProcessRun, report: RunReport | None) -> RunReport:
    for name in run.calls.hung:
        raise ZteamError(f"{name}: a call of its own code did not return: see the log above")
    for node in run.failures:
        raise node.error or ZteamError(f"{node.name} ended: {exit_text(node.exit_code)}")
    if report is None:
        raise KeyboardInterrupt
    return report
