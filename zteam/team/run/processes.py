"""Members of a run that are processes: the router of the team, certificates and links, what lets a process join."""

import logging
import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.options import DEFAULT_ENDPOINT, FROM_STDIN, TLS_VARIABLES, RouterOptions
from zteam.bus.presence import Claim, find_processes
from zteam.clock import HOST_FACTOR, local_time_text
from zteam.errors import BusError, DuplicateNameError, ZteamError
from zteam.node.kinds import ROUTER
from zteam.node.launcher import Report
from zteam.node.process_options import to_line
from zteam.node.shutdown import Stop
from zteam.team.chaos.means import Wire, no_link
from zteam.team.launch.plan import MEMBER, LaunchPlan, Pace, TeamLaunch
from zteam.team.launch.process import Process, exit_text
from zteam.team.launch.supervisor import Job, Supervisor
from zteam.team.launch.warm_parent import WarmParent
from zteam.team.security.access import OPERATOR, Rights, rights_of

if TYPE_CHECKING:
    from zteam.team.chaos.links import Links

log = logging.getLogger("zteam")

ROUTER_DEADLINE = 60.0 * HOST_FACTOR
"""Host seconds until the router must listen; an interpreter has taken 2.2 s to start on a crowded machine."""
ANY_PORT = "tcp/127.0.0.1:0"
LEASE_MARGIN = 5.0
"""Host seconds that a lease exceeds the time-out of lock-step: a hung participant must not look dead earlier."""


def lease_for(pace: Pace, given: float) -> float:
    """The lease of all sessions of a team, and of its router."""
    return max(given, pace.timeout + LEASE_MARGIN) if pace.lockstep else given


def warn_of_endpoint(endpoint: str, connect: str | None) -> None:
    """Say how tools find a router at `endpoint` if they do not look there; `connect` is what the user asked for."""
    if connect is None and endpoint != DEFAULT_ENDPOINT:
        log.warning(
            "%s is in use; for tools and nodes of this team: export ZTEAM_CONNECT=%s", DEFAULT_ENDPOINT, endpoint
        )


def node_environment(endpoint: str, bus: BusOptions) -> dict[str, str]:
    """What lets a process join the team at this router. All is given, even if empty: what is left out would come from
    this process's environment."""
    return {
        **(dict.fromkeys(TLS_VARIABLES, "") if bus.tls is None else bus.tls.environment),
        "ZTEAM_CONNECT": endpoint,
        "ZTEAM_NAMESPACE": bus.namespace or "",
        "ZTEAM_CONFIG": bus.config or "",
        "ZTEAM_LEASE": str(bus.lease),
    }


def claim_namespace(bus: Bus, stop: Stop) -> Claim:
    """Hold the launcher's name until the claim is released. Raises BusError if another launcher holds it.

    Requests the stop if a healed network shows an older launcher.
    """

    claim = Claim(bus, names.LAUNCHER)
    try:
        claim.win(stop.request)
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


class Processes:
    """The members as processes at a router."""

    def __init__(
        self,
        options: BusOptions,
        warm: WarmParent,
        on_line: Callable[[str, str], None],
        *,
        name: str = names.LAUNCHER,
        stop: Stop | None = None,
        links: "Links | None" = None,
        certificates: Path | None = None,
        listen: str | None = None,
        environment: Callable[[], Mapping[str, str]] = dict,
    ) -> None:
        """`name` is this process's own. With `links` each process has one of its own, which can be cut; with a folder
        of `certificates` each has one of its own, and no other connection is let in. `listen` is where the team's own
        router listens; None: at the default endpoint, or at any port. `environment()` is added to that of each.
        """
        self.supervisor = Supervisor(on_line, start_child=warm.start)
        self.bus: Bus | None = None
        self.tools_bus: Bus | None = None
        """The session by which tools reach this process: the same."""
        # A process that hangs ends with HUNG, and the watch of a test finds where.
        self.hung, self.hangs = set[str](), dict[str, str]()
        self.endpoint = options.connect or (
            options.endpoint if options.tls is not None and certificates is None else ""
        )
        self.links, self.certificates = links, certificates
        # A team that comes later may work in lock-step, where processes bear a longer silence of the router.
        self.lease = lease_for(Pace(lockstep=True), options.lease)
        """Of all sessions of the team."""
        self._options, self._warm, self._name, self._listen, self._added = options, warm, name, listen, environment
        self._stop = stop or Stop()
        self._rights: Mapping[str, Rights] = {}

    @property
    def pids(self) -> dict[str, int]:
        """Processes besides those of the supervisor, by name."""
        return {self._name: os.getpid(), **self._warm.pids}

    def change_link(self, name: str, wire: Wire, seconds: float) -> None:
        """Change the link of a process. Raises BusError without links."""
        (no_link if self.links is None else self.links.change)(name, wire, seconds)

    def plan_for(self, launch: TeamLaunch, plan: LaunchPlan) -> None:
        """Prepare to start this team: issue its certificates. Raises ZteamError."""
        self._launch, self._plan = launch, plan
        self.lease = lease_for(launch.pace, self._options.lease)
        if self.certificates is not None:
            own = {} if self._name == names.LAUNCHER else {self._name: Rights(links=True)}
            self._rights = {**rights_of(launch.team), **own}
            self._issue([self._name, OPERATOR, *plan.jobs, *([] if self.endpoint else [ROUTER])])

    def open(self) -> None:
        """Have a router and a session."""
        if not self.endpoint:
            self._wait_for_router(self._start_router(restarts=False))
        self._connect()

    def start(self, connected: Callable[[], None]) -> None:
        """Start all members at once, so that they import while the router starts; `connected()` is called when there is
        a session."""
        launch, plan = self._launch, self._plan
        if self.endpoint:
            if self.bus is None:
                self._connect()
                assert self.bus is not None
                refuse_second_team(self.bus, plan.jobs)
                connected()
            self._start_jobs(plan.own)
        else:
            router = self._start_router(restarts=launch.restarts)
            self._start_jobs(plan.own)
            self._wait_for_router(router)
            for name in plan.own:
                self.supervisor.tell(name, self._endpoint_for(name))
            self._connect()
            connected()
        self._start_jobs(plan.nodes)

    def _start_jobs(self, jobs: Mapping[str, Job]) -> None:
        for name, job in jobs.items():
            self.supervisor.start_job(name, msgspec.structs.replace(job, environment=self.environment(name)))

    def _start_router(self, *, restarts: bool) -> Process:
        """Start a router that reports its endpoint when it listens. A router on demand gives up the default endpoint.

        With certificates it listens over TLS, and lets in those that are valid. With `restarts` it is started again at
        its endpoint, when it has failed after that.
        """
        listen = self._listen or DEFAULT_ENDPOINT
        options = RouterOptions((listen,), lease=self.lease, for_team="starts" if self._listen is None else "")
        if self.certificates is not None:
            from zteam.team.security.certificates import ACCESS, files_of

            options = msgspec.structs.replace(
                options,
                listen=(f"tls/{listen.partition('/')[2]}",),
                tls=files_of(self.certificates, ROUTER),
                config=str(self.certificates.resolve() / ACCESS),
            )

        def learn(job: Job, report: Report) -> Job | None:
            if not (restarts and report.listening):
                return None
            again = msgspec.structs.replace(options, listen=(report.listening,), for_team="returns")
            return msgspec.structs.replace(job, words=to_line(ROUTER, again), restarts=True)

        return self.supervisor.start_job(ROUTER, Job(MEMBER, words=to_line(ROUTER, options), learn=learn))

    def _issue(self, processes: Iterable[str]) -> None:
        from zteam.team.security.certificates import prepare

        assert self.certificates is not None
        team, namespace = str(self._launch.team_file or ""), self._options.namespace or ""
        for warning in prepare(self.certificates, team, self._rights, namespace, [*processes]):
            log.warning("%s", warning)

    def _options_of(self, name: str) -> BusOptions:
        options = msgspec.structs.replace(self._options, lease=self.lease)
        if self.certificates is None:
            return options
        from zteam.team.security.certificates import files_of

        return msgspec.structs.replace(options, tls=files_of(self.certificates, name))

    def _endpoint_for(self, name: str) -> str:
        # A tool has no link of its own.
        return self.endpoint if self.links is None or name == OPERATOR else self.links.endpoint(name, self.endpoint)

    def environment(self, name: str) -> dict[str, str]:
        """What lets the process `name` join the team."""
        endpoint = self._endpoint_for(name) if self.endpoint else FROM_STDIN
        return {**node_environment(endpoint, self._options_of(name)), **self._added()}

    def environment_of_new(self, name: str) -> dict[str, str]:
        """That of a process that the plan does not have. With certificates it has one only if the team file says so.
        Raises ZteamError."""
        if self.certificates is not None:
            if name not in self._rights:
                raise ZteamError(f"{name} may have no certificate: write '{name} = []' in [security.grants]")
            self._issue([name])
        return self.environment(name)

    def _connect(self) -> None:
        options = msgspec.structs.replace(self._options_of(self._name), connect=self.endpoint)
        self.bus = self.tools_bus = connect(options, stopping=self._stop, patience=ROUTER_DEADLINE)
        if self.links is not None:
            self.links.serve(self.bus)

    def _wait_for_router(self, router: Process) -> None:
        """Learn the endpoint of the team's own router. Raises BusError if it does not listen."""
        self.supervisor.wait(
            lambda: self._stop.requested or not router.running or bool(router.report.listening), ROUTER_DEADLINE
        )
        self.endpoint = router.report.listening
        if not self.endpoint:
            # Its last line may still be on its way.
            router.join(1.0)
            why = f"the router did not start ({exit_text(router.exit_code)}): {list(router.lines)[-1:]}"
            raise BusError("stopped" if self._stop.requested else why)

    def close(self) -> None:
        """End the session, and kill what still runs."""
        try:
            if self.bus is not None:
                self.bus.close()
        finally:
            self.supervisor.close()
