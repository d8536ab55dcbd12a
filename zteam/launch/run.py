"""Runs a team from start to end: router, processes, GO, a time limit, the report, an orderly stop."""

import logging
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.connection import FROM_STDIN, port_accepts
from zteam.bus.options import DEFAULT_ENDPOINT
from zteam.bus.presence import Claim, ProcessInfo
from zteam.errors import BusError, ZteamError
from zteam.launch.namespace import claim_namespace, refuse_second_team
from zteam.launch.plan import ROUTER, Pace, Plan, plan_team
from zteam.launch.process import Process, Usage, exit_text, measure_usage, zteam_command
from zteam.launch.progress import Progress
from zteam.launch.report import (
    RunReport,
    read_dropped,
    read_rounds,
    read_sim_report,
    report_processes,
    seconds_since_start,
)
from zteam.launch.supervisor import Supervisor
from zteam.runtime.participant import RoundTiming
from zteam.runtime.shutdown import Stop
from zteam.services.simulator import SimReport
from zteam.team_file import Team

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


_LAST_WORDS = 1.0
"""Host seconds to wait for the output of a process that has ended."""
LEASE_MARGIN = 5.0
"""Host seconds by which links in lock-step outlive its patience: a hung participant must not look dead before."""


def lease_for(pace: Pace, given: float) -> float:
    """The lease of all sessions of a team."""
    return max(given, pace.timeout + LEASE_MARGIN) if pace.lockstep else given


def choose_endpoint() -> str:
    """Where the team's router listens: the default port, so that tools find it; another one if that is taken."""
    return ANY_PORT if port_accepts(DEFAULT_ENDPOINT, timeout=0.2) else DEFAULT_ENDPOINT


def _is_endpoint(line: str) -> bool:
    """Whether a line of the router's output is its announcement, and no line of its log."""
    return line.startswith(("tcp/", "tls/"))


def _last_words(process: Process) -> str:
    """Why a process ended, as far as it said."""
    process.join(_LAST_WORDS)
    said = [line for line in process.lines if line.strip()]
    return exit_text(process.exit_code) + (f": {said[-1].strip()}" if said else "")


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
        self._claim: Claim | None = None
        self.endpoint = options.bus.connect or ""
        self.plan = self._make_plan()
        self.supervisor = Supervisor(on_line, self._on_failure)
        stop.on_request(self._wake)

    def _make_plan(self) -> Plan:
        options = self._options
        # Always said, empty or not: a process that is told nothing takes its environment's word for it.
        bus = ["--connect", options.bus.connect or FROM_STDIN, "--namespace", options.bus.namespace or ""]
        bus += ["--config", options.bus.config or "", "--lease", str(lease_for(options.pace, options.bus.lease))]
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
            if self._claim is not None:
                self._claim.release()
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
        else:
            self._bus = self._connect()
            refuse_second_team(self._bus, self.plan.commands)
            self._claim = claim_namespace(self._bus, self._on_rival)
        for name, command in self.plan.commands.items():
            supervisor.start(name, command)
        if self._options.bus.connect is None:
            self._wait_for_router()
            for name in self.plan.commands:
                supervisor.processes[name].write_line(self.endpoint)
            self._bus = self._connect()
        assert self._bus is not None
        self._progress = Progress(self._bus, self._options.run_for is not None)
        if self._claim is None:
            # On a router of its own nothing hurries: GO is listened for first.
            self._claim = claim_namespace(self._bus, self._on_rival)
        if self._stop.requested:
            self._wake()

    def _connect(self) -> Bus:
        bus = BusOptions(connect=self.endpoint, namespace=self._options.bus.namespace, config=self._options.bus.config)
        return connect(bus, stopping=self._stop, patience=ROUTER_DEADLINE)

    def _on_rival(self, info: ProcessInfo) -> None:
        log.error("process %d on %s runs a team here too, and is older: stopping", info.pid, info.host)
        self._stop.request("another team holds the namespace")

    def _start_router(self) -> None:
        listen = choose_endpoint()
        self.supervisor.start(ROUTER, zteam_command("zteam-router", "--listen", listen, "--announce"))

    def _wait_for_router(self) -> None:
        router = self.supervisor.processes[ROUTER]

        def settled() -> bool:
            return self._stop.requested or not router.running or any(map(_is_endpoint, router.lines))

        self.supervisor.wait(settled, ROUTER_DEADLINE)
        announced = list(filter(_is_endpoint, router.lines))
        if not announced and not self._stop.requested and not router.running:
            # Another router took the port between the look and the bind: any port will do.
            router.join(ROUTER_DEADLINE)
            router = self.supervisor.start(ROUTER, zteam_command("zteam-router", "--listen", ANY_PORT, "--announce"))
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
                ended = [p for p in self.supervisor.processes.values() if not p.running]
                if self._options.run_for is not None:
                    self._check_finishable(ended)
                if len(ended) == len(self.supervisor.processes):
                    return
                progress.changed.wait(1.0)

    def _check_finishable(self, ended: Sequence[Process]) -> None:
        """Raise ZteamError where the end of a limited run cannot come: GO waits for every process of the team."""
        assert self._progress is not None
        needed = None if self._progress.go_after is None else {ROUTER, names.SIMULATOR}
        missing = [process for process in ended if needed is None or process.name in needed]
        if missing:
            told = "; ".join(f"{process.name} ended ({_last_words(process)})" for process in missing)
            raise ZteamError(f"{told}: the run cannot {'begin' if needed is None else 'be finished'}")

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
