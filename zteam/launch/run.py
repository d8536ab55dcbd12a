"""Runs a team from start to end: router, processes, GO, a time limit, the report, an orderly stop."""

import logging
import os
import threading
from collections.abc import Callable
from pathlib import Path

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.connection import FROM_STDIN, port_accepts
from zteam.bus.options import DEFAULT_ENDPOINT
from zteam.clock import pause
from zteam.config import Team
from zteam.errors import BusError, ZteamError
from zteam.launch.plan import ROUTER, Pace, Plan, plan_team
from zteam.launch.process import Process, Usage, exit_text, measure_usage, zteam_command
from zteam.launch.report import (
    RunReport,
    read_dropped,
    read_rounds,
    read_sim_report,
    report_processes,
    seconds_since_start,
)
from zteam.launch.supervisor import Supervisor
from zteam.messages import TeamState, TeamStatus
from zteam.nodes.participant import RoundTiming
from zteam.nodes.sim_messages import FinishReply, FinishRequest, SimReport
from zteam.nodes.stopping import Stop

log = logging.getLogger("zteam")

ROUTER_DEADLINE = 20.0
"""Host seconds until the router listens; an interpreter has taken 2.2 s to start on a crowded machine."""

ANY_PORT = "tcp/127.0.0.1:0"


class RunOptions(msgspec.Struct, frozen=True):
    """What to run and for how long."""

    team: Team
    team_file: Path | None
    world: Path | None
    bus: BusOptions
    seed: int | None = None
    run_for: float | None = None
    """Simulated seconds after GO."""
    pace: Pace = Pace()


_FINISH_WAIT = 5.0
"""Host seconds that one question for the end of the run waits."""
LEASE_MARGIN = 5.0
"""Host seconds by which links in lock-step outlive its patience: a hung participant must not look dead before."""


def lease_for(pace: Pace, given: float) -> float:
    """The lease of all sessions of a team."""
    return max(given, pace.timeout + LEASE_MARGIN) if pace.lockstep else given


class Progress:
    """GO and the end of the run as the launcher hears them on the bus."""

    def __init__(self, bus: Bus, has_end: bool) -> None:
        self.changed = threading.Condition()
        self.go_after: float | None = None
        self.wall: float | None = None
        self._bus = bus
        self._closed = False
        bus.subscribe(names.TEAM_STATUS, TeamStatus, self._on_team_status, latched=True)
        if has_end:
            # The simulator says when the time is over: to listen to its clock would slow a fast run down.
            threading.Thread(target=self._watch_end, name="end of the run", daemon=True).start()

    def _on_team_status(self, _key: str, status: TeamStatus) -> None:
        if status.state == TeamState.GO and self.go_after is None:
            with self.changed:
                self.go_after = seconds_since_start()
                self.changed.notify_all()

    def _watch_end(self) -> None:
        key, request = names.service_key(names.SIMULATOR, "finish"), FinishRequest(timeout=_FINISH_WAIT)
        while not self._closed:
            try:
                answers = self._bus.query(key, FinishReply, request, timeout=_FINISH_WAIT + 2.0)
            except ZteamError as error:
                log.debug("%s", error)
                answers = []
            if any(answer.finished for _, answer in answers):
                with self.changed:
                    self.wall = seconds_since_start()
                    self.changed.notify_all()
                return
            if not answers:
                # No simulator yet; nothing tells when its query is there.
                pause(0.1)

    def close(self) -> None:
        """Ask no more."""
        self._closed = True

    def wake(self) -> None:
        """Let whoever waits on `changed` look again."""
        with self.changed:
            self.changed.notify_all()


def choose_endpoint() -> str:
    """Where the team's router listens: the default port, so that tools find it; another one if that is taken."""
    return ANY_PORT if port_accepts(DEFAULT_ENDPOINT, timeout=0.2) else DEFAULT_ENDPOINT


def _is_endpoint(line: str) -> bool:
    """Whether a line of the router's output is its announcement, and no line of its log."""
    return line.startswith(("tcp/", "tls/"))


class Run:
    """One run of a team. Use as: `with Run(...) as run: run.start(); run.watch(); report = run.finish()`."""

    def __init__(self, options: RunOptions, stop: Stop, on_line: Callable[[str, str], None]) -> None:
        self._options = options
        self._stop = stop
        self._hurry = False
        self._own = Usage()
        self._report: SimReport | None = None
        self._dropped: dict[str, int] = {}
        self._rounds: dict[str, RoundTiming] = {}
        self._progress: Progress | None = None
        self._bus: Bus | None = None
        self.endpoint = options.bus.connect or ""
        self.plan = self._make_plan()
        self.supervisor = Supervisor(on_line, self._on_failure)
        stop.on_request(self._wake)

    def _make_plan(self) -> Plan:
        options = self._options
        bus = ["--connect", options.bus.connect or FROM_STDIN]
        if options.bus.namespace:
            bus += ["--namespace", options.bus.namespace]
        if options.bus.config:
            bus += ["--config", options.bus.config]
        bus += ["--lease", str(lease_for(options.pace, options.bus.lease))]
        return plan_team(
            options.team,
            options.world,
            bus,
            team_file=options.team_file,
            seed=options.seed,
            run_for=options.run_for,
            pace=options.pace,
        )

    def __enter__(self) -> "Run":
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._stop_all()
        finally:
            if self._progress is not None:
                self._progress.close()
            if self._bus is not None:
                self._bus.close()
            self.supervisor.close()

    def _wake(self) -> None:
        if self._progress is not None:
            self._progress.wake()
        with self.supervisor.changed:
            self.supervisor.changed.notify_all()

    def hurry(self) -> None:
        """Stop without grace: the user asked a second time."""
        self._hurry = True
        self._wake()

    def _on_failure(self, process: Process) -> None:
        log.error("%s ended: %s; it is not started again", process.name, exit_text(process.exit_code))
        self._wake()

    def start(self) -> None:
        """Start everything at once; the processes import while the router comes up."""
        supervisor = self.supervisor
        if self._options.bus.connect is None:
            self._start_router()
        for name, command in self.plan.commands.items():
            supervisor.start(name, command)
        if self._options.bus.connect is None:
            self._wait_for_router()
            for name in self.plan.commands:
                supervisor.processes[name].write_line(self.endpoint)
        bus = BusOptions(connect=self.endpoint, namespace=self._options.bus.namespace, config=self._options.bus.config)
        self._bus = connect(bus, stopping=self._stop, patience=ROUTER_DEADLINE)
        self._progress = Progress(self._bus, self._options.run_for is not None)
        if self._stop.requested:
            self._wake()

    def _start_router(self) -> None:
        listen = choose_endpoint()
        self.supervisor.start(ROUTER, zteam_command("router", "--listen", listen, "--announce"))

    def _wait_for_router(self) -> None:
        router = self.supervisor.processes[ROUTER]

        def settled() -> bool:
            return self._stop.requested or not router.running or any(map(_is_endpoint, router.lines))

        self.supervisor.wait(settled, ROUTER_DEADLINE)
        announced = list(filter(_is_endpoint, router.lines))
        if not announced and not self._stop.requested and not router.running:
            # Another router took the port between the look and the bind: any port will do.
            router.join(ROUTER_DEADLINE)
            router = self.supervisor.start(ROUTER, zteam_command("router", "--listen", ANY_PORT, "--announce"))
            self.supervisor.failures.clear()
            self.supervisor.wait(settled, ROUTER_DEADLINE)
            announced = list(filter(_is_endpoint, router.lines))
        if not announced:
            raise BusError(
                "stopped" if self._stop.requested else f"the router did not start: {list(router.lines)[-1:]}"
            )
        self.endpoint = announced[0]

    def watch(self) -> None:
        """Wait for the end of the time asked for, or for the stop request. Raises ZteamError if it cannot come."""
        progress = self._progress
        assert progress is not None
        with progress.changed:
            while not self._stop.requested and progress.wall is None:
                ended = {p.name for p in self.supervisor.processes.values() if not p.running}
                if self._options.run_for is not None and ended & {ROUTER, names.SIMULATOR}:
                    raise ZteamError(f"{', '.join(sorted(ended))} ended: the run cannot be finished")
                if len(ended) == len(self.supervisor.processes):
                    return
                progress.changed.wait(1.0)

    def finish(self) -> RunReport | None:
        """Collect the counts, stop everything in order, and report; None where there is nothing to report."""
        bus, progress = self._bus, self._progress
        if bus is not None and self._options.world is not None and not self._stop.requested:
            self._report = read_sim_report(bus)
            self._dropped = read_dropped(bus)
            self._rounds = read_rounds(bus) if self._report.lockstep else {}
        self._stop_all()
        if self._report is None or progress is None:
            return None
        counted = self._report
        return RunReport(
            sim_seconds=counted.sim_seconds,
            wall_seconds=round(progress.wall or seconds_since_start(), 3),
            go_after_seconds=None if progress.go_after is None else round(progress.go_after, 3),
            seed=counted.seed,
            external_commands=counted.external_commands,
            robots=counted.robots,
            processes=report_processes(self.supervisor.processes, "up", self._own),
            dropped=self._dropped,
            latency_ms=msgspec.structs.asdict(counted.latency_ms),
            ticks=counted.ticks,
            rtf=counted.real_time_factor,
            trajectory_sha256=counted.trajectory_sha256,
            lockstep=counted.lockstep,
            resends=counted.resends,
            hung=counted.hung,
            timing_ms=counted.timing_ms,
            lateness_p99_ms=counted.lateness_p99_ms,
            rounds=self._rounds,
        )

    def _stop_all(self) -> None:
        self.supervisor.measure()
        if any(process.running for process in self.supervisor.processes.values()):
            # Later the pages that are shared with the others would all count as the launcher's.
            measure_usage(os.getpid(), self._own)
        for group in self.plan.stop_order():
            self.supervisor.stop(group, lambda: self._hurry)
