"""The session of a test: how it reaches its team, and what the bus tells about it."""

import itertools
import os
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from itertools import takewhile
from typing import TYPE_CHECKING

from zteam.bus import Bus, BusOptions, connect
from zteam.bus.options import LEASE
from zteam.clock import HOST_FACTOR, monotonic
from zteam.errors import UsageError, ZteamError
from zteam.launch.kinds import Pace
from zteam.launch.process import exit_text
from zteam.launch.run import lease_for, start_router, wait_for_endpoint
from zteam.launch.supervisor import Member, Supervisor
from zteam.launch.warm_parent import WarmParent
from zteam.messages import Message
from zteam.runtime.faults import ENDED
from zteam.testing.view import RobotView, TeamView

if TYPE_CHECKING:
    from zteam.in_process.run import InProcessRun

_LAST_LINES = 5
"""Of a process that has ended without an error of the user's code."""
START_LIMIT = 60.0 * HOST_FACTOR
"""Host seconds for processes to start: many times the longest start on a crowded machine."""

WARM_PARENT = WarmParent()
"""Of all teams of this pytest process."""

numbers = itertools.count(1)


class TeamFailure(ZteamError, AssertionError):  # noqa: N818 - it is a failed assertion first
    """A process of the team has ended or hangs, and the test did not ask for that."""


class TeamTimeout(TeamFailure):
    """A condition did not come true in time."""


class TeamSession:
    """The way of a test to its team: over a router of its own, started when it is needed, or within this process."""

    def __init__(self) -> None:
        self.namespace = f"test_{os.getpid()}_{next(numbers)}"
        """Key prefix of this team alone."""
        self.log: list[tuple[str, str]] = []
        """(process, line) in the order of arrival, for the report of a failed test."""
        self._supervisor = Supervisor(self._take_line, lambda _process, _delay: None, WARM_PARENT.start)
        self._bus: Bus | None = None
        """None until the router runs or the team in this process is made."""
        self._endpoint = ""
        self._lease: float | None = None
        """Of the sessions of a team that was started, in host seconds."""
        self._seen: TeamView
        self._in_process: InProcessRun | None = None
        """The team in this process; None for processes."""
        self._in_process_ends = ExitStack()
        self._may_end: set[str] = set()
        """Processes that may end or hang."""
        self._hangs: dict[str, str] = {}
        """How processes hang, in words."""

    def _take_line(self, name: str, line: str) -> None:
        self.log.append((name, line))

    def _open(self) -> None:
        """Start the router and open the test's own session, unless that was done before.

        All calls that look at the team come here, so they fail for a process that has failed.
        """
        self._check()
        if self._bus is not None:
            return
        # A team that comes later may work in lock-step, where processes bear a longer silence of the router.
        lease = lease_for(Pace(lockstep=True), LEASE) if self._lease is None else self._lease
        router = start_router(self._supervisor, lease=lease)
        self._endpoint = wait_for_endpoint(self._supervisor, router, START_LIMIT)
        if not self._endpoint:
            raise TeamTimeout(f"the router did not start ({exit_text(router.exit_code)}): {list(router.lines)}")
        options = BusOptions(connect=self._endpoint, namespace=self.namespace, lease=lease)
        self._look(connect(options, patience=START_LIMIT))

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

    def lines(self, name: str) -> list[str]:
        """What a process has written so far."""
        return [line for process, line in self.log if process == name]

    def _words(self, name: str) -> str:
        """The last error of a process with the user's frames, else its last lines."""
        said = self.lines(name)
        for i in reversed(range(len(said))):
            _, found, told = said[i].partition(ENDED)
            if found:
                # A process writes each line by itself, up to the next one of its log.
                text = told.splitlines()[1:] or [*takewhile(lambda line: f"[{name}] " not in line, said[i + 1 :])]
                return "\n".join([*text[-1:], *text])
        return "\n".join(said[-_LAST_LINES:])

    def _look(self, bus: Bus) -> None:
        """Look at the team through this session."""
        self._bus = bus
        self._seen = TeamView(bus, self._listen)

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
    def _view(self) -> TeamView:
        self._open()
        return self._seen

    @property
    def _processes(self) -> Mapping[str, Member]:
        """The processes of the team, or the nodes in this process, by name."""
        return self._supervisor.members

    def _listen(self, key: str, kind: type[Message], _arrived: Callable[[], bool]) -> None:
        """Subscribe to a topic that the test looks at for the first time."""
        self._view.listen(key, kind)

    def robot(self, robot_id: int) -> RobotView:
        """What the bus tells about a robot."""
        return self._view.robot(robot_id)

    def alive(self, name: str) -> bool:
        """Whether a process holds this name on the bus."""
        return self._view.alive(name)

    def _wait(self, condition: Callable[[], bool], limit: float) -> bool:
        """Whether `condition()` comes true within `limit` host seconds."""
        deadline = monotonic() + limit
        while True:
            seen = self._view.version
            if condition():
                return True
            if monotonic() >= deadline:
                return False
            # The end of a process is no news on the bus, so check from time to time.
            self._view.wait_for_news(seen, min(0.2, max(0.0, deadline - monotonic())))
