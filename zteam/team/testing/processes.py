"""The processes of a team under test, or its nodes in this process: a router and a namespace of their own, start, end,
output and presence, and a watch on those that end or hang though the test did not ask for that.

Waits here count host seconds, because a starting or ending process has no simulated time. Their limits are generous.
"""

import itertools
import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import Future, wait
from contextlib import ExitStack, suppress
from functools import partial
from itertools import takewhile
from pathlib import Path
from textwrap import dedent
from threading import Thread
from typing import TYPE_CHECKING, Any, TypeVar

from zteam import names
from zteam.bus import Bus, BusOptions, connect
from zteam.bus.options import LEASE
from zteam.clock import HOST_FACTOR, monotonic
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import BusError, UsageError, ZteamError
from zteam.monitor.observer import RobotView, TeamObserver
from zteam.node.faults import ENDED
from zteam.node.kinds import ROUTER
from zteam.node.process_options import LOCKSTEP_TIMEOUT
from zteam.simulator.client import SimStatus, SimulatorClient
from zteam.team.chaos.links import Links
from zteam.team.chaos.signals import Signals
from zteam.team.in_process.run import InProcessRun
from zteam.team.in_process.user_calls import UserCall, user_calls
from zteam.team.launch.plan import command_line, is_own, stop_order
from zteam.team.launch.process import exit_text, zteam_command
from zteam.team.launch.run import lease_for, start_router, wait_for_endpoint
from zteam.team.launch.supervisor import GRACE, Job, Supervisor
from zteam.team.launch.team_launch import Pace
from zteam.team.launch.warm_parent import WarmParent
from zteam.team.own_code import search_folders
from zteam.team.security.access import OPERATOR
from zteam.team.security.certificates import files_of
from zteam.team.testing.hangs import LOOK, Stacks, Wait
from zteam.team.testing.others import RETURN, Others, TeamAccess

if TYPE_CHECKING:
    from zteam.team.testing.chaos import TeamChaos

_LAST_LINES = 5
"""Of a process that has ended without an error of the user's code."""
START_LIMIT = 60.0 * HOST_FACTOR
"""Host seconds for processes to start: many times the longest start on a crowded machine."""

_SILENT_AFTER = 1.5
"""Host seconds without a status (they come at 1 Hz) after which a robot is waited for."""
_TRIES = 3
"""How often a team in this process is asked to end."""
_SHORT_GRACE = 0.5 * HOST_FACTOR
"""Host seconds for each of these where a node is known to hang."""

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

R = TypeVar("R")

numbers = itertools.count(1)
_KEPT_LINES = 50_000
"""Of all processes of a test, at least."""


class TeamFailure(ZteamError, AssertionError):  # noqa: N818 - it is a failed assertion first
    """A process of the team has ended or hangs, and the test did not ask for that."""

    # Where users import it from; a summary has little room.
    __module__ = "zteam.testing"


class TeamTimeout(TeamFailure):
    """A condition did not come true in time."""

    __module__ = "zteam.testing"


class TeamProcesses:
    """Real processes by name, or the nodes of a team in this process. None ends or hangs unnoticed.

    The router is started when it is needed.
    """

    def __init__(self, rootdir: Path | None = None, *, live: bool = False) -> None:
        """`rootdir` is that of pytest: the team's processes look for modules there, too. With `live` the lines of the
        processes are printed as they come."""
        self._rootdir = rootdir
        self._others: Others | None = None
        """None until the router runs, and without processes."""
        self.namespace = f"test_{os.getpid()}_{next(numbers)}"
        """Key prefix of this team alone."""
        self._live = live
        self._supervisor = Supervisor(self._take_line, lambda *_: None, WARM_PARENT.start)
        self._signals = Signals(lambda: self._supervisor.processes)
        self._bus: Bus | None = None
        """None until the router runs or the team in this process is made."""
        self._endpoint = ""
        self._lease: float | None = None
        """Of the sessions of a team that was started, in host seconds."""
        self._certificates: Path | None = None
        """The folder of a secure team's."""
        self._seen: TeamObserver
        self._links: Links | None = None
        """Of a team that was started with `chaos=True`."""
        self._in_process: InProcessRun | None = None
        """The team in this process; None for processes."""
        self._in_process_ends = ExitStack()
        self._stacks = Stacks()
        self._interval = 0
        """Simulated ns of a tick in lock-step; 0 while the team is not in lock-step."""
        self._silence_limit = LOCKSTEP_TIMEOUT
        """Host seconds that a living process may be silent."""
        self._has_team = False
        self._begin_test()

    def _begin_test(self) -> None:
        """Forget what happened in the test before."""
        self.log: list[tuple[str, str]] = []
        """(process, line) in the order of arrival, for the report of a failed test: the newest."""
        self._chaos: TeamChaos | None = None
        self._at_end = False
        self._may_end: set[str] = set()
        """Processes that may end or hang."""
        self._hangs: dict[str, str] = {}
        """How processes hang, in words."""
        self._present: set[str] = set()
        """Processes of the team that were there once."""
        self._restarts: set[str] = set()
        """Processes that are started again when they have failed."""
        self._participants: set[str] = set()
        """Those that are expected, then those of the newest tick that the test has let the world take."""

    def _open(self) -> None:
        """Start the router and open the test's own session, unless that was done before.

        All calls that look at the team come here, so they fail for a process that has failed.
        """
        self._check()
        if self._bus is not None:
            return
        lease = self._session_lease
        router = start_router(self._supervisor, lease=lease, certificates=self._certificates)
        self._endpoint = wait_for_endpoint(self._supervisor, router, START_LIMIT)
        if not self._endpoint:
            raise TeamTimeout(f"the router did not start ({exit_text(router.exit_code)}): {list(router.lines)}")
        self._connect(lease)

    @property
    def _session_lease(self) -> float:
        # A team that comes later may work in lock-step, where processes bear a longer silence of the router.
        return lease_for(Pace(lockstep=True), LEASE) if self._lease is None else self._lease

    def _connect(self, lease: float) -> None:
        """Open the test's own session."""
        tls = None if self._certificates is None else files_of(self._certificates, TEST)
        options = BusOptions(connect=self._endpoint, namespace=self.namespace, lease=lease, tls=tls)
        self._bus = connect(options, patience=START_LIMIT)
        self._signals.serve(self._bus)
        self._seen = TeamObserver(self._bus, *OBSERVED, repeat=self._repeat)
        self._others = Others(
            self._bus,
            self._seen,
            TeamAccess(self._take_line, self.lines, self._words, self._not_awaited, self._own_pids),
        )

    def expect_end(self, *processes: str) -> None:
        """Let these processes end or hang by themselves, at any time: without this that fails the test."""
        self._may_end.update(processes)

    def _check(self) -> None:
        """Raise TeamFailure for a process that has ended or hangs though nothing asked it to."""
        for name, text in self._hangs.items():
            if name not in self._may_end:
                raise TeamFailure(text)
        for process in self._supervisor.failures:
            if process.name not in self._may_end:
                raise TeamFailure(f"{process.name} ended ({exit_text(process.exit_code)}): {self._words(process.name)}")
        if self._others is not None and (text := self._others.failure(at_end=self._at_end)):
            raise TeamFailure(text)

    def _not_awaited(self) -> set[str]:
        """Names of the processes that may end, or that this fixture has started itself."""
        return {*self._may_end, *self._supervisor.members}

    def _own_pids(self) -> set[int]:
        """Of the children of this process that the fixture has started."""
        return {process.pid for process in self._supervisor.processes.values()} | {*WARM_PARENT.pids.values()}

    def _take_line(self, name: str, line: str) -> None:
        self.log.append((name, line))
        if self._live:
            # Most lines name their process.
            sys.stdout.write(f"{line}\n" if f"[{name}]" in line else f"[{name}] {line}\n")
            sys.stdout.flush()
        if len(self.log) > 2 * _KEPT_LINES:
            del self.log[:_KEPT_LINES]

    def lines(self, name: str) -> list[str]:
        """What a process has written so far."""
        return [line for process, line in self.log if process == name]

    def _words(self, name: str) -> str:
        """The last error of a process with the user's frames, else its last lines."""
        return _last_words(name, self.lines(name))

    def _need_processes(self, what: str) -> None:
        if self._in_process is not None:
            raise UsageError(f"team.{what} needs processes: leave in_process out")

    @property
    def bus(self) -> Bus:
        """A session in the team's namespace."""
        self._open()
        assert self._bus is not None
        return self._bus

    @property
    def endpoint(self) -> str:
        """Where the team's router listens."""
        self._need_processes("endpoint")
        self._open()
        return self._endpoint

    @property
    def _view(self) -> TeamObserver:
        self._open()
        return self._seen

    def _repeat(self, arrived: Callable[[], bool]) -> None:
        """Wait until a subscribed topic arrives. A world that stands still is asked to publish its last tick again."""
        if self.alive(names.SIMULATOR):
            if self._interval or self.sim_status.paused:
                self.sim.repeat()
            self._wait(arrived, START_LIMIT)

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

    def _wait(self, condition: Callable[[], bool], limit: float) -> bool:
        """Whether `condition()` comes true within `limit` host seconds."""
        wait, deadline = Wait(), monotonic() + limit
        while True:
            seen = self._view.version
            if condition():
                return True
            self._look_for_hangs(wait)
            if monotonic() >= deadline:
                return False
            # The end of a process is no news on the bus, so check from time to time.
            self._view.wait_for_news(seen, min(0.2, max(0.0, deadline - monotonic())))

    def close(self) -> None:
        """Stop everything, in order."""
        try:
            if self._in_process is not None:
                # What hangs was told to end when it was noticed.
                _close_in_time(self._in_process_ends.close, _SHORT_GRACE if self._hangs else GRACE)
            for group in stop_order(self._supervisor.processes):
                self._supervisor.stop(group)
        finally:
            if self._bus is not None:
                self._bus.close()
            self._supervisor.close()
            if self._links is not None:
                self._links.close()
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
        given = {"ZTEAM_PATH": os.pathsep.join(self._folders), **self._stacks.environment}
        if self._lease is not None:
            given["ZTEAM_LEASE"] = str(self._lease)
        if self._certificates is not None:
            given |= files_of(self._certificates, name).environment
        return {"ZTEAM_CONNECT": self.endpoint, "ZTEAM_NAMESPACE": self.namespace, **given}

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
        self._supervisor.start_job(chosen, Job(command_line(words), environment, may_end=True))
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
        pid: int = self._process(name).pid
        return pid

    def exit_code(self, name: str) -> int | None:
        """Exit code of a process, negative for a signal, None while it runs."""
        code: int | None = self._process(name).exit_code
        return code

    def _process(self, name: str) -> Any:
        """A process of the team, or a node in this process. Raises UsageError."""
        if name not in self._supervisor.members:
            known = ", ".join(self._supervisor.members) or "no process yet"
            raise UsageError(f"there is no process {name!r}; this team has {known}")
        return self._supervisor.members[name]

    def wait_for_processes(self, *processes: str) -> None:
        """Wait until these names are present on the bus; a process that ends instead fails the test at once."""

        def ended() -> list[str]:
            known = self._supervisor.members
            return [n for n in processes if n in known and not known[n].running]

        self._wait(lambda: bool(ended()) or all(self.alive(n) for n in processes), START_LIMIT)
        if ended():
            first = ended()[0]
            raise TeamTimeout(f"{first} ended ({exit_text(self.exit_code(first))}): {self._words(first)}")
        missing = [n for n in processes if not self.alive(n)]
        if missing:
            where = "".join(f"; {name}: {text}" for name in missing if (text := self._stacks.where(name)))
            raise TeamTimeout(f"{', '.join(missing)} did not come up within {START_LIMIT:g} s{where}")
        self._present.update(self._supervisor.members.keys() & {*processes})
        self._watch_others(processes)
        if names.SIMULATOR in processes:
            status = self.sim_status
            self._interval = status.interval if status.lockstep else 0

    def wait_for_exit(self, name: str) -> int:
        """Wait until a process has ended, which it may do; its exit code."""
        process = self._process(name)
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

    def _take_status(self, status: SimStatus) -> None:
        """Notice the processes that were left behind, and wait for the end of those that left.

        They are gone in the world's time; the end of their processes takes the host's.
        """
        self._note_left_behind(status)
        left = self._participants.difference(status.participants, status.joining)
        self._participants = {*status.participants}
        self._watch_others(status.participants, expected=False)
        if (others := self._others) is not None and left - self._not_awaited():
            # `_check` fails for those that stay away.
            self._wait(lambda: all(gone.settled for gone in others.gone()), 2.0 * RETURN)
        for name in left.intersection(self._supervisor.members) - self._may_end - self._restarts:
            if not self._wait(partial(self._has_ended_or_joined, name), self._silence_limit):
                self._note_hang(name, "it lives and has left the bus")
        self._check()

    def _watch_others(self, processes: Iterable[str], *, expected: bool = True) -> None:
        if self._others is not None:
            self._others.watch(processes, expected=expected)

    def _has_ended_or_joined(self, name: str) -> bool:
        process, status = self._process(name), self.sim_status
        if process.exit_code is not None:
            process.join(START_LIMIT)
        return process.exit_code is not None or name in status.participants or name in status.joining

    def _note_left_behind(self, status: SimStatus) -> None:
        for name in status.hung:
            self._note_hang(
                name, f"lock-step left it behind, without an answer for {self._silence_limit:g} s or cut off"
            )

    def _note_hang(self, name: str, how: str) -> None:
        """The process hangs: with the line of the user's code that it is in, or else `how`, in words."""
        if name in self._hangs or name in self._may_end:
            return
        where = self._stacks.where(name)
        text = f"after {self._silence_limit:g} s {where}" if where else f"{how}; its last lines:\n{self._words(name)}"
        self._hangs[name] = f"{name} hangs: {text}"

    def _look_for_hangs(self, wait: Wait) -> None:
        """Notice, during a wait, the processes that were left behind, or that are silent; of nodes in this process the
        watch on the calls does so."""
        if self._in_process is not None or not wait.is_due() or not self._is_in_view:
            return
        if self._interval:
            with suppress(BusError):
                self._note_left_behind(SimulatorClient(self.bus, LOOK).status())
        else:
            limit = max(self._silence_limit, _SILENT_AFTER)
            for name, spoke in self._silent():
                if max(spoke, wait.since) < monotonic() - limit:
                    self._note_hang(name, f"it gives no sign of life for {self._silence_limit:g} s")
        self._check()

    @property
    def _is_in_view(self) -> bool:
        """Whether what the test sees of its team is the team's doing: its simulator and its router run."""
        router, simulator = (self._supervisor.members.get(name) for name in (ROUTER, names.SIMULATOR))
        paused = self._may_end & {ROUTER, names.SIMULATOR}
        return router is not None and router.running and (simulator is None or simulator.running) and not paused

    def _silent(self) -> list[tuple[str, float]]:
        """The robots that live and whose last status is long ago, and the host time of that."""
        now, robots = monotonic(), {i: name for name in self._present if (i := names.robot_id_of(name)) is not None}
        spoke = {name: self._view.robot(i).spoke for i, name in robots.items()}
        return [
            (name, at)
            for name, at in spoke.items()
            if name not in self._may_end and self.alive(name) and 0.0 < at < now - _SILENT_AFTER
        ]

    def _wait_for_silent(self) -> None:
        """Real time: wait for the next status of robots whose last one is long ago. One that sends none hangs."""
        if self._interval:
            return
        if self._in_process is not None:
            # The watch on the calls says which one hangs.
            open_now = [call.frames[0] for call in user_calls() if call.owner in self._present]
            self._wait(lambda: not any(call.frames[0] in open_now for call in user_calls()), START_LIMIT)
        else:
            self._wait(lambda: not self._silent(), max(START_LIMIT, 2.0 * self._silence_limit))
        self._check()

    def _take_hang(self, call: UserCall) -> bool:
        """A call of a node's own code in this process lasts too long. Before `run` it may be slow work of a start."""
        if call.owner not in self._present:
            return False
        self._hangs.setdefault(call.owner, f"{call.owner} hangs: after {self._silence_limit:g} s {call.describe()}")
        return True

    def check_at_end(self) -> None:
        """Raise TeamFailure for a process that has ended or hangs unasked, and does not come back."""
        self._at_end = True
        try:
            self._check_at_end()
        finally:
            self._at_end = False

    def _check_at_end(self) -> None:
        self._check()
        if self._bus is None or (self._in_process is None and not self._process(ROUTER).running):
            # Without its router a team sees nothing of itself.
            return
        self._wait_for_silent()
        others = self._others
        if others is not None:
            self._wait(lambda: all(gone.settled for gone in others.gone() if gone.code), RETURN)
            # In lock-step the world has not moved without them.
            if not self._interval and (missing := others.missing()):
                raise TeamFailure(f"{', '.join(missing)}: expected, and never came")
        ended = self._supervisor.ended
        gone = [n for n in self._present - self._may_end if n not in ended and not self.alive(n)]
        self._wait(lambda: all(n in ended or self.alive(n) for n in gone), START_LIMIT)
        for name in gone:
            if name in ended:
                self._process(name).join(START_LIMIT)
            elif not self.alive(name):
                raise TeamFailure(f"{name} is gone and did not come back within {START_LIMIT:g} s: {self._words(name)}")
        self._check()


def _last_words(name: str, said: list[str]) -> str:
    for i in reversed(range(len(said))):
        _, found, told = said[i].partition(ENDED)
        if found:
            # A process writes each line by itself, up to the next one of its log.
            lines = told.splitlines()[1:] or takewhile(lambda line: f"[{name}] " not in line, said[i + 1 :])
            # A log indents the further lines of what it prints.
            text = dedent("\n".join(lines)).splitlines()
            return "\n".join([*text[-1:], *text])
    return "\n".join(said[-_LAST_LINES:])


def in_thread(call: Callable[[], R]) -> "Future[R]":
    """What `call()` returns or raises, from a thread of its own: a node that hangs may hold what the call waits for."""
    done = Future[R]()

    def work() -> None:
        try:
            done.set_result(call())
        except BaseException as error:
            done.set_exception(error)

    Thread(target=work, name="team", daemon=True).start()
    return done


def _close_in_time(close: Callable[[], None], grace: float) -> None:
    """Call `close()`, which ends the team, and end the calls that hold it up; a node that cannot be ended is left."""
    # The locks of a node that hangs would hold this thread for ever.
    done = in_thread(close)
    for _ in range(_TRIES):
        wait([done], grace)
        if done.done():
            break
        for call in user_calls():
            call.end()
    if done.done():
        done.result()
