"""A team of real processes for a test: own router, own namespace, everything in view, no process left behind; or the
same team in the test's own process.

The team works in lock-step, and its world stands still except where the test lets it go on: what a test sees depends
on the seed alone. Limits named `within` are simulated seconds, so that a slow machine makes a test slow and not wrong.
"""

import itertools
import logging
import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import wait
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, Self, overload

from msgspec import structs

from zteam import names
from zteam.bus import Bus, BusOptions
from zteam.clock import HOST_FACTOR, monotonic
from zteam.config.resources import find_team, find_world
from zteam.config.robot_ids import format_robot_ids, parse_robot_ids
from zteam.errors import BusError, UsageError
from zteam.messages import TeamState
from zteam.monitor.observer import RobotView, TeamObserver
from zteam.node.kinds import kind_of
from zteam.node.log_client import LogLine
from zteam.node.logs import KEEPER
from zteam.node.process_options import LOCKSTEP_TIMEOUT
from zteam.robot.behaviors import Behavior
from zteam.robot.behaviors.registry import BEHAVIORS, look_in
from zteam.robot.client import StopClient, StopResult
from zteam.simulator.client import SimReport, SimStatus, SimulatorClient, StepRequest
from zteam.team.chaos.means import Means
from zteam.team.file.reading import read_team_file, read_team_tables
from zteam.team.file.sources import argument_texts
from zteam.team.launch.check import check_team, refuse_nodes
from zteam.team.launch.plan import command_line, is_own
from zteam.team.launch.process import zteam_command
from zteam.team.launch.supervisor import GRACE, Job
from zteam.team.launch.team_launch import Pace, TeamLaunch
from zteam.team.launch.warm_parent import WarmParent
from zteam.team.own_code import other_file, other_file_unless_in, search_folders
from zteam.team.run.processes import ANY_PORT, Processes
from zteam.team.run.team_run import RunState, TeamRun
from zteam.team.run.threads import Body, Threads, in_thread
from zteam.team.security.access import OPERATOR
from zteam.team.testing.chaos import TeamChaos
from zteam.team.testing.errors import TeamTimeout
from zteam.team.testing.hangs import LOOK, Stacks, Wait
from zteam.team.testing.own_nodes import NO_NODES, OwnNodes, own_nodes
from zteam.team.testing.watch import START_LIMIT, Watch, close_in_time

log = logging.getLogger("zteam")

STALL_LIMIT = 60.0 * HOST_FACTOR
"""Host seconds during which simulated time may stand still in a wait."""

_SLICE = 50
"""Ticks of one request to the simulator."""

_SHORT_GRACE = 0.5 * HOST_FACTOR
"""Host seconds to close a team in this process where a node is known to hang."""
_SITE = str(Path(__file__).parent / "site")
"""A folder with the module that Python imports when it starts."""
_ROUTERLESS = 10.0 * HOST_FACTOR
"""Host seconds without a router after which a node ends that the test has left behind."""
OBSERVED = (names.CLOCK, names.TEAM_STATUS, names.GROUND_TRUTH, names.STATUS)
"""What a test sees of its team without asking."""
WARM_PARENT = WarmParent()
"""Of all teams of this pytest process."""
TEST = "test"
"""The certificate of the test itself, in a secure team."""
numbers = itertools.count(1)


class TeamFixture:
    """The `team` fixture: starts whole teams, lets their simulated time go on, and makes trouble on purpose.

    The router is started when it is needed.
    """

    def __init__(self, rootdir: Path | None = None, *, live: bool = False) -> None:
        """`rootdir` is that of pytest: the team's processes look for modules there, too. With `live` the lines of the
        processes are printed as they come."""
        self._rootdir, self._live = rootdir, live
        self.namespace = f"test_{os.getpid()}_{next(numbers)}"
        """Key prefix of this team alone."""
        self._stacks = Stacks()
        self._watch = Watch(self._stacks, live=live)
        self._processes = Processes(
            BusOptions(namespace=self.namespace),
            WARM_PARENT,
            self._watch.take_line,
            name=TEST,
            listen=ANY_PORT,
            environment=lambda: {"ZTEAM_PATH": os.pathsep.join(self._folders), **self._stacks.environment},
        )
        self._in_process: Threads | None = None
        """The team in this process; None for processes."""
        self._use(TeamRun(self._processes, is_launcher=False))
        self._chaos: TeamChaos | None = None
        self._ends = ExitStack()
        """Of a team in this process."""
        self._has_team = False

    def _use(self, run: TeamRun) -> None:
        self._run = self._watch.run = run

    def _open(self) -> None:
        """Start the router and open the test's own session, unless that was done before.

        All calls that look at the team come here, so they fail for a process that has failed.
        """
        self._watch.check()
        if self._run.state is RunState.NEW:
            self._run.open()
            self._observe()

    def _observe(self) -> None:
        """Watch the team on a session that was opened."""
        assert self._run.members.bus is not None
        self._watch.observe(TeamObserver(self._run.members.bus, *OBSERVED, repeat=self._repeat))

    def expect_end(self, *processes: str) -> None:
        """Let these processes end or hang by themselves, at any time: without this that fails the test."""
        self._watch.expect_end(*processes)

    def check_at_end(self) -> None:
        """Raise TeamFailure for a process that has ended or hangs unasked, and does not come back."""
        self._watch.check_at_end()

    def lines(self, name: str) -> list[str]:
        """What a process has written so far."""
        return self._watch.lines(name)

    def _need_processes(self, what: str) -> None:
        if self._in_process is not None:
            raise UsageError(f"team.{what} needs processes: leave in_process out")

    @property
    def bus(self) -> Bus:
        """A session in the team's namespace."""
        self._open()
        assert self._run.members.bus is not None
        return self._run.members.bus

    @property
    def endpoint(self) -> str:
        """Where the team's router listens."""
        self._need_processes("endpoint")
        self._open()
        return self._processes.endpoint

    @property
    def _view(self) -> TeamObserver:
        self._open()
        return self._watch.seen

    def _repeat(self, arrived: Callable[[], bool]) -> None:
        """Wait until a subscribed topic arrives. A world that stands still is asked to publish its last tick again."""
        if self.alive(names.SIMULATOR):
            if self._watch.interval or self.sim_status.paused:
                self.sim.repeat()
            self._watch.wait(arrived, START_LIMIT)

    def robot(self, robot_id: int) -> RobotView:
        """What the bus tells about a robot. Raises UsageError for one that neither the world nor a process has."""
        if robot_id not in self._view.robots and self.alive(names.SIMULATOR):
            there = self.sim_status.robots
            if robot_id not in there and not self.alive(names.robot_name(robot_id)):
                raise UsageError(f"there is no robot {robot_id}; the world has {format_robot_ids(there) or 'no robot'}")
        return self._view.robot(robot_id)

    def alive(self, name: str) -> bool:
        """Whether a process holds this name on the bus."""
        return self._view.alive(name)

    def close(self) -> None:
        """Stop everything, in order."""
        try:
            if self._in_process is not None:
                # What hangs was told to end when it was noticed.
                close_in_time(
                    partial(self._run.__exit__, None, None, None), _SHORT_GRACE if self._watch.hangs else GRACE
                )
            else:
                self._run.__exit__(None, None, None)
        finally:
            self._ends.close()
            if self._processes.links is not None:
                self._processes.links.close()
            self._stacks.close()

    @property
    def environment(self) -> dict[str, str]:
        """Environment that makes any zteam command join this team; a secure team takes it for people's tools.

        With it a Python program finds modules where the test does, behind its own, and a node ends some seconds after
        the team.
        """
        paths = filter(None, [_SITE, os.environ.get("PYTHONPATH")])
        return {
            **self._environment_of(OPERATOR),
            "PYTHONPATH": os.pathsep.join(paths),
            "ZTEAM_GIVE_UP": str(_ROUTERLESS),
        }

    @property
    def _folders(self) -> list[str]:
        """Where the test finds modules, besides what is installed."""
        rootdir = [] if self._rootdir is None else [str(self._rootdir)]
        return list(dict.fromkeys([*search_folders(), *rootdir]))

    def _environment_of(self, name: str) -> dict[str, str]:
        """That of one process."""
        self._need_processes("environment")
        self._open()
        return self._processes.environment(name)

    def spawn(self, command: str | Path, *arguments: str | Path | float, name: str | None = None) -> str:
        """Start any program in this team, in the test's current folder; the name of the process.

        `python` is this interpreter, and commands of zteam (`zteam-robot`, `zteam`, …) run with it. It ends with the
        team, with all that it starts. Return at once: use `wait_for_processes` to wait until a node is present. A node
        is known by its name on the bus, so give it as `name`. Raises ZteamError if there is no such program.
        """
        self._need_processes("spawn")
        words = [str(command), *map(str, arguments)]
        chosen = name or f"{Path(command).name} #{next(numbers)}"
        # What is forked takes no other PYTHONPATH, and needs none.
        environment = self._environment_of(OPERATOR) if is_own(words[0]) else self.environment
        # A tool ends by itself when its work is done.
        self._run.supervisor.start_job(chosen, Job(command_line(words), environment, may_end=True))
        return chosen

    def command(self, *arguments: str, timeout: float = START_LIMIT) -> "subprocess.CompletedProcess[str]":
        """Run `zteam ARGUMENTS` against this team and wait for its end."""
        self._need_processes("command")
        return subprocess.run(
            zteam_command("zteam", *arguments),
            env={**os.environ, **self.environment},
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
            stdin=subprocess.DEVNULL,
        )

    def pid(self, name: str) -> int:
        """Process id of a process of this team."""
        self._need_processes("pid")
        pid: int = self._watch.member(name).pid
        return pid

    def exit_code(self, name: str) -> int | None:
        """Exit code of a process, negative for a signal, None while it runs."""
        code: int | None = self._watch.member(name).exit_code
        return code

    def wait_for_processes(self, *processes: str) -> None:
        """Wait until these names are present on the bus; a process that ends instead fails the test at once."""
        self._open()
        self._watch.wait_for_processes(*processes)

    def wait_for_exit(self, name: str) -> int:
        """Wait until a process has ended, which it may do; its exit code."""
        process = self._watch.member(name)
        self.expect_end(name)
        if not process.join(START_LIMIT):
            raise TeamTimeout(f"{name} still runs after {START_LIMIT:g} s")
        code: int = process.exit_code
        return code

    @property
    def sim(self) -> SimulatorClient:
        """The simulator's queries as calls: pause, resume, speed, reset, spawn, remove, move."""
        return SimulatorClient(self.bus, START_LIMIT)

    @property
    def sim_status(self) -> SimStatus:
        """The simulator's status: pace, participants, and the one that it waits for."""
        return self.sim.status()

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
            self._processes.certificates = Path(secure)
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
        self._has_team, self._watch.silence_limit = True, launch.pace.timeout
        if in_process:
            self._open_in_process(launch, own.bodies)
        else:
            self._need_processes("start")
        self._run.plan_for(launch)
        plan = self._run.plan
        own.check_names(plan.jobs)
        plan.own |= own.jobs
        if in_process:
            self._ends.callback(KEEPER.pass_to(self._take_log))
        self._expect()
        self._open()
        self._run.start()
        self._wait_for_members()

    def _expect(self) -> None:
        launch, plan = self._run.launch, self._run.plan
        self._watch.participants = {*launch.participants}
        self._watch.restarts = {name for name, job in plan.jobs.items() if job.restarts}
        self.expect_end(*plan.beside)

    def _wait_for_members(self) -> None:
        """Wait until all that belong to the team are there."""
        plan, run = self._run.plan, self._in_process
        members = [*run.parts] if run is not None else [name for name in plan.jobs if name not in plan.optional]
        if run is None:
            self._watch.watch_others(self._run.launch.pace.expect)
        self.wait_for_processes(*members)
        if names.SIMULATOR in members:
            known = self.sim_status.robots
            # From here on a test may read any robot's pose.
            if not self._watch.wait(lambda: all(self.robot(i).truth is not None for i in known), START_LIMIT):
                raise TeamTimeout(f"the simulator shows no pose of some robot of {known}")

    def _open_in_process(self, launch: TeamLaunch, nodes: "Mapping[str, Body] | None") -> None:
        if self._run.state is not RunState.NEW:
            raise UsageError("team.start: in_process=True comes first, and once: this team has processes already")
        # As a process of the team logs.
        self._ends.callback(log.setLevel, log.level)
        log.setLevel(logging.INFO)
        self._processes.close()
        self._in_process = Threads(nodes, name=TEST, ends_calls=True)
        self._watch.is_in_process = True
        self._use(TeamRun(self._in_process, is_launcher=False))

    def _take_log(self, line: LogLine) -> None:
        level = "" if line.level == logging.INFO else f"{logging.getLevelName(line.level).lower()}: "
        self._watch.take_line(line.process, f"{level}{line.text}")

    def _give_links(self, chaos: bool, in_process: bool) -> None:
        if chaos and in_process:
            raise UsageError("team.start: chaos=True gives links to processes: leave it or in_process out")
        if chaos and self._processes.links is None:
            from zteam.team.chaos.links import Links

            self._processes.links = Links()

    @property
    def chaos(self) -> TeamChaos:
        """Faults on purpose that wait for the recovery."""
        self._open()
        if self._chaos is None:
            change, simulate = self._run.members.change_link, self.sim.fault if self._watch.interval else None
            means = Means(self._run.signals.send, change, simulate)
            self._chaos = TeamChaos(self, self._view, means, self._watch.restarts, self._watch.interval)
        return self._chaos

    def wait_for_return(self, name: str) -> None:
        """Wait until a process is there that was started again; in lock-step, until it takes part."""
        self._watch.wait(lambda: self.alive(name), START_LIMIT)
        self.wait_for_processes(name)
        self._wait_until_joined(name)

    def kill(self, name: str) -> None:
        """End a process at once (SIGKILL) and wait until it is gone."""
        self._need_processes("kill")
        self._watch.check()
        process = self._watch.member(name)
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
        self._watch.member(name).terminate()
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
        self._watch.member(name).signal(signal.SIGSTOP)

    def resume_process(self, name: str) -> None:
        """Let a frozen process go on (SIGCONT)."""
        self._need_processes("resume_process")
        self._watch.member(name).signal(signal.SIGCONT)

    def restart(self, name: str) -> None:
        """Start a process again with the same command and wait until it is there; end it first if it still runs."""
        if self._watch.member(name).running:
            # A node in this process cannot be killed.
            (self.kill if self._in_process is None else self.stop)(name)
        self._watch.wait(lambda: not self.alive(name), START_LIMIT)
        self._run.supervisor.restart(name)
        self.wait_for_processes(name)
        self._wait_until_joined(name)

    def _wait_until_joined(self, name: str) -> None:
        """Lock-step: wait until a process of the team takes part from the next tick on."""

        def takes_part() -> bool:
            status = self.sim_status
            return name in status.joining or name in status.participants

        kind = kind_of(name)
        if (
            self._watch.interval
            and kind is not None
            and kind.in_lockstep
            and not self._watch.wait(takes_part, START_LIMIT)
        ):
            raise TeamTimeout(f"{name} does not take part in lock-step within {START_LIMIT:g} s")

    def _wait_until_left(self, name: str) -> None:
        """Lock-step: wait until a process that has ended takes no part any more: the next tick is without it."""
        kind = kind_of(name)
        may_take_part = kind is None or kind.in_lockstep
        if not self._watch.interval or not may_take_part or not self.alive(names.SIMULATOR):
            return
        if not self._watch.wait(lambda: name not in self.sim_status.participants, START_LIMIT):
            raise TeamTimeout(f"{name} has ended and still takes part in lock-step after {START_LIMIT:g} s")

    def wait_for_line(self, name: str, text: str) -> None:
        """Wait until a process has written a line that holds `text`."""
        if not self._watch.wait(lambda: any(text in line for line in self.lines(name)), START_LIMIT):
            raise TeamTimeout(f"{name} never said {text!r}; its last lines: {self.lines(name)[-3:]}")

    def wait_for(self, condition: Callable[[], bool]) -> None:
        """Wait until `condition()` by the host's clock: for what processes say or do while the world stands still."""
        if not self._watch.wait(condition, START_LIMIT):
            raise TeamTimeout(f"not true within {START_LIMIT:g} s")

    def report_log(self) -> str:
        """Everything the processes wrote, for a failed test's report."""
        return "\n".join(f"[{name}] {line}" for name, line in self._watch.log)

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
        if self._run.state is RunState.NEW:
            raise UsageError(f"team.{call}: no process runs yet: call team.start or team.launch first")

    def wait_for_go(self) -> None:
        """Wait until the monitor has given GO; in lock-step, until the first tick after GO is over."""
        self._need_team("wait_for_go")
        if not self._watch.wait(lambda: self.is_go, START_LIMIT):
            raise TeamTimeout("no GO: " + "; ".join(self.lines(names.MONITOR)[-3:]))
        if self._watch.interval and not self._watch.wait(lambda: self.report.ticks > 0, START_LIMIT):
            raise TeamTimeout(f"the first tick is held: waiting for {self.sim_status.waiting_for}")
        if self._watch.interval:
            self._watch.take_status(self.sim_status)

    def run(self, seconds: float) -> None:
        """Let `seconds` of simulated time pass: in lock-step to the tick."""
        if not 0.0 <= seconds < math.inf:
            raise UsageError(f"team.run({seconds!r}): give the seconds of simulated time that are to pass, 0 or more")
        self._need_team("run")
        if self._watch.interval:
            self._step(round(seconds * 1e9 / self._watch.interval))
            return
        end = self.now + seconds
        self._until_in_real_time(lambda: self.now >= end, end, seconds)

    def at(self, tick: int) -> Self:
        """Let the world go on until it stands at `tick` (lock-step). Return the team, for the next call."""
        self._need_team("at")
        if not self._watch.interval:
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
        if not self._watch.interval:
            self._until_in_real_time(condition, end, within)
            return
        while not condition():
            if self.now >= end:
                raise _not_true(within, self.now, self._view)
            self._step(1)

    def _until_in_real_time(self, condition: Callable[[], bool], end: float, within: float) -> None:
        """Wait in real time until `condition()`."""
        last, quiet_since, watch = self.now, monotonic(), Wait()
        while True:
            # Without the view's lock: a condition may ask the bus, whose thread may need the lock to go on.
            seen = self._view.version
            if condition():
                self._watch.wait_for_silent()
                return
            if self.now > end:
                raise _not_true(within, self.now, self._view)
            self._watch.look_for_hangs(watch)
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
                self._watch.check()
                wait([answer], LOOK)
            try:
                status = answer.result()
            except BusError as error:
                self._watch.check()
                raise TeamTimeout(f"simulated time stands still at {self.now:.1f} s: {error}") from None
            self._watch.take_status(status)
            self._wait_for_messages_of(status)

    def _ask_for_steps(self, bus: Bus, count: int) -> SimStatus:
        key, limit = names.service_key(names.SIMULATOR, "step"), max(STALL_LIMIT, 2.0 * self._watch.silence_limit)
        return bus.ask(key, SimStatus, StepRequest(count), timeout=limit)

    def _wait_for_messages_of(self, status: SimStatus) -> None:
        def arrived() -> bool:
            return self._view.reaches(status.now, status.robots)

        if not arrived():
            # No message was lost in tens of thousands of ticks, but the bus does not promise that.
            self.sim.repeat()
            if not self._watch.wait(arrived, START_LIMIT):
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
