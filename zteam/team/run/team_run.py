"""One run of a team from start to end: members, GO, time limit, report, stop in order.

`zteam up`, `run_team` and the `team` fixture are a `TeamRun` each. Its members are processes at a router
(`processes.py`), or threads of this process (`threads.py`).
"""

import signal
import threading
from collections.abc import Callable
from contextlib import ExitStack
from enum import Enum
from functools import partial
from typing import TYPE_CHECKING, Self

import msgspec

from zteam import names
from zteam.bus import Bus, Deferred
from zteam.bus.presence import find_processes
from zteam.errors import BusError, ZteamError, log
from zteam.monitor.observer import TeamObserver
from zteam.node.kinds import kind_of
from zteam.node.log_client import LogPublisher
from zteam.node.shutdown import HUNG, Stop
from zteam.robot.client import StartRequest
from zteam.team.chaos.carry_out import ChaosReport, Watchdog, carry_out_beside
from zteam.team.chaos.means import Means, Signals
from zteam.team.launch.plan import MEMBER, LaunchPlan, TeamLaunch, plan_team, robot_job, stop_order
from zteam.team.launch.process import ProcessReport, exit_text
from zteam.team.launch.progress import Progress, TeamOverview, holders_of_first_tick
from zteam.team.launch.supervisor import GRACE, Member
from zteam.team.run.processes import Processes, claim_namespace
from zteam.team.run.report import RunReport, read_report, seconds_since_start

if TYPE_CHECKING:
    from zteam.team.run.threads import Threads


class RunState(Enum):
    """How far a run is."""

    NEW, OPEN, STOPPING, ENDED = range(4)


class TeamRun:
    """Use as: `with … as run: run.start(); run.watch(); report = run.finish()`."""

    launch: TeamLaunch

    def __init__(
        self,
        members: "Processes | Threads",
        launch: TeamLaunch | None = None,
        stop: Stop | None = None,
        *,
        is_launcher: bool = True,
        on_end: Callable[[Member], None] = lambda _member: None,
        since_start: Callable[[], float] = seconds_since_start,
    ) -> None:
        """Without a `launch`, `plan_for` follows. `is_launcher` says whether this process holds the namespace, and
        starts processes on request. `on_end(member)` is called when one has failed for good. `since_start()` is host
        seconds since the run was asked for.
        """
        self.members, self.supervisor = members, members.supervisor
        self.plan = LaunchPlan({})
        self.signals = Signals(lambda: self.supervisor.processes)
        self.chaos: ChaosReport | None = None
        """How the team took the faults of the launch, after `finish`; None if it has none."""
        self._stop, self._is_launcher, self._since_start = stop or Stop(), is_launcher, since_start
        self._on_end = on_end
        self._hurry = False
        self._progress: Progress | None = None
        """None before there is a bus, and in a test."""
        self._observer: TeamObserver
        self.state = RunState.NEW
        self._end_faults: Callable[[], ChaosReport] | None = None
        self._start_lock = threading.Lock()
        """Held while a robot is started on request."""
        self._hung: set[str] = set()
        self._ends = ExitStack()
        """Of what it holds on the bus, and then of the members."""
        self._ends.callback(members.close)
        self.supervisor.on_failure = self._on_failure
        self._stop.on_request(self.supervisor.wake)
        if launch is not None:
            self.plan_for(launch)

    def plan_for(self, launch: TeamLaunch) -> None:
        """Choose the team that `start` starts."""
        self.launch, self.plan = launch, plan_team(launch)
        self.members.plan_for(launch, self.plan)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.state is RunState.ENDED:
            return
        with self._ends:
            self._stop_all()
        self.state = RunState.ENDED

    def open(self) -> None:
        """Have a router and a session, before there are members. Raises BusError if another team is there."""
        self.members.open()
        bus, tools = self.members.bus, self.members.tools_bus
        assert bus is not None
        self.state = RunState.OPEN
        if self._is_launcher:
            self._observer = TeamObserver(bus)
            self._progress = Progress(self._observer, self._since_start, lambda: dict(self.supervisor.restarts))
            self._ends.callback(self._progress.close)
            if self.launch.has_end:
                self._progress.watch_end(self.supervisor.wake)
            if tools is not None:
                self._ends.callback(LogPublisher(bus, names.LAUNCHER).close)
                self._ends.callback(claim_namespace(bus, self._stop).release)
        if tools is not None:
            self.signals.serve(tools)

    def start(self) -> None:
        if self.state is RunState.NEW:
            self.open()
        self.members.start()
        tools = self.members.tools_bus
        if self._is_launcher and tools is not None:
            key = names.service_key(names.LAUNCHER, names.START)
            # A fork, and the question which process holds the name, take their time.
            tools.serve(key, StartRequest, lambda request: Deferred(partial(self._start_robot, tools, request)))
        if self.launch.faults:
            # The simulator of lock-step knows its own already.
            watchdog = Watchdog(self._observer, lockstep=self.launch.pace.lockstep)
            means = Means(self.signals.send, self.members.change_link)
            self._end_faults = carry_out_beside(self.launch.faults, watchdog, means, self.launch.is_simulated)
            self._ends.callback(self._end_faults)
        if self._stop.requested:
            self.supervisor.wake()

    def _start_robot(self, tools: Bus, request: StartRequest) -> str:
        """Start a robot's process as the team's own were, or end it; its name. The team needs only what was planned."""
        name = names.robot_name(request.robot)
        job = robot_job(self.launch, request.robot, request.behavior) if request.behavior else None
        with self._start_lock:
            if self.state in (RunState.STOPPING, RunState.ENDED):
                raise BusError("the team is stopping")
            member = self.supervisor.members.get(name)
            if member is None and job is None:
                raise BusError(f"zteam up has not started {name}")
            if request.ends:
                self._set_needed(name, False)
                log.info("%s is ended on request", name)
                self.supervisor.stop([name])
                return name
            if (member is not None and member.running) or find_processes(tools, name):
                raise BusError(f"{name} has a process already: end it first")
            self._set_needed(name, name in self.plan.jobs)
            log.info("%s is started on request, %s", name, f"with behaviour {request.behavior}" if job else "as before")
            if job is None:
                self.supervisor.restart(name)
            else:
                job = msgspec.structs.replace(job, environment=self.members.environment_of_new(name))
                self.supervisor.start_job(name, job)
        return name

    def _set_needed(self, name: str, needed: bool) -> None:
        plan, change = self.plan, frozenset.difference if needed else frozenset.union
        plan.optional, plan.unawaited = change(plan.optional, {name}), change(plan.unawaited, {name})

    def hurry(self) -> None:
        """Kill what does not stop at once: the user asked a second time."""
        self._hurry = True
        self.supervisor.wake()

    def _on_failure(self, member: Member, again: bool) -> None:
        if not again:
            self._on_end(member)
        elif self._progress is not None:
            self._progress.note_failure(member.name)

    def team_overview(self) -> TeamOverview:
        """A watch on the team that was started."""
        ids = [robot.id for robot in self.launch.team.driven]
        return TeamOverview(self._observer, ids, is_simulated=self.launch.world is not None)

    def watch(self, go_timeout: float | None = None) -> None:
        """Wait for the end of the run, of all its members, or for the stop request. Raises ZteamError if the run cannot
        reach its end, or has not begun within `go_timeout` host seconds of the launcher's start."""
        progress, supervisor, missing = self._progress, self.supervisor, list[str]()
        assert progress is not None

        def is_over() -> bool:
            if self._stop.requested or progress.wall is not None:
                return True
            missing[:] = self._missing(progress.go_after is not None)
            return bool(missing) or supervisor.members.keys() - self.plan.optional <= supervisor.ended

        if go_timeout is not None and not supervisor.wait(is_over, go_timeout - self._since_start()):
            progress.check_begun(go_timeout)
        holders = list[str]()
        while not (supervisor.wait(is_over, 1.0) or holders):
            jobs = self.plan.jobs
            gone = [name for name in self._missing(False) if name in jobs and jobs[name].command != MEMBER]
            holders = gone if gone and holders_of_first_tick(self._observer.bus) else []
        if missing or holders:
            told = "; ".join(f"{name} ended ({self._last_words(name)})" for name in missing or holders)
            begun = missing and progress.go_after is not None
            raise ZteamError(f"{told}: the run cannot {'be finished' if begun else 'begin'}")

    def _missing(self, begun: bool) -> list[str]:
        """The members that have ended without which a run with a time limit cannot end: GO waits for the whole team."""
        if not self.launch.has_end:
            return []
        ended = [name for name in self.supervisor.members if name in self.supervisor.ended]
        if begun:
            return [name for name in ended if (kind := kind_of(name)) is not None and kind.required_to_finish]
        # The first tick waits for an optional one too that takes part, such as the recorder.
        return [name for name in ended if name not in self.plan.unawaited]

    def _last_words(self, name: str) -> str:
        """Why a member ended: its exit code and the last line of its output."""
        member = self.supervisor.members[name]
        # Its last lines may be on their way.
        member.join(1.0)
        said = [line for line in member.lines if line.strip()]
        return exit_text(member.exit_code) + (f": {said[-1].strip()}" if said else "")

    @property
    def failed(self) -> set[str]:
        """Names of the members that have failed for good, or hang, without those that the team does not need."""
        return {member.name for member in self.supervisor.failures}.union(self._hung) - self.plan.optional

    def finish(self) -> RunReport | None:
        """Collect the counts, stop everything in order, and report; None after a stop or without a simulator."""
        bus, has_counts = self.members.bus, self.launch.world is not None and not self._stop.requested
        report = read_report(bus) if bus is not None and has_counts else None
        self.chaos = None if self._end_faults is None else self._end_faults()
        self.supervisor.measure()
        # Measured while the others run: afterwards the pages that are shared with them would be counted here alone.
        own = [ProcessReport(name, pid, exit=0).measure() for name, pid in self.members.pids.items()]
        self._stop_all()
        if report is None or self._progress is None:
            return None
        restarts, children = dict(self.supervisor.restarts), self.supervisor.processes.values()
        for p in children:
            p.usage.exit, p.usage.restarts = p.exit_code, restarts.get(p.name, 0)
        rows = [p.usage for p in children]
        report.processes, report.restarts, go_after = [*rows, *own], restarts, self._progress.go_after
        report.wall_seconds = round(self._progress.wall or self._since_start(), 3)
        report.go_after_seconds = None if go_after is None else round(go_after, 3)
        report.recovery_seconds = {name: round(seconds, 3) for name, seconds in self._progress.away.items()}
        # Besides those that lock-step left behind.
        report.hung = list(dict.fromkeys((*report.hung, *sorted(self._hung))))
        report.chaos = self.chaos
        return report

    def _stop_all(self) -> None:
        with self._start_lock:
            self.state = RunState.STOPPING
        self._hung |= self.members.hung
        running = [member for member in self.supervisor.members.values() if member.running]
        for group in stop_order(self.supervisor.members):
            self.supervisor.stop(group, lambda: self._hurry)
        self._hung |= {each.name for each in running if each.exit_code == HUNG} - self.plan.optional
        for member in () if self._hurry else running:
            if member.exit_code == -signal.SIGKILL:
                # A busy machine or a pause may be the reason.
                log.warning("%s had not ended %g s after it was asked to, and was killed", member.name, GRACE)
