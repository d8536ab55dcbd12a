"""The processes of a team under test: a router and a namespace of their own, start, end, output and presence.

Waits here count host seconds, because a starting or ending process has no simulated time. Their limits are generous.
"""

import itertools
import os
import subprocess
from collections.abc import Callable

from zteam.bus import Bus, BusOptions, connect
from zteam.clock import monotonic
from zteam.errors import ZteamError
from zteam.launch.plan import Plan
from zteam.launch.process import exit_text, zteam_command
from zteam.launch.router import start_router, wait_for_endpoint
from zteam.launch.supervisor import Supervisor
from zteam.messages import Message
from zteam.testing.view import RobotView, TeamView

START_LIMIT = 60.0
"""Host seconds for processes to start: many times the longest start on a crowded machine."""

_numbers = itertools.count(1)


class TeamTimeout(ZteamError, AssertionError):  # noqa: N818 - it is a failed assertion first
    """A condition did not come true in time."""


class TeamProcesses:
    """Real processes by name, and what the bus tells about them."""

    def __init__(self) -> None:
        self.namespace = f"test_{os.getpid()}_{next(_numbers)}"
        """Key prefix of this team alone."""
        self.endpoint = ""
        """Where its router listens."""
        self.bus: Bus
        """A session in the team's namespace."""
        self.log: list[tuple[str, str]] = []
        """(process, line) in the order of arrival, for the report of a failed test."""
        self._supervisor = Supervisor(self._take_line, lambda _process: None)
        self._view: TeamView
        self._plan = Plan({})
        self._lease: float | None = None

    def _take_line(self, name: str, line: str) -> None:
        self.log.append((name, line))

    def open(self) -> None:
        """Start the router and open the test's own session."""
        router = start_router(self._supervisor)
        self.endpoint = wait_for_endpoint(self._supervisor, router, START_LIMIT)
        if not self.endpoint:
            raise TeamTimeout(f"the router did not start ({exit_text(router.exit_code)}): {list(router.lines)}")
        self.bus = connect(BusOptions(connect=self.endpoint, namespace=self.namespace), patience=START_LIMIT)
        self._view = TeamView(self.bus, self._listen)

    def _listen(self, key: str, kind: type[Message], _arrived: Callable[[], bool]) -> None:
        """Subscribe to a topic that the test looks at for the first time."""
        self._view.listen(key, kind)

    def close(self) -> None:
        """Stop everything, in order."""
        try:
            for group in [*self._plan.stop_order(), sorted(self._supervisor.processes)]:
                self._supervisor.stop(group)
        finally:
            if hasattr(self, "bus"):
                self.bus.close()
            self._supervisor.close()

    @property
    def environment(self) -> dict[str, str]:
        """Environment that makes any zteam command join this team."""
        given = {} if self._lease is None else {"ZTEAM_LEASE": str(self._lease)}
        return {"ZTEAM_CONNECT": self.endpoint, "ZTEAM_NAMESPACE": self.namespace, **given}

    def spawn(self, command: str, *arguments: str, name: str | None = None) -> str:
        """Start one command (`zteam-robot`, `zteam-sim`, `zteam`, …) in this team; the process's name.

        Return at once: use `wait_for_processes` to wait until it is present.
        """
        chosen = name or f"{command} #{next(_numbers)}"
        self._plan.commands[chosen] = zteam_command(command, *arguments)
        self._supervisor.start(chosen, self._plan.commands[chosen], self.environment)
        return chosen

    def command(self, *arguments: str, timeout: float = START_LIMIT) -> "subprocess.CompletedProcess[str]":
        """Run `zteam ARGUMENTS` against this team and wait for its end."""
        return subprocess.run(
            zteam_command("zteam", *arguments),
            env={**os.environ, **self.environment},
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
            stdin=subprocess.DEVNULL,
        )

    def robot(self, robot_id: int) -> RobotView:
        """What the bus tells about a robot."""
        return self._view.robot(robot_id)

    def alive(self, name: str) -> bool:
        """Whether a process holds this name on the bus."""
        return self._view.alive(name)

    def pid(self, name: str) -> int:
        """Process id of a process of this team."""
        return self._supervisor.processes[name].pid

    def exit_code(self, name: str) -> int | None:
        """Exit code of a process, negative for a signal, None while it runs."""
        return self._supervisor.processes[name].exit_code

    def lines(self, name: str) -> list[str]:
        """What a process has written so far."""
        return [line for process, line in self.log if process == name]

    def wait_for_processes(self, *processes: str) -> None:
        """Wait until these names are present on the bus; a process that ends instead fails the test at once."""

        def ended() -> list[str]:
            known = self._supervisor.processes
            return [n for n in processes if n in known and not known[n].running]

        self._wait(lambda: bool(ended()) or all(self.alive(n) for n in processes), START_LIMIT)
        if ended():
            first = ended()[0]
            said = "\n".join(self.lines(first)[-5:])
            raise TeamTimeout(f"{first} ended ({exit_text(self.exit_code(first))}):\n{said}")
        missing = [n for n in processes if not self.alive(n)]
        if missing:
            raise TeamTimeout(f"{', '.join(missing)} did not come up within {START_LIMIT:g} s")

    def wait_for_line(self, name: str, text: str) -> None:
        """Wait until a process has written a line that holds `text`."""
        if not self._supervisor.wait(lambda: any(text in line for line in self.lines(name)), START_LIMIT):
            raise TeamTimeout(f"{name} never said {text!r}; its last lines: {self.lines(name)[-3:]}")

    def wait_for_exit(self, name: str) -> int:
        """Wait until a process has ended; its exit code."""
        process = self._supervisor.processes[name]
        if not process.join(START_LIMIT):
            raise TeamTimeout(f"{name} still runs after {START_LIMIT:g} s")
        assert process.exit_code is not None
        return process.exit_code

    def wait_for(self, condition: Callable[[], bool]) -> None:
        """Wait until `condition()` by the host's clock: for what processes say or do while the world stands still."""
        if not self._wait(condition, START_LIMIT):
            raise TeamTimeout(f"not true within {START_LIMIT:g} s")

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

    def report_log(self) -> str:
        """Everything the processes wrote, for a failed test's report."""
        return "\n".join(f"[{name}] {line}" for name, line in self.log)
