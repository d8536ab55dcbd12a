"""A team of real processes for a test: own router, own namespace, everything in view, no process left behind; or the
same team in the test's own process.

The team works in lock-step, and its world stands still except where the test lets it go on: what a test sees depends
on the seed alone. Limits named `within` are simulated seconds, so that a slow machine makes a test slow and not wrong.
"""

import copy
import hashlib
import itertools
import logging
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack, closing
from functools import cache, partial
from pathlib import Path
from typing import Any, Self, overload

from msgspec import structs

from zteam import names
from zteam.bus import Bus, BusOptions
from zteam.clock import HOST_FACTOR
from zteam.config.resources import find_team, find_world
from zteam.errors import UsageError, check_call, log
from zteam.monitor.observer import RobotView
from zteam.node.faults import STACKS
from zteam.node.logs import KEEPER
from zteam.node.process_options import LOCKSTEP_TIMEOUT
from zteam.robot.behaviors.behavior import Behavior
from zteam.robot.behaviors.registry import look_in
from zteam.robot.client import StopClient, need_done
from zteam.simulator.client import SimReport, SimStatus, SimulatorClient
from zteam.team.arguments import checks_arguments
from zteam.team.chaos.means import Means
from zteam.team.file.reading import read_team_file, read_team_tables
from zteam.team.file.sources import argument_texts
from zteam.team.launch.check import check_team, refuse_nodes
from zteam.team.launch.plan import Pace, TeamLaunch, command_line, is_own, with_recording
from zteam.team.launch.process import Job, Process, zteam_command
from zteam.team.launch.supervisor import GRACE
from zteam.team.launch.warm_parent import WarmParent
from zteam.team.run.processes import ANY_PORT, Processes
from zteam.team.run.team_run import RunState, TeamRun
from zteam.team.run.threads import Body, Threads
from zteam.team.security.access import OPERATOR
from zteam.team.testing.chaos import TeamChaos
from zteam.team.testing.start import own_nodes, robot_tables, spec_of
from zteam.team.testing.watch import START_LIMIT, TeamTimeout, Watch, close_in_time

_CONDITION = "give a function that is asked again and again, as 'lambda: team.robot(0).speed > 0.1'"
_SHORT_GRACE = 0.5 * HOST_FACTOR
"""Host seconds to close a team in this process where a node is known to hang."""
_SITE = str(Path(__file__).parent / "site")
"""A folder with the module that Python imports when it starts."""
_ROUTERLESS = 10.0 * HOST_FACTOR
"""Host seconds without a router after which a node ends that the test has left behind."""
WARM_PARENT = WarmParent()
"""Of all teams of this pytest process."""
TEST = "test"
"""The certificate of the test itself, in a secure team."""
numbers = itertools.count(1)


@checks_arguments("team.")
class TeamFixture:
    """The `team` fixture: starts whole teams, lets their simulated time go on, and makes trouble on purpose. The router
    is started when it is needed."""

    def __init__(
        self,
        rootdir: Path | None = None,
        *,
        live: bool = False,
        test: str = "",
        folder: Callable[[], Path] = Path.cwd,
        records: bool = False,
    ) -> None:
        """`rootdir` is that of pytest: the team's processes look for modules there, too. With `live` the lines of the
        processes are printed as they come. `test` is the name of the test, `folder()` where its recording is, and with
        `records` there is one in any case."""
        self._rootdir, self._live, self._test, self._records = rootdir, live, test, records
        self._folder = cache(folder)
        self.namespace = f"test_{os.getpid()}_{next(numbers)}"
        """Key prefix of this team alone."""
        self._watch = Watch(live=live)
        self._processes = Processes(
            BusOptions(namespace=self.namespace),
            WARM_PARENT,
            self._watch.on_line,
            name=TEST,
            listen=ANY_PORT,
            environment=lambda: {"ZTEAM_PATH": os.pathsep.join(self._folders), STACKS: self._watch.stacks.name},
        )
        self._run = self._watch.team_run = TeamRun(self._processes, is_launcher=False)
        self._chaos: TeamChaos | None = None
        self._ends = ExitStack()
        """Of what the run leaves."""
        self._ends.callback(self._watch.stacks.cleanup)

    def _opened(self) -> Watch:
        """The watch, with a router and the test's own session. All calls that look at the team come here, so they fail
        for a process that has failed."""
        self._watch.check()
        if self._run.state is RunState.NEW:
            self._run.open()
            self._watch.observe()
        return self._watch

    @property
    def recording(self) -> Path:
        """The file of a team that is recorded."""
        name = re.sub(r"[^A-Za-z0-9_.-]+", "_", self._test)[-80:]
        # Two tests may have names that differ in other letters alone.
        return self._folder() / f"{name}_{hashlib.sha256(self._test.encode()).hexdigest()[:6]}.mcap"

    def expect_end(self, *processes: str) -> None:
        """Let these processes end or hang by themselves, at any time: without this that fails the test."""
        self._watch.may_end.update(processes)

    def check_at_end(self) -> None:
        """Raise TeamFailure for a process that has ended or hangs unasked, and does not come back."""
        self._watch.check_at_end()

    def lines(self, name: str) -> list[str]:
        """What a process has written so far."""
        return self._watch.lines(name)

    def _need_team(self, call: str) -> None:
        """Raise UsageError before anything was opened: nothing would ever happen."""
        if self._run.state is RunState.NEW:
            raise UsageError(f"team.{call}: no process runs yet: call team.start or team.launch first")

    def _need_processes(self, what: str) -> None:
        if self._watch.threads is not None:
            raise UsageError(f"team.{what} needs processes: leave in_process out")

    def _opened_processes(self, what: str) -> Processes:
        self._need_processes(what)
        self._opened()
        return self._processes

    @property
    def bus(self) -> Bus:
        """A session in the team's namespace."""
        return self._opened().bus

    @property
    def endpoint(self) -> str:
        """Where the team's router listens."""
        return self._opened_processes("endpoint").endpoint

    def robot(self, robot_id: int) -> RobotView:
        """What the bus tells about a robot. Raises UsageError for one that neither the world nor a process has."""
        return self._opened().robot(robot_id)

    def alive(self, name: str) -> bool:
        """Whether a process holds this name on the bus."""
        return self._opened().seen.alive(name)

    def close(self) -> None:
        """Stop everything, in order."""
        with self._ends:
            leave = partial(self._run.__exit__, None, None, None)
            if self._watch.threads is None:
                leave()
            else:
                # What hangs was told to end when it was noticed.
                close_in_time(leave, _SHORT_GRACE if self._run.members.hangs else GRACE)

    @property
    def environment(self) -> dict[str, str]:
        """Environment that makes any zteam command join this team; a secure team takes it for people's tools. A Python
        program then finds modules where the test does, behind its own, and a node ends some seconds after the team."""
        paths = filter(None, [_SITE, os.environ.get("PYTHONPATH")])
        own = {"PYTHONPATH": os.pathsep.join(paths), "ZTEAM_GIVE_UP": str(_ROUTERLESS)}
        return {**self._opened_processes("environment").environment(OPERATOR), **own}

    @property
    def _folders(self) -> list[str]:
        """Where the test finds modules, besides what is installed."""
        rootdir = [] if self._rootdir is None else [str(self._rootdir)]
        return list(dict.fromkeys([*search_folders(), *rootdir]))

    def spawn(self, command: str | Path, *arguments: str | Path | float, name: str | None = None) -> str:
        """Start any program in this team, in the test's current folder; the name of the process.

        `python` is this interpreter, and commands of zteam (`zteam-robot`, `zteam`, …) run with it. It ends with the
        team, with all that it starts. Return at once: use `wait_for_processes` to wait until a node is present. A node
        is known by its name on the bus, so give it as `name`. Raises ZteamError if there is no such program.
        """
        processes = self._opened_processes("spawn")
        words = [str(command), *map(str, arguments)]
        chosen = name or f"{Path(command).name} #{next(numbers)}"
        # What is forked takes no other PYTHONPATH, and needs none.
        environment = processes.environment(OPERATOR) if is_own(words[0]) else self.environment
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
        return self._process(name, "pid").pid

    def _process(self, name: str, call: str) -> Process:
        """A process of the team, for a call that needs one. Raises UsageError."""
        self._need_processes(call)
        member = self._watch.member(name)
        assert isinstance(member, Process)
        return member

    def exit_code(self, name: str) -> int | None:
        """Exit code of a process, negative for a signal, None while it runs."""
        return self._watch.member(name).exit_code

    def wait_for_processes(self, *processes: str) -> None:
        """Wait until these names are present on the bus; a process that ends instead fails the test at once."""
        self._opened().wait_for_processes(*processes)

    def wait_for_exit(self, name: str) -> int:
        """Wait until a process has ended, which it may do; its exit code."""
        process = self._watch.member(name)
        self.expect_end(name)
        if not process.join(START_LIMIT) or process.exit_code is None:
            raise TeamTimeout(f"{name} still runs after {START_LIMIT:g} s")
        return process.exit_code

    @property
    def sim(self) -> SimulatorClient:
        """The simulator's queries as calls: pause, resume, speed, reset, spawn, remove, move."""
        return self._opened().sim

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
        record: bool = False,
    ) -> None:
        """Start a team file (or shipped team), and wait until all its processes are there; the rest as in `start`.

        `arguments` are those of the team file, by name. Its nodes are waited for if they have `expect = true`. With
        `secure`, a folder of certificates, which is made where it is missing, each process has one of its own; the test
        itself may do everything, and tools what the team file grants `operator`.
        """
        if secure is not None:
            self._processes.certificates = Path(secure)
        path = find_team(team)
        file = read_team_file(path, argument_texts(arguments or {}))
        file.team = structs.replace(file.team, folders=(*file.team.folders, *self._folders))
        replaced = find_world(world).resolve() if world is not None else None
        chosen = check_team(file, replaced)
        if in_process:
            refuse_nodes(file, "leave in_process out")
        pace = Pace(lockstep=lockstep and chosen is not None, timeout=lockstep_timeout, paused=lockstep)
        launch = TeamLaunch(file.team, chosen, team_file=path.resolve(), pace=pace)
        self._launch(launch, {}, in_process, chaos, record)

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
        nodes: Mapping[str, Body | str] | None = None,
        in_process: bool = False,
        chaos: bool = False,
        record: bool = False,
    ) -> None:
        """Start a team in `world` and wait until all its processes are there.

        `robots` is a number, a list of ids, or ids as text such as "0,2-4". A robot in `follow` follows the robot named
        there, the others run `behavior`, a name or a class of a module; `params` gives behaviour parameters by robot.
        With `lockstep` the world stands still until `run`, `until` or `at` let it go on, as fast as the processes can;
        own nodes in `expect` take part from the first tick on; a living process that does not answer is left behind
        after `lockstep_timeout` host seconds. Without `lockstep` the team runs in real time.

        With `chaos` each process has a link of its own to the router, which `team.chaos` can cut or make slow.
        `nodes` are own nodes by name, which take part from the first tick on: each is a function of the node as for
        `zteam.run`, given as text "module:function". With `in_process` the whole team runs in the test's process, which
        starts it in a fifth of a second and steps it many times faster, with the same result; a node may then be the
        function itself. Calls that need processes are refused. With `record` the run is in the file `recording`, which
        is whole when the team has ended.
        """
        tables = robot_tables(robots, spec_of(behavior), follow or {}, params or {})
        file = read_team_tables("team.start", {"robots": tables})
        # In the order of this process; the current folder follows.
        file.team = structs.replace(file.team, folders=tuple(self._folders))
        if in_process:
            look_in([*file.team.folders, ""])
        chosen = check_team(file, find_world(world).resolve(), here=in_process)
        own = own_nodes(nodes or {}, file.team.folders, here=in_process)
        bodies = {name: body for name, body in (nodes or {}).items() if not isinstance(body, str)}
        pace = Pace(lockstep=lockstep, timeout=lockstep_timeout, expect=(*expect, *(nodes or ())), paused=lockstep)
        launch = TeamLaunch(file.team, chosen, seed, pace=pace, own=own)
        self._launch(launch, bodies, in_process, chaos, record)

    def _launch(
        self, launch: TeamLaunch, bodies: Mapping[str, Body], in_process: bool, chaos: bool, record: bool
    ) -> None:
        """Start a team; `bodies` are own nodes that are functions in this process."""
        if self._run.plan.jobs:
            text = "a test has one team, and this one has started: use team.restart, team.sim or a second test"
            raise UsageError(text)
        if in_process and (chaos or self._processes.certificates is not None):
            raise UsageError("chaos and secure are for processes: leave in_process out, or them")
        self._watch.silence_limit = launch.pace.timeout
        if record or self._records:
            launch = with_recording(launch, self.recording, f"pytest {self._test}", force=True)
        if in_process:
            self._open_in_process(bodies)
        elif chaos and self._processes.links is None:
            from zteam.team.chaos.links import Links

            self._processes.links = self._ends.enter_context(closing(Links()))
        self._run.plan_for(launch)
        self._opened()
        self._run.start()
        self._watch.wait_for_members()

    def _open_in_process(self, nodes: Mapping[str, Body]) -> None:
        if self._run.state is not RunState.NEW:
            raise UsageError("team.start: in_process=True comes first, and once: this team has processes already")
        # As a process of the team logs.
        self._ends.callback(log.setLevel, log.level)
        log.setLevel(logging.INFO)
        take = self._watch.on_log
        self._ends.callback(KEEPER.pass_to(lambda line: take(line.process, line.level, line.text)))
        self._processes.close()
        self._run = self._watch.team_run = TeamRun(Threads(nodes, name=TEST, ends_calls=True), is_launcher=False)

    @property
    def chaos(self) -> TeamChaos:
        """Faults on purpose that wait for the recovery."""
        self._opened()
        if self._chaos is None:
            simulate = self.sim.fault if self._watch.interval else None
            means = Means(self._run.signals.send, self._run.members.change_link, simulate)
            self._chaos = TeamChaos(self._watch, means)
        return self._chaos

    def kill(self, name: str) -> None:
        """End a process at once (SIGKILL) and wait until it is gone."""
        process = self._process(name, "kill")
        self._watch.check()
        process.stopping = True
        process.kill()
        process.join(START_LIMIT)
        self._watch.wait_until_left(name)

    @overload
    def stop(self, name: None = None, *, robots: Collection[int] | None = None) -> None: ...

    @overload
    def stop(self, name: str) -> int: ...

    def stop(self, name: str | None = None, *, robots: Collection[int] | None = None) -> int | None:
        """Stop the robots where they are, all or these, as `zteam stop` does, until `release`. With the `name` of a
        process: ask that process to end (SIGTERM), or a node in this process; its exit code."""
        if name is None:
            need_done(self._stops("stop").engage(robots), TeamTimeout)
            return None
        if robots is not None:
            raise UsageError("team.stop: give the name of a process to end, or robots to stop")
        self._watch.member(name).terminate()
        code = self.wait_for_exit(name)
        self._watch.wait_until_left(name)
        return code

    def release(self, robots: Collection[int] | None = None) -> None:
        """Let the robots that were stopped go on, all or these."""
        need_done(self._stops("release").release(robots), TeamTimeout)

    def _stops(self, call: str) -> StopClient:
        self._need_team(call)
        return StopClient(self.bus, self._watch.seen.process_names)

    def pause_process(self, name: str) -> None:
        """Freeze a process (SIGSTOP). From here on it may hang."""
        process = self._process(name, "pause_process")
        self.expect_end(name)
        process.signal(signal.SIGSTOP)

    def resume_process(self, name: str) -> None:
        """Let a frozen process go on (SIGCONT)."""
        self._process(name, "resume_process").signal(signal.SIGCONT)

    def restart(self, name: str) -> None:
        """Start a process again with the same command and wait until it is there; end it first if it still runs."""
        if self._watch.member(name).running:
            # A node in this process cannot be killed.
            (self.kill if self._watch.threads is None else self.stop)(name)
        self._watch.wait(lambda: not self.alive(name))
        self._run.supervisor.restart(name)
        self._watch.wait_for_return(name)

    def wait_for_line(self, name: str, text: str) -> None:
        """Wait until a process has written a line that holds `text`."""
        if not self._watch.wait(lambda: any(text in line for line in self.lines(name))):
            raise TeamTimeout(f"{name} never said {text!r}; its last lines: {self.lines(name)[-3:]}")

    def wait_for(self, condition: Callable[[], bool]) -> None:
        """Wait until `condition()` by the host's clock: for what processes say or do while the world stands still."""
        check_call(condition, 0, f"team.wait_for({condition!r:.60}): {_CONDITION}")
        self._watch.wait_for(condition)

    def report_log(self) -> str:
        """For a failed test's report: everything the processes wrote, and whether the test let the world go on."""
        lines = [f"[{name}] {line}" for name, line in self._watch.log.copy()]
        if self._watch.interval and not self._watch.has_moved:
            lines.append("the world stood still: in lock-step it goes on with team.run, team.until and team.at alone")
        return "\n".join(lines)

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
        return self._opened().seen.now / 1e9

    @property
    def is_go(self) -> bool:
        """Whether the monitor has given GO."""
        return self._opened().is_go

    @property
    def status(self) -> Any:
        """The newest TeamStatus, or None."""
        return self._opened().seen.team_status

    def wait_for_go(self) -> None:
        """Wait until the monitor has given GO; in lock-step, until the first tick after GO is over."""
        self._need_team("wait_for_go")
        watch = self._watch
        if not watch.wait(lambda: watch.is_go):
            raise TeamTimeout("no GO: " + "; ".join(watch.lines(names.MONITOR)[-3:]))
        if watch.interval:
            if not watch.wait(lambda: watch.sim.report().ticks > 0):
                raise TeamTimeout(f"the first tick is held: waiting for {watch.sim.status().waiting_for}")
            watch.on_status(watch.sim.status())

    def run(self, seconds: float) -> None:
        """Let `seconds` of simulated time pass: in lock-step to the tick."""
        self._need_team("run")
        self._watch.run(seconds)

    def at(self, tick: int) -> Self:
        """Let the world go on until it stands at `tick` (lock-step). Return the team, for the next call."""
        self._need_team("at")
        if not self._watch.interval:
            raise UsageError("at() needs lock-step: in real time no tick is waited for")
        if tick < self.tick:
            raise UsageError(f"the world is at tick {self.tick} already, beyond {tick}")
        self._watch.step(tick - self.tick)
        return self

    def until(self, condition: Callable[[], bool], within: float) -> None:
        """Let the world go on until `condition()`, checked after every tick; fail after `within` simulated seconds. In
        real time the condition is checked whenever a message arrives. Simulated time that stands still for a minute of
        the host fails too."""
        check_call(condition, 0, f"team.until({condition!r:.60}, …): {_CONDITION}")
        self._need_team("until")
        self._watch.until(condition, within)


class SharedTeam(TeamFixture):
    """The `team_module` and `team_session` fixtures: each test finds the team as `start` or `launch` left it, because
    it is started anew."""

    _call: tuple[Any, ...] | None = None
    """What has started the team, `start` or `launch`, and its arguments."""
    _is_new = False
    """Whether this test may still start the team."""

    def start(self, *args: Any, **kwargs: Any) -> None:
        """As `Team.start`. A later test may start the same team again, which is there already, or another one."""
        self._begin(super().start, args, kwargs)

    def launch(self, *args: Any, **kwargs: Any) -> None:
        """As `Team.launch`, and in a later test as `start`."""
        self._begin(super().launch, args, kwargs)

    def _begin(self, begin: Callable[..., None], args: Any, kwargs: Any) -> None:
        call = begin, *copy.deepcopy((args, kwargs))
        if self._is_new:
            self._is_new = False
            if call == self._call:
                return
            self._end()
        begin(*args, **kwargs)
        self._call = call

    def _end(self) -> None:
        """End the team: as if nothing had been asked of the fixture yet."""
        self.close()
        self._call = None
        TeamFixture.__init__(
            self, self._rootdir, live=self._live, test=self._test, folder=self._folder, records=self._records
        )

    def put_back(self) -> None:
        """Before a test: end the team of the test before, and start it again with the same arguments."""
        call = self._call
        self._end()
        if call is not None:
            self._call, self._is_new = call, True
            begin, args, kwargs = call
            begin(*args, **kwargs)


def search_folders() -> list[str]:
    """Where this process looks for modules besides what its Python has installed, absolute, in its order."""
    # Only a test pays for these imports.
    import site
    import sysconfig

    installed = {*sysconfig.get_paths().values(), *site.getsitepackages(), site.getusersitepackages()}
    stdlib, version = Path(sysconfig.get_path("stdlib")), "".join(map(str, sys.version_info[:2]))
    # Its compiled modules, and the archive that may stand for it.
    installed |= {str(stdlib / "lib-dynload"), str(stdlib.parent / f"python{version}.zip")}
    entries = [str(Path(entry).absolute()) for entry in sys.path if isinstance(entry, str) and entry not in installed]
    return list(dict.fromkeys(entries))
