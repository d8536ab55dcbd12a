"""Members of a run that are processes: the router of the team, certificates and links, what lets a process join."""

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.options import DEFAULT_ENDPOINT, TLS_VARIABLES, RouterOptions, client_config
from zteam.bus.presence import Claim, find_processes
from zteam.clock import HOST_FACTOR, local_time_text
from zteam.errors import BusError, DuplicateNameError, ZteamError, log
from zteam.node.kinds import ROUTER
from zteam.node.launcher import Report
from zteam.node.process_options import to_line
from zteam.node.shutdown import Stop
from zteam.team.chaos.means import Wire, no_link
from zteam.team.launch.plan import MEMBER, LaunchPlan, Pace, TeamLaunch
from zteam.team.launch.process import Job, Process, exit_text
from zteam.team.launch.supervisor import Supervisor
from zteam.team.launch.warm_parent import WarmParent
from zteam.team.security.access import OPERATOR, Rights, rights_of

if TYPE_CHECKING:
    from zteam.team.chaos.links import Links


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
        text = "%s is in use; for tools and nodes of this team: export ZTEAM_CONNECT=%s"
        log.warning(text, DEFAULT_ENDPOINT, endpoint)


def node_environment(bus: BusOptions) -> dict[str, str]:
    """What gives a process these options. Empty ones too: otherwise this process's environment would give others."""
    return {
        **(dict.fromkeys(TLS_VARIABLES, "") if bus.tls is None else bus.tls.environment),
        "ZTEAM_CONNECT": bus.connect or bus.endpoint,
        "ZTEAM_NAMESPACE": bus.namespace or "",
        "ZTEAM_CONFIG": bus.config or "",
        "ZTEAM_LEASE": str(bus.lease),
    }


def claim_namespace(bus: Bus, stop: Stop) -> Claim:
    """Hold the launcher's name until the claim is released. Raises BusError if another launcher holds it. Requests the
    stop if a healed network shows an older launcher."""
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
            what, since = "a team" if name == names.LAUNCHER else name, local_time_text(info.start)
            text = f"{what} is already running here (pid {info.pid}, since {since})"
            raise BusError(f"{text}; stop it, or use --namespace")


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
        self.endpoint = options.connect or (options.endpoint if options.tls and certificates is None else "")
        self.links, self.certificates = links, certificates
        # A team that comes later may work in lock-step, where processes bear a longer silence of the router.
        self.lease = lease_for(Pace(lockstep=True), options.lease)
        """Of all sessions of the team."""
        self._options, self._warm, self._name, self._listen, self._added = options, warm, name, listen, environment
        self._stop = stop or Stop()
        self._rights: Mapping[str, Rights] = {}
        self._plan, self._restarts = LaunchPlan({}), False

    @property
    def pids(self) -> dict[str, int]:
        """Processes besides those of the supervisor, by name."""
        return {self._name: os.getpid(), **self._warm.pids}

    def change_link(self, name: str, wire: Wire, seconds: float) -> None:
        """Change the link of a process. Raises BusError without links."""
        (no_link if self.links is None else self.links.change)(name, wire, seconds)

    def plan_for(self, launch: TeamLaunch, plan: LaunchPlan) -> None:
        """Prepare to start this team: issue its certificates. Raises ZteamError."""
        self._launch, self._plan, self._restarts = launch, plan, launch.restarts and self._name == names.LAUNCHER
        self.lease = lease_for(launch.pace, self._options.lease)
        if self.certificates is not None:
            own = {} if self._name == names.LAUNCHER else {self._name: Rights(links=True)}
            self._rights = {**rights_of(launch.team), **own}
            self._issue([self._name, OPERATOR, *plan.jobs, *([] if self.endpoint else [ROUTER])])

    def open(self) -> None:
        """Have a router and a session. Raises BusError if the team runs at a given router already."""
        is_given = bool(self.endpoint)
        if not is_given:
            # A mistake in the options starts no router.
            client_config(self._options)
            router = self._start_router()
            self.supervisor.wait(
                lambda: self._stop.requested or not router.running or bool(router.report.listening), ROUTER_DEADLINE
            )
            self.endpoint = router.report.listening
            if not self.endpoint:
                # Its last line may still be on its way.
                router.join(1.0)
                why = f"the router did not start ({exit_text(router.exit_code)}): {' '.join(list(router.lines)[-1:])}"
                raise BusError("stopped" if self._stop.requested else why)
        options = self._options_of(self._name)
        self.bus = self.tools_bus = connect(options, stopping=self._stop, patience=ROUTER_DEADLINE)
        if self.links is not None:
            self.links.serve(self.bus)
        if is_given:
            refuse_second_team(self.bus, self._plan.jobs)

    def start(self) -> None:
        for name, job in self._plan.jobs.items():
            # Robots are many, and a tick waits for the last one: none gains by stopping another or the simulator.
            batch = self._launch.pace.lockstep and names.robot_id_of(name) is not None
            job = msgspec.structs.replace(job, environment=self.environment(name), batch=batch)
            self.supervisor.start_job(name, job)

    def _start_router(self) -> Process:
        """Start a router that reports its endpoint when it listens. A router on demand gives up the default endpoint.
        With certificates it listens over TLS, and lets in those that are valid. If the team's processes are started
        again, it is too, at its endpoint."""
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
            if not (self._restarts and report.listening):
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
        """Those of the session of the process `name`."""
        endpoint, tls = self.endpoint, self._options.tls
        # A tool has no link of its own, and neither has this process.
        if self.links is not None and name not in (OPERATOR, self._name):
            endpoint = self.links.endpoint(name, endpoint)
        if self.certificates is not None:
            from zteam.team.security.certificates import files_of

            tls = files_of(self.certificates, name)
        return msgspec.structs.replace(self._options, connect=endpoint, lease=self.lease, tls=tls)

    def environment(self, name: str) -> dict[str, str]:
        """What lets the process `name` join the team."""
        return {**node_environment(self._options_of(name)), **self._added()}

    def environment_of_new(self, name: str) -> dict[str, str]:
        """Of a process that the plan lacks: with certificates only if the team file names it. Raises ZteamError."""
        if self.certificates is not None:
            if name not in self._rights:
                raise ZteamError(f"{name} may have no certificate: write '{name} = []' in [security.grants]")
            self._issue([name])
        return self.environment(name)

    def close(self) -> None:
        """End the session, and kill what still runs."""
        try:
            if self.bus is not None:
                self.bus.close()
        finally:
            self.supervisor.close()
