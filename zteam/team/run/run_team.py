"""`zteam.run_team`: a whole team in the caller's own process, in lock-step."""

import threading
from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from zteam.bus import BusOptions
from zteam.clock import monotonic
from zteam.config.resources import find_team, find_world
from zteam.errors import UsageError, ZteamError, log
from zteam.node.shutdown import Stop
from zteam.robot.behaviors.registry import look_in, read_anew
from zteam.team.arguments import checks_arguments
from zteam.team.file.reading import read_team_file, set_map_resolution
from zteam.team.file.sources import argument_texts
from zteam.team.launch.check import check_team, refuse_nodes
from zteam.team.launch.plan import Pace, TeamLaunch, with_faults, with_recording
from zteam.team.launch.process import exit_text
from zteam.team.run.processes import warn_of_endpoint
from zteam.team.run.report import RunReport
from zteam.team.run.team_run import TeamRun
from zteam.team.run.threads import Body, NodeThread, Threads


@checks_arguments("")
def run_team(
    team: str | Path,
    *,
    seconds: float | None = None,
    until: int | None = None,
    seed: int | None = None,
    world: str | Path | None = None,
    nodes: Mapping[str, Body] | None = None,
    bus: BusOptions | None = None,
    arguments: Mapping[str, Any] | None = None,
    chaos: str | Path | None = None,
    map_resolution: float | None = None,
    record: str | Path | None = None,
) -> RunReport:
    """Run a team file or shipped team in this process, in lock-step and as fast as possible; the report of the run.

    The run ends `seconds` simulated seconds after GO, or before tick `until`. `seed`, `world` and `map_resolution` (m a
    cell) replace those of the team file. `nodes` are own nodes by name, each a `body(node)` as for `zteam.run`; the
    first tick waits for them. `arguments` are the team file's, by name. With `bus`, such as
    `BusOptions.from_environment()`, tools and other processes find the team there while it runs. `chaos` is a plan of
    faults, which are in the report. `record` is a new file for a recording of the run (docs/recording.md).

    Raises what ended a node of the team: an error of a behaviour or of an own node ends the run. Called in the main
    thread, it takes SIGINT and SIGTERM; Ctrl+C ends the run in order and raises KeyboardInterrupt.
    """
    began = monotonic()
    if seconds is None and until is None:
        raise UsageError("run_team: give seconds or until: without an end there is no report")
    file = read_team_file(find_team(team), argument_texts(arguments or {}))
    set_map_resolution(file, map_resolution)
    read_anew()
    look_in([*file.team.folders, ""])
    chosen = check_team(file, find_world(world) if world is not None else None, here=True)
    if bus is None:
        refuse_nodes(file, "give run_team a bus, or use zteam up")
    if chosen is None:
        raise UsageError('run_team needs a simulator: this team has none (world = "none")')
    pace = Pace(lockstep=True, expect=tuple(nodes or ()))
    launch = TeamLaunch(file.team, chosen.resolve(), seed, file.path, seconds, until, pace)
    if record is not None:
        launch = with_recording(launch, Path(record), "zteam.run_team", force=False)
    if chaos is not None:
        launch = with_faults(launch, str(chaos), here=True)
    stop, signals = Stop(), Stop()
    signals.on_request(lambda: stop.request(signals.reason))

    def carry_out() -> RunReport | None:
        run.start()
        run.watch()
        return run.finish()

    with (
        signals.install() if threading.current_thread() is threading.main_thread() else nullcontext(),
        TeamRun(
            members := Threads(nodes, bus, stop, prefix_log=True),
            launch,
            stop,
            on_end=lambda node: stop.request(f"{node.name} ended"),
            since_start=lambda: monotonic() - began,
        ) as run,
    ):
        run.open()
        if bus is not None:
            log.info("router at %s", members.endpoint)
            warn_of_endpoint(members.endpoint, bus.connect)
        report = members.beside_simulator(carry_out)
    for text in members.hangs.values():
        raise ZteamError(text)
    for node in members.supervisor.failures:
        if isinstance(node, NodeThread):
            raise node.error or ZteamError(f"{node.name} ended: {exit_text(node.exit_code)}")
    if report is None:
        raise KeyboardInterrupt
    return report
