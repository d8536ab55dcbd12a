"""A watch on the members of a team under test: none ends or hangs unnoticed though the test did not ask for that.

Waits here count host seconds, because a starting or ending process has no simulated time. Their limits are generous.
"""

import logging
import sys
from collections.abc import Callable, Iterable
from concurrent.futures import wait
from contextlib import suppress
from functools import partial

from zteam import names
from zteam.bus import Bus
from zteam.clock import HOST_FACTOR, monotonic
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import BusError, UsageError, ZteamError
from zteam.messages import Log, TeamState
from zteam.monitor.observer import RobotView, TeamObserver
from zteam.node.faults import log_fault
from zteam.node.kinds import ROUTER
from zteam.node.process_options import LOCKSTEP_TIMEOUT
from zteam.simulator.client import SimStatus, SimulatorClient
from zteam.team.in_process.user_calls import end_user_calls
from zteam.team.launch.process import exit_text
from zteam.team.launch.supervisor import Member
from zteam.team.run.team_run import RunState, TeamRun
from zteam.team.run.threads import Threads, in_thread
from zteam.team.testing.hangs import LOOK, Stacks

OBSERVED = (names.CLOCK, names.TEAM_STATUS, names.GROUND_TRUTH, names.STATUS)
"""What a test sees of its team without asking."""
_LAST_LINES = 5
"""Of a process that has ended without an error of the user's code."""
START_LIMIT = 60.0 * HOST_FACTOR
"""Host seconds for processes to start: many times the longest start on a crowded machine."""
RETURN = 2.5 * HOST_FACTOR
"""Host seconds for a process to be there again whose token is gone: the test may start it again."""
_TRIES = 3
"""How often a team in this process is asked to end."""
_KEPT_LINES = 50_000
"""Of all processes of a test, at least."""


class TeamFailure(ZteamError, AssertionError):  # noqa: N818 - it is a failed assertion first
    """A process of the team has ended or hangs, and the test did not ask for that."""

    # Where users import it from; a summary has little room.
    __module__ = "zteam.testing"


class TeamTimeout(TeamFailure):
    """A condition did not come true in time."""

    __module__ = "zteam.testing"


class Others:
    """Processes that take part though the fixture has not started them, such as a node that the test starts by itself:
    what they log, and which of them are gone."""

    def __init__(
        self,
        bus: Bus,
        seen: TeamObserver,
        take_log: Callable[[str, int, str], None],
        not_awaited: Callable[[], set[str]],
    ) -> None:
        """`take_log(name, level, text)`: a process has logged that. `not_awaited()` are the processes that may end, or
        that the fixture has started itself."""
        self._bus, self._seen, self._take_log, self._not_awaited = bus, seen, take_log, not_awaited
        self._watched: set[str] = set()
        self.expected: set[str] = set()
        """Those that the test has named."""
        self._gone_since: dict[str, float] = {}
        self._faults: dict[str, str] = {}
        """The critical lines of those that an error has ended."""

    def watch(self, processes: Iterable[str], *, expected: bool) -> None:
        """Watch these from here on, which may come later if they are `expected`."""
        if expected:
            self.expected.update(processes)
        for name in set(processes) - self._watched - self._not_awaited():
            self._watched.add(name)
            self._bus.subscribe(names.log_key(name), Log, partial(self._take, name))

    def _take(self, name: str, _key: str, message: Log) -> None:
        if message.level >= logging.CRITICAL and message.function == log_fault.__name__:
            self._faults[name] = message.msg
        self._take_log(name, message.level, message.msg)

    def fault(self, name: str) -> str:
        """The error that ended one, as it has logged it; empty if there is none."""
        return self._faults.get(name, "").partition("\n")[2]

    def missing(self) -> list[str]:
        """Those that must not end and were never there."""
        return sorted(self._watched - self._seen.were_there - self._not_awaited())

    def gone(self) -> dict[str, float]:
        """Those that must not end, were there and are not, and for how many host seconds. Without the router all would
        be gone, so none is."""
        gone = self._watched & self._seen.were_there - self._not_awaited() if self._seen.link_up else set[str]()
        now, gone = monotonic(), {name for name in gone if not self._seen.alive(name)}
        self._gone_since = {name: self._gone_since.get(name, now) for name in sorted(gone)}
        return {name: now - since for name, since in self._gone_since.items()}


class Watch:
    """The lines of the members, how they fail, and what the bus shows. `run` is the team that is watched."""

    run: TeamRun
    seen: TeamObserver

    def __init__(self, stacks: Stacks, *, live: bool) -> None:
        self._stacks, self._live = stacks, live
        self._others: Others | None = None
        """None until there is a bus, and without processes."""
        self.interval = 0
        """Simulated ns of a tick in lock-step; 0 while the team is not in lock-step."""
        self.silence_limit = LOCKSTEP_TIMEOUT
        """Host seconds that a living process may be silent."""
        self.log: list[tuple[str, str]] = []
        """(process, line) in the order of arrival, for the report of a failed test: the newest."""
        self._at_end = False
        self.may_end: set[str] = set()
        """Processes that may end or hang."""
        self.hangs: dict[str, str] = {}
        """How processes hang, in words."""
        self._present: set[str] = set()
        """Processes of the team that were there once."""
        self.participants: set[str] = set()
        """Those that are expected, then those of the newest tick that the test has let the world take."""

    @property
    def threads(self) -> Threads | None:
        """The members of a team in this process; None for processes."""
        return self.run.members if isinstance(self.run.members, Threads) else None

    @property
    def bus(self) -> Bus:
        """The test's own session."""
        assert self.run.members.bus is not None
        return self.run.members.bus

    @property
    def view(self) -> TeamObserver:
        """What the bus shows. Raises TeamFailure as `check`."""
        self.check()
        return self.seen

    @property
    def is_go(self) -> bool:
        """Whether the monitor has given GO. Raises TeamFailure as `check`."""
        status = self.view.team_status
        return status is not None and status.state == TeamState.GO

    @property
    def sim(self) -> SimulatorClient:
        """The simulator's queries as calls. Raises TeamFailure as `check`."""
        self.check()
        return SimulatorClient(self.bus, START_LIMIT)

    def status(self, timeout: float = START_LIMIT) -> SimStatus:
        """The simulator's. Raises BusError."""
        return SimulatorClient(self.bus, timeout).status()

    @property
    def restarts(self) -> set[str]:
        """Processes that are started again when they have failed."""
        return {name for name, job in self.run.plan.jobs.items() if job.restarts}

    def observe(self) -> None:
        """Watch the team on a session that was opened."""
        self.seen = TeamObserver(self.bus, *OBSERVED, repeat=self._repeat)
        if self.threads is None:
            self._others = Others(self.bus, self.seen, self.take_log, self._not_awaited)

    def _repeat(self, arrived: Callable[[], bool]) -> None:
        """Wait until a subscribed topic arrives. A world that stands still is asked to publish its last tick again."""
        if self.view.alive(names.SIMULATOR):
            if self.interval or self.sim.status().paused:
                self.sim.repeat()
            self.wait(arrived)

    def expect_members(self) -> None:
        """From here on the members of the plan belong to the team."""
        self.participants = {*self.run.launch.participants}
        self.may_end.update(self.run.plan.optional)

    def wait_for_members(self) -> None:
        """Wait until all that belong to the team are there, and any robot's pose may be read."""
        plan, threads = self.run.plan, self.threads
        self.watch_others(self.run.launch.pace.expect)
        members = [name for name in plan.jobs if name not in plan.unawaited] if threads is None else [*threads.parts]
        self.wait_for_processes(*members)
        if names.SIMULATOR in members:
            known = self.sim.status().robots
            if not self.wait(lambda: all(self.view.robot(i).truth is not None for i in known)):
                raise TeamTimeout(f"the simulator shows no pose of some robot of {known}")

    def check(self) -> None:
        """Raise TeamFailure for a process that has ended or hangs though nothing asked it to."""
        self.hangs.update(self.run.members.hangs)
        for name, text in self.hangs.items():
            if name not in self.may_end:
                raise TeamFailure(text)
        for process in self.run.supervisor.failures:
            if process.name not in self.may_end:
                raise TeamFailure(f"{process.name} ended ({exit_text(process.exit_code)}): {self.words(process.name)}")
        if self._others is not None:
            self._check_others(self._others)

    def _check_others(self, others: Others) -> None:
        for name, seconds in others.gone().items():
            words = self.words(name) or "it has logged nothing"
            if others.fault(name):
                raise TeamFailure(f"{name} is gone: {words}")
            # The end of a test may have ended what the test had started.
            if seconds > RETURN and name in others.expected and not self._at_end:
                raise TeamFailure(f"{name} is gone, without team.expect_end({name!r}): {words}")

    def _not_awaited(self) -> set[str]:
        """Names of the processes that may end, or that this fixture has started itself."""
        return {*self.may_end, *self.run.supervisor.members}

    def take_line(self, name: str, line: str) -> None:
        self.log.append((name, line))
        if self._live:
            # Most lines name their process.
            sys.stdout.write(f"{line}\n" if f"[{name}]" in line else f"[{name}] {line}\n")
            sys.stdout.flush()
        if len(self.log) > 2 * _KEPT_LINES:
            del self.log[:_KEPT_LINES]

    def take_log(self, name: str, level: int, text: str) -> None:
        """A node of this process, or one that the test has started, has logged a text."""
        told = "" if level == logging.INFO else f"{logging.getLevelName(level).lower()}: "
        self.take_line(name, f"{told}{text}")

    def lines(self, name: str) -> list[str]:
        """What a process has written so far."""
        return [line for process, line in self.log if process == name]

    def member(self, name: str) -> Member:
        """A process of the team, or a node in this process. Raises UsageError."""
        members = self.run.supervisor.members
        if name not in members:
            raise UsageError(f"there is no process {name!r}; this team has {', '.join(members) or 'no process yet'}")
        return members[name]

    def robot(self, robot_id: int) -> RobotView:
        """As `Team.robot`."""
        if robot_id not in self.view.robots and self.seen.alive(names.SIMULATOR):
            there = self.sim.status().robots
            if robot_id not in there and not self.view.alive(names.robot_name(robot_id)):
                raise UsageError(f"there is no robot {robot_id}; the world has {format_robot_ids(there) or 'no robot'}")
        return self.seen.robot(robot_id)

    def words(self, name: str) -> str:
        """The error that ended a process, its last line first, else the last lines of the process."""
        member = self.run.supervisor.members.get(name)
        fault = "" if member is None else member.fault
        if member is None and self._others is not None:
            fault = self._others.fault(name)
        lines = fault.splitlines()
        return "\n".join([*lines[-1:], *lines] or self.lines(name)[-_LAST_LINES:])

    def wait(self, condition: Callable[[], bool], limit: float = START_LIMIT) -> bool:
        """Whether `condition()` comes true within `limit` host seconds."""
        looked = now = monotonic()
        deadline = now + limit
        while True:
            # Without the view's lock: a condition may ask the bus, whose thread may need the lock to go on.
            seen = self.seen.version
            if condition():
                return True
            now = monotonic()
            if now - looked >= LOOK:
                looked = now
                self._look_for_hangs()
            if now >= deadline:
                return False
            # The end of a process is no news on the bus, so check from time to time.
            self.seen.wait_for_news(seen, min(0.2, deadline - now))

    def wait_for(self, condition: Callable[[], bool]) -> None:
        """Wait until `condition()`. Raises TeamTimeout."""
        if not self.wait(condition):
            raise TeamTimeout(f"not true within {START_LIMIT:g} s")

    def wait_for_processes(self, *processes: str) -> None:
        """Wait until these names are present on the bus; a process that ends instead fails the test at once."""

        def ended() -> list[str]:
            known = self.run.supervisor.members
            return [n for n in processes if n in known and not known[n].running]

        self.wait(lambda: bool(ended()) or all(self.seen.alive(n) for n in processes))
        if ended():
            first = ended()[0]
            raise TeamTimeout(f"{first} ended ({exit_text(self.member(first).exit_code)}): {self.words(first)}")
        missing = [n for n in processes if not self.seen.alive(n)]
        if missing:
            where = "".join(f"; {name}: {text}" for name in missing if (text := self._stacks.where(name)))
            raise TeamTimeout(f"{', '.join(missing)} did not come up within {START_LIMIT:g} s{where}")
        self._present.update(self.run.supervisor.members.keys() & {*processes})
        self.watch_others(processes)
        if names.SIMULATOR in processes:
            status = self.status()
            self.interval = status.interval if status.lockstep else 0

    def take_status(self, status: SimStatus) -> None:
        """Notice the processes that were left behind, and wait for the end of those that left.

        They are gone in the world's time; the end of their processes takes the host's.
        """
        self._note_left_behind(status)
        left = self.participants.difference(status.participants, status.joining)
        self.participants = {*status.participants}
        self.watch_others(status.participants, expected=False)
        if (others := self._others) is not None and left - self._not_awaited():
            # `check` fails for those that stay away.
            self.wait(lambda: others.expected.isdisjoint(others.gone()), 2.0 * RETURN)
        for name in left.intersection(self.run.supervisor.members) - self.may_end - self.restarts:
            if not self.wait(partial(self._has_ended_or_joined, name), self.silence_limit):
                self._note_hang(name, "it lives and has left the bus")
        self.check()

    def watch_others(self, processes: Iterable[str], *, expected: bool = True) -> None:
        if self._others is not None:
            self._others.watch(processes, expected=expected)

    def _has_ended_or_joined(self, name: str) -> bool:
        process, status = self.member(name), self.status()
        if process.exit_code is not None:
            process.join(START_LIMIT)
        return process.exit_code is not None or name in status.participants or name in status.joining

    def _note_left_behind(self, status: SimStatus) -> None:
        for name in status.hung:
            how = f"lock-step left it behind, without an answer for {self.silence_limit:g} s or cut off"
            self._note_hang(name, how)

    def _note_hang(self, name: str, how: str) -> None:
        """The process hangs: with the line of the user's code that it is in, or else `how`, in words."""
        if name in self.hangs or name in self.may_end:
            return
        where = self._stacks.where(name)
        text = f"after {self.silence_limit:g} s {where}" if where else f"{how}; its last lines:\n{self.words(name)}"
        self.hangs[name] = f"{name} hangs: {text}"

    def _look_for_hangs(self) -> None:
        """Lock-step: notice the processes that were left behind; of nodes in this process the watch on the calls does
        so."""
        if self.threads is not None or not self._is_in_view:
            return
        if self.interval:
            with suppress(BusError):
                self._note_left_behind(self.status(LOOK))
        self.check()

    @property
    def _is_in_view(self) -> bool:
        """Whether what the test sees of its team is the team's doing: its simulator and its router run."""
        router, simulator = (self.run.supervisor.members.get(name) for name in (ROUTER, names.SIMULATOR))
        paused = self.may_end & {ROUTER, names.SIMULATOR}
        return router is not None and router.running and (simulator is None or simulator.running) and not paused

    def check_at_end(self) -> None:
        """Raise TeamFailure for a process that has ended or hangs unasked, and does not come back."""
        self._at_end = True
        self.check()
        if self.run.state is RunState.NEW or (self.threads is None and not self.member(ROUTER).running):
            # Without its router a team sees nothing of itself.
            return
        # In lock-step the world has not moved without them.
        if self._others is not None and not self.interval and (missing := self._others.missing()):
            raise TeamFailure(f"{', '.join(missing)}: expected, and never came")
        ended = self.run.supervisor.ended
        gone = [n for n in self._present - self.may_end if n not in ended and not self.seen.alive(n)]
        self.wait(lambda: all(n in ended or self.seen.alive(n) for n in gone))
        for name in gone:
            if name in ended:
                self.member(name).join(START_LIMIT)
            elif not self.seen.alive(name):
                raise TeamFailure(f"{name} is gone and did not come back within {START_LIMIT:g} s: {self.words(name)}")
        self.check()


def close_in_time(close: Callable[[], None], grace: float) -> None:
    """Call `close()`, which ends the team, and end the calls that hold it up; a node that cannot be ended is left."""
    # The locks of a node that hangs would hold this thread for ever.
    done = in_thread(close)
    for _ in range(_TRIES):
        if wait([done], grace).done:
            done.result()
            return
        end_user_calls()
