"""Runs a team from start to end: router, processes, GO, time limit, report, stop in order."""

import logging
import os
import signal
from collections.abc import Callable, Iterable, Mapping
from functools import partial

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.connection import release_port
from zteam.bus.options import DEFAULT_ENDPOINT
from zteam.bus.presence import Claim
from zteam.bus.probe import port_accepts
from zteam.errors import BusError
from zteam.launch.kinds import Pace, TeamLaunch
from zteam.launch.namespace import claim_namespace, refuse_second_team
from zteam.launch.overview import TeamOverview
from zteam.launch.plan import plan_team
from zteam.launch.process import Process, exit_text
from zteam.launch.progress import Progress, Watched
from zteam.launch.report import (
    ProcessReport,
    RunReport,
    make_report,
    measure_processes,
    read_counts,
    report_processes,
    seconds_since_start,
)
from zteam.launch.restarts import Again, log_failure, serve_restarts
from zteam.launch.router import ANY_PORT, start_router, wait_for_endpoint
from zteam.launch.supervisor import GRACE, Supervisor
from zteam.launch.warm_parent import WarmParent
from zteam.process_options import FROM_STDIN
from zteam.runtime.logs import LogPublisher
from zteam.runtime.shutdown import HUNG, Stop

log = logging.getLogger("zteam")

ROUTER_DEADLINE = 20.0
"""Host seconds until the router must listen; an interpreter has taken 2.2 s to start on a crowded machine."""


_LAST_WORDS = 1.0
"""Host seconds to wait for the output of a process that has ended."""
LEASE_MARGIN = 5.0
"""Host seconds that a lease exceeds the time-out of lock-step: a hung participant must not look dead earlier."""


def lease_for(pace: Pace, given: float) -> float:
    """The lease of all sessions of a team, and of its router."""
    return max(given, pace.timeout + LEASE_MARGIN) if pace.lockstep else given


def choose_endpoint() -> str:
    """Where the team's router listens: at the default port, where tools look for it, or at any port.

    An idle router on demand, which a command has left behind, gives the default port up.
    """
    taken = port_accepts(DEFAULT_ENDPOINT, timeout=0.2) and not release_port(DEFAULT_ENDPOINT)
    return ANY_PORT if taken else DEFAULT_ENDPOINT


def warn_of_endpoint(endpoint: str, connect: str | None) -> None:
    """Say how tools find a router at `endpoint` if they do not look there; `connect` is what the user asked for."""
    if connect is None and endpoint != DEFAULT_ENDPOINT:
        log.warning(
            "%s is in use; for tools and nodes of this team: export ZTEAM_CONNECT=%s", DEFAULT_ENDPOINT, endpoint
        )


def _last_words(processes: Mapping[str, Process], name: str) -> str:
    """Why a process ended: its exit code and the last line of its output."""
    process = processes[name]
    process.join(_LAST_WORDS)
    said = [line for line in process.lines if line.strip()]
    return exit_text(process.exit_code) + (f": {said[-1].strip()}" if said else "")


def node_environment(endpoint: str, bus: BusOptions, pace: Pace) -> dict[str, str]:
    """What lets a process join the team at this router. All is given, even if empty: what is left out would come from
    this process's environment."""
    return {
        "ZTEAM_CONNECT": endpoint,
        "ZTEAM_NAMESPACE": bus.namespace or "",
        "ZTEAM_CONFIG": bus.config or "",
        "ZTEAM_LEASE": str(lease_for(pace, bus.lease)),
    }


class Run:
    """One run of a team. Use as: `with Run(...) as run: run.start(); run.watch(); report = run.finish()`."""

    def __init__(
        self,
        launch: TeamLaunch,
        bus: BusOptions,
        stop: Stop,
        on_line: Callable[[str, str], None],
        warm: WarmParent,
    ) -> None:
        self._launch, self._options = launch, bus
        self._stop = stop
        self._hurry = False
        self._warm = warm
        self._own: list[ProcessReport] = []
        self._hung: list[str] = []
        self._router: Process | None = None
        self._progress: Progress | None = None
        self._bus: Bus | None = None
        self._claim: Claim | None = None
        self._log: LogPublisher | None = None
        self.endpoint = bus.connect or ""
        self._lease = lease_for(launch.pace, bus.lease)
        self.plan = plan_team(launch)
        self.supervisor = Supervisor(on_line, self._on_failure, warm.start)
        stop.on_request(self._wake)

    def __enter__(self) -> "Run":
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._stop_all()
        finally:
            if self._claim is not None:
                self._claim.release()
            for part in (self._progress, self._log, self._bus):
                if part is not None:
                    part.close()
            self.supervisor.close()

    def _wake(self) -> None:
        if self._progress is not None:
            self._progress.wake()
        with self.supervisor.changed:
            self.supervisor.changed.notify_all()

    def hurry(self) -> None:
        """Kill what does not stop at once: the user asked a second time."""
        self._hurry = True
        self._wake()

    def _on_failure(self, process: Process, again: Again) -> None:
        log_failure(process.name, process.exit_code, again)
        self._wake()

    def start(self) -> None:
        """Start all processes at once, so that they import while the router starts."""
        supervisor = self.supervisor
        if self._options.connect is None:
            self._router = start_router(supervisor, choose_endpoint(), self._lease)
        else:
            self._bus = self._connect()
            refuse_second_team(self._bus, self.plan.jobs)
            self._claim = claim_namespace(self._bus, self._stop)
        waiting = node_environment(self.endpoint or FROM_STDIN, self._options, self._launch.pace)
        for name, job in self.plan.own.items():
            supervisor.start_job(name, msgspec.structs.replace(job, environment=waiting))
        if self._options.connect is None:
            self.endpoint = self._wait_for_router()
            for name in self.plan.own:
                supervisor.tell(name, self.endpoint)
            self._bus = self._connect()
        assert self._bus is not None
        environment = node_environment(self.endpoint, self._options, self._launch.pace)
        for name, job in self.plan.nodes.items():
            supervisor.start_job(name, msgspec.structs.replace(job, environment=environment))
        self._progress = Progress(self._bus, self._launch.has_end)
        if self._claim is None:
            # On a router of its own the team has no rival yet, so subscribing to GO comes first.
            self._claim = claim_namespace(self._bus, self._stop)
        if self._stop.requested:
            self._wake()

    def team_overview(self) -> TeamOverview:
        """A watch on the team that was started."""
        assert self._bus is not None
        ids = [robot.id for robot in self._launch.team.robots]
        return TeamOverview(self._bus, ids, is_simulated=self._launch.world is not None)

    def _connect(self) -> Bus:
        bus = msgspec.structs.replace(self._options, connect=self.endpoint, lease=self._lease)
        session = connect(bus, stopping=self._stop, patience=ROUTER_DEADLINE)
        self._log = LogPublisher(session, names.LAUNCHER)
        serve_restarts(session, lambda: dict(self.supervisor.restarts.counts))
        return session

    def _wait_for_router(self) -> str:
        """The endpoint of the team's own router. Raises BusError if none listens."""
        assert self._router is not None
        endpoint = self._wait_for_endpoint(self._router)
        if not endpoint and not self._stop.requested and not self._router.running:
            # Another program took the port after `choose_endpoint` looked: any port will do.
            self._router.join(ROUTER_DEADLINE)
            # Robots that failed meanwhile have failed.
            self.supervisor.failures.remove(self._router)
            self._router = start_router(self.supervisor, lease=self._lease)
            endpoint = self._wait_for_endpoint(self._router)
        if not endpoint:
            last = list(self._router.lines)[-1:]
            raise BusError("stopped" if self._stop.requested else f"the router did not start: {last}")
        return endpoint

    def _wait_for_endpoint(self, router: Process) -> str:
        return wait_for_endpoint(self.supervisor, router, ROUTER_DEADLINE, lambda: self._stop.requested)

    def watch(self, go_timeout: float | None = None) -> None:
        """Wait for the end of the run or for the stop request.

        Raises ZteamError if the run cannot reach its end, or without GO within `go_timeout` host seconds.
        """
        assert self._progress is not None
        self._progress.watch(self._stop, self._watched, partial(_last_words, self.supervisor.processes), go_timeout)

    def _watched(self) -> list[Watched]:
        supervisor, optional = self.supervisor, self.plan.optional
        needed = [name for name in list(supervisor.processes) if name not in self.plan.beside]
        return [Watched(name, name in supervisor.ended, name not in optional) for name in needed]

    @property
    def failed(self) -> set[str]:
        """Names of the processes that have failed for good, without those that the team does not need."""
        return {process.name for process in self.supervisor.failures}.union(self._hung) - self.plan.beside

    def finish(self) -> RunReport | None:
        """Collect the counts, stop everything in order, and report; None after a stop or without a simulator."""
        bus, progress = self._bus, self._progress
        has_counts = self._launch.world is not None and not self._stop.requested
        counts = read_counts(bus) if bus is not None and has_counts else None
        self._stop_all()
        if counts is None or progress is None:
            return None
        restarts = self.supervisor.restarts.counts
        rows = [*report_processes(self.supervisor.processes, restarts), *self._own]
        wall = progress.wall or seconds_since_start()
        return make_report(counts, wall, progress.go_after, rows, restarts, self._hung)

    def _stop_all(self) -> None:
        self.supervisor.measure()
        running = [process for process in self.supervisor.processes.values() if process.running]
        if running:
            # Measured before the others end: then the pages that it shares with them would count as its own.
            self._own = measure_processes({names.LAUNCHER: os.getpid(), **self._warm.pids})
        for group in self.plan.stop_order():
            self.supervisor.stop(group, lambda: self._hurry)
        self._hung += [p.name for p in running if p.exit_code == HUNG and p.name not in self.plan.beside]
        _name_killed(() if self._hurry else running)


def _name_killed(asked: Iterable[Process]) -> None:
    """Say which of the processes that were asked to end were killed: a busy machine or a pause may be the reason."""
    for process in asked:
        if process.exit_code == -signal.SIGKILL:
            log.warning("%s had not ended %g s after it was asked to, and was killed", process.name, GRACE)
