"""One run of a team from start to end: members, GO, time limit, report, stop in order.

`TeamRun` is what all runs have in common; in a `ProcessRun` the members are processes at a router, and in
`zteam.team.in_process.run` they are threads of this process.
"""

import logging
import os
import signal
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.options import DEFAULT_ENDPOINT, LEASE, TLS_VARIABLES
from zteam.bus.presence import Claim, ProcessInfo, find_processes
from zteam.clock import local_time_text
from zteam.errors import BusError, DuplicateNameError, ZteamError
from zteam.monitor.observer import TeamObserver
from zteam.node.kinds import ROUTER, ROUTER_KIND, kind_of
from zteam.node.log_publisher import LogPublisher
from zteam.node.process_options import FROM_STDIN
from zteam.node.shutdown import HUNG, Stop
from zteam.team.chaos.forwarder import Wire
from zteam.team.chaos.links import Links, no_link
from zteam.team.chaos.means import Means
from zteam.team.chaos.run import ChaosReport, ChaosThread
from zteam.team.chaos.signals import Signals
from zteam.team.launch.plan import plan_team, stop_order
from zteam.team.launch.process import Process, exit_text, zteam_command
from zteam.team.launch.progress import Progress, TeamOverview, holders_of_first_tick
from zteam.team.launch.recovery import Recoveries
from zteam.team.launch.report import ProcessReport, RunReport, complete, process_row, read_report, seconds_since_start
from zteam.team.launch.starts import RobotStarts
from zteam.team.launch.supervisor import GRACE, Again, Job, Member, Supervisor, log_failure
from zteam.team.launch.team_launch import Pace, TeamLaunch
from zteam.team.launch.warm_parent import WarmParent
from zteam.team.security.access import OPERATOR, rights_of
from zteam.team.security.certificates import ACCESS, files_of, prepare

log = logging.getLogger("zteam")

ROUTER_DEADLINE = 20.0
"""Host seconds until the router must listen; an interpreter has taken 2.2 s to start on a crowded machine."""
ANY_PORT = "tcp/127.0.0.1:0"
LEASE_MARGIN = 5.0
"""Host seconds that a lease exceeds the time-out of lock-step: a hung participant must not look dead earlier."""
_LAST_WORDS = 1.0
"""Host seconds to wait for the output of a process that has ended."""


def lease_for(pace: Pace, given: float) -> float:
    """The lease of all sessions of a team, and of its router."""
    return max(given, pace.timeout + LEASE_MARGIN) if pace.lockstep else given


def warn_of_endpoint(endpoint: str, connect: str | None) -> None:
    """Say how tools find a router at `endpoint` if they do not look there; `connect` is what the user asked for."""
    if connect is None and endpoint != DEFAULT_ENDPOINT:
        log.warning(
            "%s is in use; for tools and nodes of this team: export ZTEAM_CONNECT=%s", DEFAULT_ENDPOINT, endpoint
        )


def node_environment(endpoint: str, bus: BusOptions, pace: Pace) -> dict[str, str]:
    """What lets a process join the team at this router. All is given, even if empty: what is left out would come from
    this process's environment."""
    return {
        **(dict.fromkeys(TLS_VARIABLES, "") if bus.tls is None else bus.tls.environment),
        "ZTEAM_CONNECT": endpoint,
        "ZTEAM_NAMESPACE": bus.namespace or "",
        "ZTEAM_CONFIG": bus.config or "",
        "ZTEAM_LEASE": str(lease_for(pace, bus.lease)),
    }


def claim_namespace(bus: Bus, stop: Stop) -> Claim:
    """Hold the launcher's name until the claim is released. Raises BusError if another launcher holds it.

    Requests the stop if a healed network shows an older launcher.
    """

    def on_rival(info: ProcessInfo) -> None:
        log.error("process %d on %s runs a team here too, and is older: stopping", info.pid, info.host)
        stop.request("another team holds the namespace")

    claim = Claim(bus, names.LAUNCHER)
    try:
        claim.win(on_rival)
    except DuplicateNameError:
        refuse_second_team(bus, ())
        raise
    return claim


def refuse_second_team(bus: Bus, needed: Iterable[str]) -> None:
    """Raise BusError if a launcher, or a process of one of the names `needed`, is in the namespace."""
    found = {info.name: info for info in find_processes(bus)}
    for name in (names.LAUNCHER, *needed):
        if name in found:
            info = found[name]
            what = "a team" if name == names.LAUNCHER else name
            raise BusError(
                f"{what} is already running here (pid {info.pid}, since {local_time_text(info.start)}); "
                "stop it, or use --namespace"
            )


def start_router(
    supervisor: Supervisor,
    listen: str = ANY_PORT,
    lease: float = LEASE,
    certificates: Path | None = None,
    *,
    restarts: bool = False,
    only_there: bool = False,
) -> Process:
    """Start a router that prints its endpoint when it listens; clients bear `lease` host seconds of its silence.

    It listens at `listen`, which a router on demand gives up, or else at any port; at no other with `only_there`. With
    a folder of certificates it listens over TLS, and lets in those that are valid. With `restarts` it is started again
    at its endpoint, when it has failed after that.
    """
    environment, config = dict.fromkeys(TLS_VARIABLES, ""), tuple[str, ...]()
    if certificates is not None:
        listen = f"tls/{listen.partition('/')[2]}"
        environment = files_of(certificates, ROUTER).environment
        config = ("--config", str(certificates.resolve() / ACCESS))

    def command(endpoint: str, *how: str) -> list[str]:
        words = ("--listen", endpoint, *how, "--announce", "--lease", str(lease), *config)
        return zteam_command(ROUTER_KIND.command, *words)

    def learn(job: Job, line: str) -> Job | None:
        if not (restarts and is_endpoint(line)):
            return None
        return msgspec.structs.replace(job, command=command(line, "--for-team", "returns"), restarts=True)

    how = () if only_there else ("--for-team", "starts")
    return supervisor.start_job(ROUTER_KIND.name, Job(command(listen, *how), environment, learn=learn))


def is_endpoint(line: str) -> bool:
    """Whether the router has printed where it listens. Lines of its log begin with the time."""
    return line.startswith(("tcp/", "tls/"))


def wait_for_endpoint(
    supervisor: Supervisor, router: Process, timeout: float, stopped: Callable[[], bool] = lambda: False
) -> str:
    """The endpoint that the router prints; empty if it ends, if `timeout` host seconds pass, or if `stopped()`."""

    def endpoint() -> str:
        # A copy, because a thread appends lines.
        return next((line for line in list(router.lines) if is_endpoint(line)), "")

    supervisor.wait(lambda: stopped() or not router.running or bool(endpoint()), timeout)
    return endpoint()


class TeamRun:
    """Use as: `with … as run: run.start(); run.watch(); report = run.finish()`."""

    bus: Bus | None
    """The launcher's own session; None before there is a router."""
    endpoint: str
    """Of the router; empty before there is one."""

    def __init__(
        self, launch: TeamLaunch, stop: Stop, supervisor: Supervisor, since_start: Callable[[], float] | None = None
    ) -> None:
        """`since_start()` is host seconds since the run was asked for; by default since this process began."""
        self.launch = launch
        self.plan = plan_team(launch)
        self.supervisor = supervisor
        self._stop = stop
        self._since_start = since_start or seconds_since_start
        self._hurry = False
        self._progress: Progress | None = None
        self._observer: TeamObserver
        self._recoveries: Recoveries | None = None
        """None before there is a bus."""
        self._own: list[ProcessReport] = []
        self._hung: set[str] = set()
        self._faults: ChaosThread | None = None
        self.chaos: ChaosReport | None = None
        """How the team took the faults of the launch, after `finish`; None if it has none."""
        self._signals = Signals(lambda: supervisor.processes)
        self._starts: RobotStarts | None = None
        """None before processes can be started."""
        self._ends = ExitStack()
        """Of what it holds on the bus."""
        stop.on_request(self._wake)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._stop_all()
        finally:
            self._ends.close()
            if self._progress is not None:
                self._progress.close()
            if self.bus is not None:
                self.bus.close()
            self.supervisor.close()

    def start(self) -> None:
        """Start the members."""
        raise NotImplementedError

    def _wake(self) -> None:
        with self.supervisor.changed:
            self.supervisor.changed.notify_all()

    def hurry(self) -> None:
        """Kill what does not stop at once: the user asked a second time."""
        self._hurry = True
        self._wake()

    def _on_failure(self, member: Member, again: Again) -> None:
        log_failure(member.name, member.exit_code, again)
        if self._recoveries is not None and again.delay is not None:
            self._recoveries.note_failure(member.name)

    def _begin_progress(self) -> None:
        assert self.bus is not None
        self._progress = Progress(self._observer, self.launch.has_end, self._wake, self._since_start)

    def _start_processes(self, jobs: Mapping[str, Job], environment: Callable[[str], Mapping[str, str]]) -> None:
        """Start processes; `environment(name)` lets one join the team."""
        for name, job in jobs.items():
            self.supervisor.start_job(name, msgspec.structs.replace(job, environment=environment(name)))

    def _begin_faults(self, change_link: Callable[[str, Wire, float], object]) -> None:
        """Carry out the faults of the launch, if it has any; the simulator of lock-step knows its own already."""
        if self.launch.faults:
            assert self.bus is not None
            means = Means(self._signals.send, change_link)
            self._faults = ChaosThread(
                self.launch.faults, self._observer, means, self.launch.is_simulated, lockstep=self.launch.pace.lockstep
            )
            self._ends.callback(self._faults.stop)

    def _hold_namespace(self) -> None:
        """Hold the launcher's name. Raises BusError if another team is there."""
        assert self.bus is not None
        self._ends.callback(claim_namespace(self.bus, self._stop).release)

    def _open_log(self, bus: Bus) -> None:
        self._ends.callback(LogPublisher(bus, names.LAUNCHER).close)

    def _watch_recoveries(self, bus: Bus) -> None:
        self._observer = TeamObserver(bus)
        self._recoveries = Recoveries(self._observer, lambda: dict(self.supervisor.restarts.counts))

    def team_overview(self) -> TeamOverview:
        """A watch on the team that was started."""
        assert self.bus is not None
        ids = [robot.id for robot in self.launch.team.robots]
        return TeamOverview(self._observer, ids, is_simulated=self.launch.world is not None)

    def watch(self, go_timeout: float | None = None) -> None:
        """Wait for the end of the run, of all its members, or for the stop request.

        Raises ZteamError if the run cannot reach its end, or has not begun within `go_timeout` host seconds of the
        launcher's start.
        """
        progress, supervisor, missing = self._progress, self.supervisor, list[str]()
        assert progress is not None

        def is_over() -> bool:
            if self._stop.requested or progress.wall is not None:
                return True
            missing[:] = self._missing(progress.go_after is not None)
            return bool(missing) or supervisor.members.keys() - self.plan.beside <= supervisor.ended

        if go_timeout is not None and not supervisor.wait(is_over, go_timeout - self._since_start()):
            progress.check_begun(go_timeout)
        holders = list[str]()
        while not (supervisor.wait(is_over, 1.0) or holders):
            gone = [name for name in self._missing(False) if name in self.plan.nodes]
            holders = gone if gone and holders_of_first_tick(self._observer.bus) else []
        if missing or holders:
            told = "; ".join(f"{name} ended ({self._last_words(name)})" for name in missing or holders)
            begun = missing and progress.go_after is not None
            raise ZteamError(f"{told}: the run cannot {'be finished' if begun else 'begin'}")

    def _missing(self, begun: bool) -> list[str]:
        """The members that have ended without which a run with a time limit cannot end: GO waits for the whole team."""
        if not self.launch.has_end:
            return []
        ended = [name for name in self.supervisor.members if name in self.supervisor.ended - self.plan.beside]
        if begun:
            return [name for name in ended if (kind := kind_of(name)) is not None and kind.carries_run]
        return [name for name in ended if name not in self.plan.optional]

    def _last_words(self, name: str) -> str:
        """Why a member ended: its exit code and the last line of its output."""
        member = self.supervisor.members[name]
        member.join(_LAST_WORDS)
        said = [line for line in member.lines if line.strip()]
        return exit_text(member.exit_code) + (f": {said[-1].strip()}" if said else "")

    @property
    def failed(self) -> set[str]:
        """Names of the members that have failed for good, or hang, without those that the team does not need."""
        return {member.name for member in self.supervisor.failures}.union(self._hung) - self.plan.beside

    def finish(self) -> RunReport | None:
        """Collect the counts, stop everything in order, and report; None after a stop or without a simulator."""
        has_counts = self.launch.world is not None and not self._stop.requested
        report = read_report(self.bus) if self.bus is not None and has_counts else None
        self.chaos = None if self._faults is None else self._faults.stop()
        self._stop_all()
        if report is None or self._progress is None:
            return None
        restarts, children = self.supervisor.restarts.counts, self.supervisor.processes.values()
        rows = [process_row(p.name, p.pid, p.exit_code, restarts.get(p.name, 0), p.usage) for p in children]
        wall = self._progress.wall or self._since_start()
        away = self._recoveries.seconds if self._recoveries is not None else {}
        complete(report, wall, self._progress.go_after, [*rows, *self._own], restarts, away, sorted(self._hung))
        report.chaos = self.chaos
        return report

    def _pids(self) -> dict[str, int]:
        """Processes besides those of the supervisor, by name."""
        return {names.LAUNCHER: os.getpid()}

    def _stop_all(self) -> None:
        if self._starts is not None:
            self._starts.end()
        self.supervisor.measure()
        running = [member for member in self.supervisor.members.values() if member.running]
        if running:
            # Measured before the others end: then the pages that it shares with them would count as its own.
            self._own = [process_row(name, pid) for name, pid in self._pids().items()]
        for group in stop_order(self.supervisor.members):
            self.supervisor.stop(group, lambda: self._hurry)
        self._hung |= {each.name for each in running if each.exit_code == HUNG} - self.plan.beside
        for member in () if self._hurry else running:
            if member.exit_code == -signal.SIGKILL:
                # A busy machine or a pause may be the reason.
                log.warning("%s had not ended %g s after it was asked to, and was killed", member.name, GRACE)


class ProcessRun(TeamRun):
    """A run whose members are processes."""

    def __init__(
        self,
        launch: TeamLaunch,
        bus: BusOptions,
        stop: Stop,
        on_line: Callable[[str, str], None],
        warm: WarmParent,
        links: Links | None = None,
        certificates: Path | None = None,
        listen: str | None = None,
    ) -> None:
        """With `links` each process has one of its own, which can be cut; with a folder of `certificates` each has one
        of its own, and no other connection is let in. `listen` is where the team's own router listens; None: at the
        default endpoint, or at any port."""
        super().__init__(launch, stop, Supervisor(on_line, self._on_failure, warm.start))
        self._options = bus
        self._certificates = certificates
        self._warm = warm
        self._links = links
        self._listen = listen
        self._lease = lease_for(launch.pace, bus.lease)
        self.bus = None
        self.endpoint = bus.connect or (bus.endpoint if bus.tls is not None and certificates is None else "")

    def _options_of(self, name: str) -> BusOptions:
        """Those of a process."""
        if self._certificates is None:
            return self._options
        return msgspec.structs.replace(self._options, tls=files_of(self._certificates, name))

    def _prepare_certificates(self, folder: Path, has_own_router: bool) -> None:
        launch = self.launch
        names_of = [names.LAUNCHER, OPERATOR, *self.plan.jobs, *([ROUTER] if has_own_router else [])]
        team, namespace = str(launch.team_file or ""), self._options.namespace or ""
        for warning in prepare(folder, team, rights_of(launch.team), namespace, names_of):
            log.warning("%s", warning)

    def _pids(self) -> dict[str, int]:
        return {**super()._pids(), **self._warm.pids}

    def start(self) -> None:
        """Start all processes at once, so that they import while the router starts."""
        supervisor, has_own_router = self.supervisor, not self.endpoint
        if self._certificates is not None:
            self._prepare_certificates(self._certificates, has_own_router)
        if has_own_router:
            start_router(
                supervisor,
                self._listen or DEFAULT_ENDPOINT,
                self._lease,
                self._certificates,
                restarts=self.launch.restarts,
                only_there=self._listen is not None,
            )
        else:
            self._connect()
            assert self.bus is not None
            refuse_second_team(self.bus, self.plan.jobs)
            self._hold_namespace()
        self._start_processes(self.plan.own, self._environment)
        if has_own_router:
            self.endpoint = self._wait_for_router()
            for name in self.plan.own:
                supervisor.tell(name, self._endpoint_for(name))
            self._connect()
        self._start_processes(self.plan.nodes, self._environment)
        self._begin_progress()
        if has_own_router:
            # There the team has no rival yet, so subscribing to GO comes first.
            self._hold_namespace()
        if self._links is not None:
            assert self.bus is not None
            self._links.serve(self.bus)
        assert self.bus is not None
        self._signals.serve(self.bus)
        self._starts = RobotStarts(self.launch, self.plan, supervisor, self.bus, self._environment_of_new)
        self._begin_faults(no_link if self._links is None else self._links.change)
        if self._stop.requested:
            self._wake()

    def _endpoint_for(self, name: str) -> str:
        return self.endpoint if self._links is None else self._links.endpoint(name, self.endpoint)

    def _environment(self, name: str) -> dict[str, str]:
        endpoint = self._endpoint_for(name) if self.endpoint else FROM_STDIN
        return node_environment(endpoint, self._options_of(name), self.launch.pace)

    def _environment_of_new(self, name: str) -> dict[str, str]:
        """That of a process that the plan does not have. With certificates it has one only if the team file says so."""
        if self._certificates is not None:
            rights, namespace = rights_of(self.launch.team), self._options.namespace or ""
            if name not in rights:
                raise ZteamError(f"{name} may have no certificate: write '{name} = []' in [security.grants]")
            for warning in prepare(self._certificates, str(self.launch.team_file or ""), rights, namespace, [name]):
                log.warning("%s", warning)
        return self._environment(name)

    def _connect(self) -> None:
        options = msgspec.structs.replace(self._options_of(names.LAUNCHER), connect=self.endpoint, lease=self._lease)
        self.bus = connect(options, stopping=self._stop, patience=ROUTER_DEADLINE)
        self._open_log(self.bus)
        self._watch_recoveries(self.bus)

    def _wait_for_router(self) -> str:
        """The endpoint of the team's own router. Raises BusError if none listens."""
        router = self.supervisor.processes[ROUTER]
        endpoint = wait_for_endpoint(self.supervisor, router, ROUTER_DEADLINE, lambda: self._stop.requested)
        if not endpoint:
            last = list(router.lines)[-1:]
            raise BusError("stopped" if self._stop.requested else f"the router did not start: {last}")
        return endpoint
