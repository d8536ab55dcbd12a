"""The session of a test: how it reaches its team, and what the bus tells about it."""

import itertools
import os
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from typing import TYPE_CHECKING

from zteam.bus import Bus, BusOptions, connect
from zteam.clock import monotonic
from zteam.errors import UsageError, ZteamError
from zteam.launch.process import Process, exit_text
from zteam.launch.router import start_router, wait_for_endpoint
from zteam.launch.supervisor import Supervisor
from zteam.launch.warm_parent import WarmParent
from zteam.messages import Message
from zteam.testing.view import RobotView, TeamView

if TYPE_CHECKING:
    from zteam.in_process.member import Member
    from zteam.in_process.run import InProcessRun

START_LIMIT = 60.0
"""Host seconds for processes to start: many times the longest start on a crowded machine."""

WARM_PARENT = WarmParent()
"""Of all teams of this pytest process."""

numbers = itertools.count(1)


class TeamTimeout(ZteamError, AssertionError):  # noqa: N818 - it is a failed assertion first
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
        self._seen: TeamView
        self._in_process: InProcessRun | None = None
        """The team in this process; None for processes."""
        self._in_process_ends = ExitStack()

    def _take_line(self, name: str, line: str) -> None:
        self.log.append((name, line))

    def _open(self) -> None:
        """Start the router and open the test's own session, unless that was done before."""
        if self._bus is not None:
            return
        router = start_router(self._supervisor)
        self._endpoint = wait_for_endpoint(self._supervisor, router, START_LIMIT)
        if not self._endpoint:
            raise TeamTimeout(f"the router did not start ({exit_text(router.exit_code)}): {list(router.lines)}")
        self._look(connect(BusOptions(connect=self._endpoint, namespace=self.namespace), patience=START_LIMIT))

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
    def _processes(self) -> "Mapping[str, Process | Member]":
        """The processes of the team, or the nodes in this process, by name."""
        return self._supervisor.processes if self._in_process is None else self._in_process.members

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
