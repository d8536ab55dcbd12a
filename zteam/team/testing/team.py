"""A team of real processes for a test: own router, own namespace, everything in view, no process left behind; or the
same team in the test's own process.

The team works in lock-step, and its world stands still except where the test lets it go on: what a test sees depends
on the seed alone. Limits named `within` are simulated seconds, so that a slow machine makes a test slow and not wrong.
"""

import logging
import math
import signal
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import wait
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, Self, overload

from msgspec import structs

from zteam import names
from zteam.bus import Bus
from zteam.bus.options import LEASE
from zteam.clock import HOST_FACTOR, monotonic
from zteam.config.resources import find_team, find_world
from zteam.config.robot_ids import format_robot_ids, parse_robot_ids
from zteam.errors import BusError, UsageError
from zteam.messages import TeamState
from zteam.monitor.observer import TeamObserver
from zteam.node.kinds import ROUTER, kind_of
from zteam.node.log_client import LogLine
from zteam.node.logs import KEEPER
from zteam.node.process_options import LOCKSTEP_TIMEOUT
from zteam.node.shutdown import Stop
from zteam.robot.behaviors import Behavior
from zteam.robot.behaviors.registry import BEHAVIORS, look_in
from zteam.robot.client import StopClient, StopResult
from zteam.simulator.client import SimReport, SimStatus, StepRequest
from zteam.team.chaos.links import Links, no_link
from zteam.team.chaos.means import Means
from zteam.team.file.reading import read_team_file, read_team_tables
from zteam.team.file.sources import argument_texts
from zteam.team.in_process.run import Body, InProcessRun
from zteam.team.launch.check import check_team, refuse_nodes
from zteam.team.launch.plan import LaunchPlan, plan_team
from zteam.team.launch.run import lease_for
from zteam.team.launch.team_launch import Pace, TeamLaunch
from zteam.team.own_code import other_file, other_file_unless_in
from zteam.team.security.access import OPERATOR, Rights, rights_of
from zteam.team.security.certificates import prepare
from zteam.team.testing.chaos import TeamChaos
from zteam.team.testing.hangs import LOOK, Wait
from zteam.team.testing.own_nodes import NO_NODES, OwnNodes, own_nodes
from zteam.team.testing.processes import OBSERVED, START_LIMIT, TEST, TeamProcesses, TeamTimeout, in_thread

log = logging.getLogger("zteam")

STALL_LIMIT = 60.0 * HOST_FACTOR
"""Host seconds during which simulated time may stand still in a wait."""

_SLICE = 50
"""Ticks of one request to the simulator."""


class TeamFixture(TeamProcesses):
    """The `team` fixture: starts whole teams, lets their simulated time go on, and makes trouble on purpose."""

    def launch(
        self,
        team: str | Path,
        *,
        world: str | Path | None = None,
        lockstep: bool = True,
        lockstep_timeout: float = LOCKSTEP_TIMEOUT,
        in_process: bool = False,
        chaos: bool = False,
        arguments: Mapping[str, Any] | None = None,
        secure: str | Path | None = None,
    ) -> None:
        """Start a team file (or shipped team), and wait until all its processes are there; the rest as in `start`.

        `arguments` are those of the team file, by name. Its nodes are waited for if they have `expect = true`. With
        `secure`, a folder of certificates, which is made where it is missing, each process has one of its own; the test
        itself may do everything, and tools what the team file grants `operator`.
        """
        if secure is not None:
            self._need_processes("launch(secure=…)")
            self._certificates = Path(secure)
        path = find_team(team)
        file = read_team_file(path, argument_texts(arguments or {}))
        # A module that lies beside the team file is the right one: a team in this process has to find it too.
        of_file = () if in_process else file.team.folders
        file.team = structs.replace(file.team, folders=(*file.team.folders, *self._folders))
        replaced = find_world(world).resolve() if world is not None else None
        chosen = check_team(file, replaced, other_file=other_file_unless_in(of_file))
        if in_process:
            refuse_nodes(file, "leave in_process out")
        pace = Pace(lockstep=lockstep and chosen is not None, timeout=lockstep_timeout, paused=lockstep)
        self._give_links(chaos, in_process)
        self._launch(TeamLaunch(file.team, chosen, team_file=path.resolve(), pace=pace), in_process)

    def start(
        self,
        world: str | Path = "arena",
        robots: int | str | Sequence[int] = 1,
        *,
        behavior: str | type[Behavior] = "wander",
        follow: Mapping[int, int] | None = None,
        params: Mapping[int, Mapping[str, Any]] | None = None,
        seed: int = 1,
        lockstep: bool = True,
        lockstep_timeout: float = LOCKSTEP_TIMEOUT,
        expect: Sequence[str] = (),
        nodes: "Mapping[str, Body | str] | None" = None,
        in_process: bool = False,
        chaos: bool = False,
    ) -> None:
        """Start a team in `world` and wait until all its processes are there.

        `robots` is a number, a list of ids, or ids as text such as "0,2-4". A robot in `follow` follows the
        robot named there, the others run `behavior`, a name or a class of a module; `params` gives behaviour
        parameters by robot. With `lockstep` the world stands still until `run`, `until` or `at` let it go on,
        as fast as the processes can; own nodes in `expect` take part from the first tick on; a living process
        that does not answer is left behind after `lockstep_timeout` host seconds. Without `lockstep` the team
        runs in real time.

        With `chaos` each process has a link of its own to the router, which `team.chaos` can cut or make slow.
        `nodes` are own nodes by name, which take part from the first tick on: each is a function of the node as for
        `zteam.run`, given as text "module:function". With `in_process` the whole team runs in the test's process, which
        starts it in a fifth of a second and steps it many times faster, with the same result; a node may then be the
        function itself. Calls that need processes are refused.
        """
        tables = _tables(robots, _spec_of(behavior), follow or {}, params or {})
        file = read_team_tables("team.start", {"robots": tables})
        # In the order of this process; the current folder follows.
        file.team = structs.replace(file.team, folders=tuple(self._folders))
        if in_process:
            look_in([*file.team.folders, ""])
        chosen = check_team(file, find_world(world).resolve(), here=in_process, other_file=other_file)
        own = own_nodes("team.start", nodes or {}, file.team.folders, here=in_process)
        pace = Pace(lockstep=lockstep, timeout=lockstep_timeout, expect=(*expect, *(nodes or ())), paused=lockstep)
        self._give_links(chaos, in_process)
        self._launch(TeamLaunch(file.team, chosen, seed, pace=pace), in_process, own)

    def _launch(self, launch: TeamLaunch, in_process: bool, own: OwnNodes = NO_NODES) -> None:
        if self._has_team:
            text = "a test has one team, and this one has started: use team.restart, team.sim or a second test"
            raise UsageError(text)
        self._has_team, self._silence_limit = True, launch.pace.timeout
        plan = plan_team(launch)
        own.check_names(plan.jobs)
        plan.own |= own.jobs
        self._launched = launch, plan
        self._expect(launch, plan)
        if in_process:
            self._open_in_process(launch, own.bodies)
        else:
            self._need_processes("start")
            self._lease = lease_for(launch.pace, LEASE)
            if self._certificates is not None:
                rights = {**rights_of(launch.team), TEST: Rights(links=True)}
                prepare(self._certificates, "", rights, self.namespace, [ROUTER, OPERATOR, TEST, *plan.jobs])
            self._open()
        self._start_members(plan)

    def _expect(self, launch: TeamLaunch, plan: LaunchPlan) -> None:
        self._participants = {*launch.participants}
        self._restarts = {name for name, job in plan.jobs.items() if job.restarts}
        self.expect_end(*plan.beside)

    def _start_members(self, plan: LaunchPlan, kept: Collection[str] = ()) -> None:
        """Start the processes of the team, or its nodes, but for those that are `kept`; wait until all are there."""
        run = self._in_process
        if run is not None:
            members = [*run.parts]
            for name in [name for name in members if name not in kept]:
                run.start_node(name)
        else:
            members = [name for name in plan.jobs if name not in plan.optional]
            for name in [name for name in plan.jobs if name not in kept]:
                link = {} if self._links is None else {"ZTEAM_CONNECT": self._links.endpoint(name, self.endpoint)}
                job = structs.replace(plan.jobs[name], environment={**self._environment_of(name), **link})
                self._supervisor.start_job(name, job)
            self._watch_others(self._launched[0].pace.expect)
        self.wait_for_processes(*members)
        if names.SIMULATOR in members:
            known = self.sim_status.robots
            # From here on a test may read any robot's pose.
            if not self._wait(lambda: all(self.robot(i).truth is not None for i in known), START_LIMIT):
                raise TeamTimeout(f"the simulator shows no pose of some robot of {known}")

    def _open_in_process(self, launch: TeamLaunch, nodes: "Mapping[str, Body] | None") -> None:
        if self._bus is not None or self._in_process is not None:
            raise UsageError("team.start: in_process=True comes first, and once: this team has processes already")
        with ExitStack() as ends:
            # As a process of the team logs.
            ends.callback(log.setLevel, log.level)
            log.setLevel(logging.INFO)
            run = ends.enter_context(InProcessRun(launch, Stop(), nodes, take_hang=self._take_hang))
            ends.callback(KEEPER.pass_to(self._take_log))
            self._in_process_ends = ends.pop_all()
        self._in_process = run
        self._supervisor.close()
        self._supervisor = run.supervisor
        self._bus = run.sessions.bus("test")
        self._seen = TeamObserver(self._bus, *OBSERVED, repeat=self._repeat)

    def _take_log(self, line: LogLine) -> None:
        level = "" if line.level == logging.INFO else f"{logging.getLevelName(line.level).lower()}: "
        self._take_line(line.process, f"{level}{line.text}")

    def _give_links(self, chaos: bool, in_process: bool) -> None:
        if chaos and in_process:
            raise UsageError("team.start: chaos=True gives links to processes: leave it or in_process out")
        if chaos and self._links is None:
            self._links = Links()

    @property
    def chaos(self) -> TeamChaos:
        """Faults on purpose that wait for the recovery."""
        self._open()
        if self._chaos is None:
            change = no_link if self._links is None else self._links.change
            means = Means(self._signals.send, change, self.sim.fault if self._interval else None)
            self._chaos = TeamChaos(self, self._view, means, self._restarts, self._interval)
        return self._chaos

    def wait_for_return(self, name: str) -> None:
        """Wait until a process is there that was started again; in lock-step, until it takes part."""
        self._wait(lambda: self.alive(name), START_LIMIT)
        self.wait_for_processes(name)
        self._wait_until_joined(name)

    def kill(self, name: str) -> None:
        """End a process at once (SIGKILL) and wait until it is gone."""
        self._need_processes("kill")
        self._check()
        process = self._process(name)
        process.stopping = True
        process.kill()
        process.join(START_LIMIT)
        self._wait_until_left(name)

    @overload
    def stop(self, name: None = None, *, robots: Collection[int] | None = None) -> None: ...

    @overload
    def stop(self, name: str) -> int: ...

    def stop(self, name: str | None = None, *, robots: Collection[int] | None = None) -> int | None:
        """Stop the robots where they are, all or these, as `zteam stop` does, until `release`.

        With the `name` of a process: ask that process to end (SIGTERM), or a node in this process; its exit code.
        """
        if name is None:
            self._need_team("stop")
            _need_confirmed(self._stops().engage(robots))
            return None
        if robots is not None:
            raise UsageError("team.stop: give the name of a process to end, or robots to stop")
        self._process(name).terminate()
        code = self.wait_for_exit(name)
        self._wait_until_left(name)
        return code

    def release(self, robots: Collection[int] | None = None) -> None:
        """Let the robots that were stopped go on, all or these."""
        self._need_team("release")
        _need_confirmed(self._stops().release(robots))

    def _stops(self) -> StopClient:
        return StopClient(self.bus, self._view.process_names)

    def pause_process(self, name: str) -> None:
        """Freeze a process (SIGSTOP). From here on it may hang."""
        self._need_processes("pause_process")
        self.expect_end(name)
        self._process(name).signal(signal.SIGSTOP)

    def resume_process(self, name: str) -> None:
        """Let a frozen process go on (SIGCONT)."""
        self._need_processes("resume_process")
        self._process(name).signal(signal.SIGCONT)

    def restart(self, name: str) -> None:
        """Start a process again with the same command and wait until it is there; end it first if it still runs."""
        if self._process(name).running:
            # A node in this process cannot be killed.
            (self.kill if self._in_process is None else self.stop)(name)
        self._wait(lambda: not self.alive(name), START_LIMIT)
        self._supervisor.restart(name)
        self.wait_for_processes(name)
        self._wait_until_joined(name)

    def _wait_until_joined(self, name: str) -> None:
        """Lock-step: wait until a process of the team takes part from the next tick on."""

        def takes_part() -> bool:
            status = self.sim_status
            return name in status.joining or name in status.participants

        kind = kind_of(name)
        if self._interval and kind is not None and kind.in_lockstep and not self._wait(takes_part, START_LIMIT):
            raise TeamTimeout(f"{name} does not take part in lock-step within {START_LIMIT:g} s")

    def _wait_until_left(self, name: str) -> None:
        """Lock-step: wait until a process that has ended takes no part any more: the next tick is without it."""
        kind = kind_of(name)
        may_take_part = kind is None or kind.in_lockstep
        if not self._interval or not may_take_part or not self.alive(names.SIMULATOR):
            return
        if not self._wait(lambda: name not in self.sim_status.participants, START_LIMIT):
            raise TeamTimeout(f"{name} has ended and still takes part in lock-step after {START_LIMIT:g} s")

    def wait_for_line(self, name: str, text: str) -> None:
        """Wait until a process has written a line that holds `text`."""
        if not self._wait(lambda: any(text in line for line in self.lines(name)), START_LIMIT):
            raise TeamTimeout(f"{name} never said {text!r}; its last lines: {self.lines(name)[-3:]}")

    def wait_for(self, condition: Callable[[], bool]) -> None:
        """Wait until `condition()` by the host's clock: for what processes say or do while the world stands still."""
        if not self._wait(condition, START_LIMIT):
            raise TeamTimeout(f"not true within {START_LIMIT:g} s")

    def report_log(self) -> str:
        """Everything the processes wrote, for a failed test's report."""
        return "\n".join(f"[{name}] {line}" for name, line in self.log)

    @property
    def report(self) -> SimReport:
        """The simulator's own count of the run from GO on, with `trajectory_sha256`."""
        return self.sim.report()

    @property
    def tick(self) -> int:
        """The tick at which the world stands."""
        return self.sim_status.tick

    @property
    def now(self) -> float:
        """Simulated seconds."""
        return self._view.now / 1e9

    @property
    def is_go(self) -> bool:
        """Whether the monitor has given GO."""
        status = self._view.team_status
        return status is not None and status.state == TeamState.GO

    @property
    def status(self) -> Any:
        """The newest TeamStatus, or None."""
        return self._view.team_status

    def _need_team(self, call: str) -> None:
        """Raise UsageError before anything was opened: nothing would ever happen."""
        if self._bus is None:
            raise UsageError(f"team.{call}: no process runs yet: call team.start or team.launch first")

    def wait_for_go(self) -> None:
        """Wait until the monitor has given GO; in lock-step, until the first tick after GO is over."""
        self._need_team("wait_for_go")
        if not self._wait(lambda: self.is_go, START_LIMIT):
            raise TeamTimeout("no GO: " + "; ".join(self.lines(names.MONITOR)[-3:]))
        if self._interval and not self._wait(lambda: self.report.ticks > 0, START_LIMIT):
            raise TeamTimeout(f"the first tick is held: waiting for {self.sim_status.waiting_for}")
        if self._interval:
            self._take_status(self.sim_status)

    def run(self, seconds: float) -> None:
        """Let `seconds` of simulated time pass: in lock-step to the tick."""
        if not 0.0 <= seconds < math.inf:
            raise UsageError(f"team.run({seconds!r}): give the seconds of simulated time that are to pass, 0 or more")
        self._need_team("run")
        if self._interval:
            self._step(round(seconds * 1e9 / self._interval))
            return
        end = self.now + seconds
        self._watch(lambda: self.now >= end, end, seconds)

    def at(self, tick: int) -> Self:
        """Let the world go on until it stands at `tick` (lock-step). Return the team, for the next call."""
        self._need_team("at")
        if not self._interval:
            raise UsageError("at() needs lock-step: in real time no tick is waited for")
        ahead = tick - self.tick
        if ahead < 0:
            raise UsageError(f"the world is at tick {self.tick} already, beyond {tick}")
        self._step(ahead)
        return self

    def until(self, condition: Callable[[], bool], within: float) -> None:
        """Let the world go on until `condition()`, checked after every tick; fail after `within` simulated seconds.

        In real time the condition is checked whenever a message arrives. Simulated time that stands still for
        STALL_LIMIT host seconds fails too.
        """
        self._need_team("until")
        end = self.now + within
        if not self._interval:
            self._watch(condition, end, within)
            return
        while not condition():
            if self.now >= end:
                raise _not_true(within, self.now, self._view)
            self._step(1)

    def _watch(self, condition: Callable[[], bool], end: float, within: float) -> None:
        """Wait in real time until `condition()`."""
        last, quiet_since, watch = self.now, monotonic(), Wait()
        while True:
            # Without the view's lock: a condition may ask the bus, whose thread may need the lock to go on.
            seen = self._view.version
            if condition():
                self._wait_for_silent()
                return
            if self.now > end:
                raise _not_true(within, self.now, self._view)
            self._look_for_hangs(watch)
            if self.now != last:
                last, quiet_since = self.now, monotonic()
            elif monotonic() - quiet_since > STALL_LIMIT:
                raise TeamTimeout(f"simulated time stands still at {self.now:.1f} s")
            self._view.wait_for_news(seen, 1.0)

    def _step(self, ticks: int) -> None:
        """Run so many ticks, and wait until the messages of the last one are in view."""
        while ticks > 0:
            count = min(ticks, _SLICE)
            ticks -= count
            # A node that hangs in this process may hold whatever the answer needs.
            answer = in_thread(partial(self._ask_for_steps, self.bus, count))
            while not answer.done():
                self._check()
                wait([answer], LOOK)
            try:
                status = answer.result()
            except BusError as error:
                self._check()
                raise TeamTimeout(f"simulated time stands still at {self.now:.1f} s: {error}") from None
            self._take_status(status)
            self._wait_for_messages_of(status)

    def _ask_for_steps(self, bus: Bus, count: int) -> SimStatus:
        key, limit = names.service_key(names.SIMULATOR, "step"), max(STALL_LIMIT, 2.0 * self._silence_limit)
        return bus.ask(key, SimStatus, StepRequest(count), timeout=limit)

    def _wait_for_messages_of(self, status: SimStatus) -> None:
        def arrived() -> bool:
            return self._view.reaches(status.now, status.robots)

        if not arrived():
            # No message was lost in tens of thousands of ticks, but the bus does not promise that.
            self.sim.repeat()
            if not self._wait(arrived, START_LIMIT):
                raise TeamTimeout(f"what the simulator sent at {status.now / 1e9:.1f} s did not arrive")


def _need_confirmed(results: Sequence[StopResult]) -> None:
    failed = [str(result) for result in results if not result.is_done]
    if failed or not results:
        raise TeamTimeout("; ".join(failed) or "no robot is there")


def _not_true(within: float, now: float, view: TeamObserver) -> TeamTimeout:
    """The error of a condition that did not come true, with where the robots are."""
    seconds = f"{within:g} simulated second{'' if within == 1 else 's'}"
    return TeamTimeout(f"not true within {seconds} (now {now:.1f} s){view.describe()}")


def _spec_of(behavior: str | type[Behavior]) -> str:
    """The name by which a robot's process finds a behaviour. Raises UsageError."""
    if isinstance(behavior, str):
        return behavior
    if not isinstance(behavior, type):
        raise UsageError(f"team.start: behavior is {behavior!r:.60}: give a name or a class")
    shipped = [name for name, kind in BEHAVIORS.items() if kind is behavior]
    module, name = behavior.__module__, behavior.__qualname__
    if getattr(sys.modules.get(module), name, None) is not behavior:
        text = f"{name} of {module}, which no process can import: define the class at the top level of a module"
        raise UsageError(f"team.start: behavior is {text}")
    return shipped[0] if shipped else f"{module}:{name}"


def _tables(
    robots: int | str | Sequence[int], behavior: str, follow: Mapping[int, int], params: Mapping[int, Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """The robots of `start` as tables of a team file. Raises UsageError."""
    ids = parse_robot_ids([robots], "robots") if isinstance(robots, str) else robots
    ids = list(range(ids) if isinstance(ids, int) else ids)
    if not ids:
        raise UsageError(f"team.start: robots is {robots!r}: give at least one robot")
    for name, given in (("follow", follow), ("params", params)):
        for i in given:
            if i not in ids:
                raise UsageError(f"team.start: {name} has robot {i}, but robots has {format_robot_ids(ids)}")
    return [
        {"id": i, **({"follow": follow[i]} if i in follow else {"behavior": behavior}), **params.get(i, {})}
        for i in ids
    ]
