"""A watch on the members of a team under test: none ends or hangs unnoticed though the test did not ask for that; and
its simulated time, which goes on where the test lets it.

Other waits count host seconds, because a starting or ending process has no simulated time. Their limits are generous.
"""

import logging
import math
import sys
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import wait
from contextlib import suppress
from functools import partial
from tempfile import TemporaryDirectory

from zteam import names
from zteam.bus import Bus
from zteam.clock import HOST_FACTOR, monotonic
from zteam.config.robot_ids import format_robot_ids
from zteam.errors import BusError, UsageError, ZteamError
from zteam.messages import Log, TeamState
from zteam.monitor.observer import RobotView, TeamObserver
from zteam.node.faults import log_fault, where_it_is
from zteam.node.kinds import ROUTER, kind_of
from zteam.node.process_options import LOCKSTEP_TIMEOUT
from zteam.simulator.client import SimStatus, SimulatorClient, StepRequest
from zteam.team.launch.process import exit_text
from zteam.team.launch.supervisor import Member
from zteam.team.run.team_run import RunState, TeamRun
from zteam.team.run.threads import Threads, end_user_calls, in_thread

OBSERVED = (names.CLOCK, names.TEAM_STATUS, names.GROUND_TRUTH, names.STATUS)
"""What a test sees of its team without asking."""
LOOK = 1.0
"""Host seconds between two looks at what is waited for."""
_LAST_LINES = 5
"""Of a process that has ended without an error of the user's code."""
START_LIMIT = 60.0 * HOST_FACTOR
"""Host seconds for processes to start: many times the longest start on a crowded machine."""
RETURN = 2.5 * HOST_FACTOR
"""Host seconds for a process to be there again whose token is gone: the test may start it again."""
STALL_LIMIT = 60.0 * HOST_FACTOR
"""Host seconds during which simulated time may stand still in a wait."""
_SLICE = 50
"""Ticks of one request to the simulator."""
_TRIES = 3
"""How often a team in this process is asked to end."""
_KEPT_LINES = 100_000
"""Of all processes of a test."""


class TeamFailure(ZteamError, AssertionError):  # noqa: N818 - it is a failed assertion first
    """A process of the team has ended or hangs, and the test did not ask for that."""

    # Where users import it from; a summary has little room.
    __module__ = "zteam.testing"


class TeamTimeout(TeamFailure):
    """A condition did not come true in time."""

    __module__ = "zteam.testing"


class Watch:
    """The lines of the members, how they fail, and what the bus shows. `team_run` is the team that is watched."""

    team_run: TeamRun
    seen: TeamObserver

    def __init__(self, *, live: bool) -> None:
        """With `live` the lines of the processes are printed as they come."""
        self._live = live
        self.stacks = TemporaryDirectory(prefix="zteam_stacks_", ignore_cleanup_errors=True)
        """Where processes write in which call they are (`zteam.node.faults.offer_stacks`)."""
        self._watched: set[str] = set()
        """Processes that take part though the fixture has not started them, such as a node that the test starts."""
        self._expected: set[str] = set()
        """Those of them that the test has named."""
        self._faults: dict[str, str] = {}
        """The errors that have ended them, as they have logged them."""
        self._gone_since: dict[str, float] = {}
        self.interval = 0
        """Simulated ns of a tick in lock-step; 0 while the team is not in lock-step."""
        self.has_moved = False
        """Whether the test has let the world go on."""
        self.silence_limit = LOCKSTEP_TIMEOUT
        """Host seconds that a living process may be silent."""
        self.log = deque[tuple[str, str]](maxlen=_KEPT_LINES)
        """(process, line) in the order of arrival, for the report of a failed test: the newest."""
        self._at_end = False
        self.may_end: set[str] = set()
        """Processes that may end or hang."""
        self._participants: set[str] = set()
        """Those that are expected, then those of the newest tick that the test has let the world take."""

    @property
    def threads(self) -> Threads | None:
        """The members of a team in this process; None for processes."""
        return self.team_run.members if isinstance(self.team_run.members, Threads) else None

    @property
    def bus(self) -> Bus:
        """The test's own session."""
        assert self.team_run.members.bus is not None
        return self.team_run.members.bus

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
        return {name for name, job in self.team_run.plan.jobs.items() if job.restarts}

    def observe(self) -> None:
        self.seen = TeamObserver(self.bus, *OBSERVED, repeat=self._repeat)

    def _repeat(self, arrived: Callable[[], bool]) -> None:
        """Wait until a subscribed topic arrives. A world that stands still is asked to publish its last tick again."""
        if self.view.alive(names.SIMULATOR):
            if self.interval or self.sim.status().paused:
                self.sim.repeat()
            self.wait(arrived)

    def wait_for_members(self) -> None:
        """Wait until all that belong to the team are there, and any robot's pose may be read."""
        plan, threads = self.team_run.plan, self.threads
        self._participants = {*self.team_run.launch.participants}
        self._watch_others(self.team_run.launch.pace.expect)
        members = [name for name in plan.jobs if name not in plan.unawaited] if threads is None else [*threads.parts]
        self.wait_for_processes(*members)
        if names.SIMULATOR in members:
            known = self.sim.status().robots
            if not self.wait(lambda: all(self.view.robot(i).truth is not None for i in known)):
                raise TeamTimeout(f"the simulator shows no pose of some robot of {known}")

    def check(self) -> None:
        """Raise TeamFailure for a process that has ended or hangs though nothing asked it to."""
        for name, text in self.team_run.members.hangs.items():
            if name not in self.may_end:
                raise TeamFailure(text)
        for process in self.team_run.supervisor.failures:
            if process.name not in self.may_end:
                raise TeamFailure(f"{process.name} ended ({exit_text(process.exit_code)}): {self.words(process.name)}")
        for name, seconds in self._gone().items():
            words = self.words(name) or "it has logged nothing"
            if name in self._faults:
                raise TeamFailure(f"{name} is gone: {words}")
            # The end of a test may have ended what the test had started.
            if seconds > RETURN and name in self._expected and not self._at_end:
                raise TeamFailure(f"{name} is gone, without team.expect_end({name!r}): {words}")

    def _gone(self) -> dict[str, float]:
        """Others that must not end, were there and are not, and for how many host seconds. Without the router all would
        be gone, so none is."""
        now, others = monotonic(), self._watched - self._not_awaited()
        gone = {n for n in others if self.seen.link_up and n in self.seen.were_there and not self.seen.alive(n)}
        self._gone_since = {name: self._gone_since.get(name, now) for name in sorted(gone)}
        return {name: now - since for name, since in self._gone_since.items()}

    def _not_awaited(self) -> set[str]:
        """Names of the processes that may end, or that this fixture has started itself."""
        return {*self.may_end, *self.team_run.supervisor.members}

    def on_line(self, name: str, line: str) -> None:
        self.log.append((name, line))
        if self._live:
            # Most lines name their process.
            sys.stdout.write(f"{line}\n" if f"[{name}]" in line else f"[{name}] {line}\n")
            sys.stdout.flush()

    def on_log(self, name: str, level: int, text: str) -> None:
        """A node of this process, or one that the test has started, has logged a text."""
        told = "" if level == logging.INFO else f"{logging.getLevelName(level).lower()}: "
        self.on_line(name, f"{told}{text}")

    def lines(self, name: str) -> list[str]:
        return [line for process, line in self.log.copy() if process == name]

    def member(self, name: str) -> Member:
        """A process of the team, or a node in this process. Raises UsageError."""
        members = self.team_run.supervisor.members
        if name not in members:
            raise UsageError(f"there is no process {name!r}; this team has {', '.join(members) or 'no process yet'}")
        return members[name]

    def robot(self, robot_id: int) -> RobotView:
        if robot_id not in self.view.robots and self.seen.alive(names.SIMULATOR):
            there = self.sim.status().robots
            if robot_id not in there and not self.view.alive(names.robot_name(robot_id)):
                raise UsageError(f"there is no robot {robot_id}; the world has {format_robot_ids(there) or 'no robot'}")
        return self.seen.robot(robot_id)

    def words(self, name: str) -> str:
        """The error that ended a process, its last line first, else the last lines of the process."""
        member = self.team_run.supervisor.members.get(name)
        fault = self._faults.get(name, "") if member is None else member.fault
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
        def ended() -> list[str]:
            known = self.team_run.supervisor.members
            return [n for n in processes if n in known and not known[n].running]

        self.wait(lambda: bool(ended()) or all(self.seen.alive(n) for n in processes))
        if ended():
            first = ended()[0]
            raise TeamTimeout(f"{first} ended ({exit_text(self.member(first).exit_code)}): {self.words(first)}")
        missing = [n for n in processes if not self.seen.alive(n)]
        if missing:
            where = "".join(f"; {name}: {text}" for name in missing if (text := where_it_is(self.stacks.name, name)))
            raise TeamTimeout(f"{', '.join(missing)} did not come up within {START_LIMIT:g} s{where}")
        self._watch_others(processes)
        if names.SIMULATOR in processes:
            status = self.status()
            self.interval = status.interval if status.lockstep else 0

    def on_status(self, status: SimStatus) -> None:
        """Notice the processes that were left behind, and wait for the end of those that left. They are gone in the
        world's time; the end of their processes takes the host's."""
        self._note_left_behind(status)
        left = self._participants.difference(status.participants, status.joining)
        self._participants = {*status.participants}
        self._watch_others(status.participants, expected=False)
        if self._watched & left - self._not_awaited():
            # `check` fails for those that stay away.
            self.wait(lambda: self._expected.isdisjoint(self._gone()), 2.0 * RETURN)
        for name in left.intersection(self.team_run.supervisor.members) - self.may_end - self.restarts:
            if not self.wait(partial(self._has_ended_or_joined, name), self.silence_limit):
                self._note_hang(name, "it lives and has left the bus")
        self.check()

    def _watch_others(self, processes: Iterable[str], *, expected: bool = True) -> None:
        """Watch those that the fixture has not started, from here on; if `expected`, they may come later."""
        if self.threads is not None:
            return
        if expected:
            self._expected.update(processes)
        for name in set(processes) - self._watched - self._not_awaited():
            self._watched.add(name)
            self.bus.subscribe(names.log_key(name), Log, partial(self._take_message, name))

    def _take_message(self, name: str, _key: str, message: Log) -> None:
        fault = message.msg.partition("\n")[2]
        if fault and message.level >= logging.CRITICAL and message.function == log_fault.__name__:
            self._faults[name] = fault
        self.on_log(name, message.level, message.msg)

    def _has_ended_or_joined(self, name: str) -> bool:
        process = self.member(name)
        return process.join(START_LIMIT) if process.exit_code is not None else self._takes_part(name)

    def _takes_part(self, name: str) -> bool:
        status = self.status()
        return name in status.participants or name in status.joining

    def _note_left_behind(self, status: SimStatus) -> None:
        for name in status.hung:
            how = f"lock-step left it behind, without an answer for {self.silence_limit:g} s or cut off"
            self._note_hang(name, how)

    def _note_hang(self, name: str, how: str) -> None:
        """The process hangs: with the line of the user's code that it is in, or else `how`, in words."""
        hangs = self.team_run.members.hangs
        if name in hangs or name in self.may_end:
            return
        where = where_it_is(self.stacks.name, name)
        text = f"after {self.silence_limit:g} s {where}" if where else f"{how}; its last lines:\n{self.words(name)}"
        hangs[name] = f"{name} hangs: {text}"

    def _look_for_hangs(self) -> None:
        """Lock-step: notice the processes that were left behind, where the test sees what the team does: its router and
        its simulator run. Of nodes in this process the watch on the calls does so."""
        members = self.team_run.supervisor.members
        needed = [members[name] for name in (ROUTER, names.SIMULATOR) if name in members]
        if ROUTER not in members or not all(each.running and each.name not in self.may_end for each in needed):
            return
        if self.interval:
            with suppress(BusError):
                self._note_left_behind(self.status(LOOK))
        self.check()

    def check_at_end(self) -> None:
        self._at_end = True
        self.check()
        if self.team_run.state is RunState.NEW or (self.threads is None and not self.member(ROUTER).running):
            # Without its router a team sees nothing of itself.
            return
        # In lock-step the world has not moved without them.
        missing = sorted(self._watched - self.seen.were_there - self._not_awaited()) if not self.interval else []
        if missing:
            raise TeamFailure(f"{', '.join(missing)}: expected, and never came")
        members, ended = self.team_run.supervisor.members.keys(), self.team_run.supervisor.ended
        gone = [n for n in members & self.seen.were_there - self.may_end if n not in ended and not self.seen.alive(n)]
        self.wait(lambda: all(n in ended or self.seen.alive(n) for n in gone))
        for name in gone:
            if name in ended:
                self.member(name).join(START_LIMIT)
            elif not self.seen.alive(name):
                raise TeamFailure(f"{name} is gone and did not come back within {START_LIMIT:g} s: {self.words(name)}")
        self.check()

    @property
    def now(self) -> float:
        """Simulated seconds."""
        return self.view.now / 1e9

    def run(self, seconds: float) -> None:
        """Let simulated time pass: in lock-step to the tick."""
        if self.interval:
            self.step(round(seconds * 1e9 / self.interval))
        else:
            end = self.now + seconds
            self.until(lambda: self.now >= end, seconds)

    def until(self, condition: Callable[[], bool], within: float) -> None:
        """Let simulated time pass until `condition()`, `within` s at most. Raises TeamTimeout."""
        end, came_true, last, since = self.now + within, False, self.now, monotonic()

        def is_over() -> bool:
            nonlocal came_true, last, since
            came_true = condition()
            if self.now != last:
                last, since = self.now, monotonic()
            # In lock-step a step has a limit of its own.
            elif not (came_true or self.interval) and monotonic() - since > STALL_LIMIT:
                raise TeamTimeout(f"simulated time stands still at {self.now:.1f} s")
            return came_true or self.now >= end

        if self.interval:
            while not is_over():
                self.step(1)
        else:
            self.wait(is_over, math.inf)
        if not came_true:
            seconds = f"{within:g} simulated second{'' if within == 1 else 's'}"
            raise TeamTimeout(f"not true within {seconds} (now {self.now:.1f} s){self.seen.describe()}")

    def step(self, ticks: int) -> None:
        """Run so many ticks, and wait until the messages of the last one are in view."""
        self.has_moved = True
        key, limit = names.service_key(names.SIMULATOR, "step"), max(STALL_LIMIT, 2.0 * self.silence_limit)
        for done in range(0, ticks, _SLICE):
            self.check()
            request = StepRequest(min(_SLICE, ticks - done))
            # A node that hangs in this process may hold whatever the answer needs.
            answer = in_thread(partial(self.bus.ask, key, SimStatus, request, timeout=limit))
            while not answer.done():
                self.check()
                wait([answer], LOOK)
            try:
                status = answer.result()
            except BusError as error:
                # The end of a process says more.
                self.check()
                raise TeamTimeout(f"simulated time stands still at {self.now:.1f} s: {error}") from None
            self.on_status(status)

            def arrived(status: SimStatus = status) -> bool:
                # Each look at the view looks for processes that have failed.
                return self.view.reaches(status.now, status.robots)

            if not arrived():
                # No message was lost in tens of thousands of ticks, but the bus does not promise that.
                self.sim.repeat()
                if not self.wait(arrived):
                    raise TeamTimeout(f"what the simulator sent at {status.now / 1e9:.1f} s did not arrive")

    def wait_for_return(self, name: str) -> None:
        """Wait until a process is there that was started again; in lock-step, until it takes part in the next tick."""
        self.wait_for_processes(name)
        kind = kind_of(name)
        may_take_part = kind is not None and kind.in_lockstep
        if self.interval and may_take_part and not self.wait(lambda: self._takes_part(name)):
            raise TeamTimeout(f"{name} does not take part in lock-step within {START_LIMIT:g} s")

    def wait_until_left(self, name: str) -> None:
        """Lock-step: wait until a process that has ended takes no part any more: the next tick is without it."""
        kind = kind_of(name)
        may_take_part = kind is None or kind.in_lockstep
        if not self.interval or not may_take_part or not self.view.alive(names.SIMULATOR):
            return
        if not self.wait(lambda: name not in self.sim.status().participants):
            raise TeamTimeout(f"{name} has ended and still takes part in lock-step after {START_LIMIT:g} s")


def close_in_time(close: Callable[[], None], grace: float) -> None:
    """Call `close()`, which ends the team, and end the calls that hold it up; a node that cannot be ended is left."""
    # The locks of a node that hangs would hold this thread for ever.
    done = in_thread(close)
    for _ in range(_TRIES):
        if wait([done], grace).done:
            done.result()
            return
        end_user_calls()
