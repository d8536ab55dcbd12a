"""The processes of a team under test: a router and a namespace of their own, start, end, output and presence.

Waits here count host seconds, because a starting or ending process has no simulated time. Their limits are generous.
"""

import os
import subprocess
from collections.abc import Callable
from typing import Any

from zteam.errors import UsageError
from zteam.launch.plan import Plan
from zteam.launch.process import exit_text, zteam_command
from zteam.launch.supervisor import Job
from zteam.testing.session import START_LIMIT, TeamFailure, TeamSession, TeamTimeout, numbers

__all__ = ["START_LIMIT", "TeamFailure", "TeamProcesses", "TeamTimeout"]


class TeamProcesses(TeamSession):
    """Real processes by name, or the nodes of a team in this process."""

    def __init__(self) -> None:
        super().__init__()
        self._plan = Plan({})
        self._present: set[str] = set()
        """Processes of the team that were there once."""

    def close(self) -> None:
        """Stop everything, in order."""
        try:
            if self._in_process is not None:
                from zteam.testing.team_in_process import close_in_time

                close_in_time(self._in_process, self._in_process_ends.close)
            for group in [*self._plan.stop_order(), sorted(self._supervisor.processes)]:
                self._supervisor.stop(group)
        finally:
            if self._bus is not None:
                self._bus.close()
            self._supervisor.close()

    @property
    def environment(self) -> dict[str, str]:
        """Environment that makes any zteam command join this team."""
        self._need_processes("environment")
        given = {} if self._lease is None else {"ZTEAM_LEASE": str(self._lease)}
        return {"ZTEAM_CONNECT": self.endpoint, "ZTEAM_NAMESPACE": self.namespace, **given}

    def spawn(self, command: str, *arguments: str, name: str | None = None) -> str:
        """Start one command (`zteam-robot`, `zteam-sim`, `zteam`, …) in this team; the process's name.

        Return at once: use `wait_for_processes` to wait until it is present.
        """
        self._need_processes("spawn")
        chosen = name or f"{command} #{next(numbers)}"
        # A tool ends by itself when its work is done.
        job = self._plan.nodes[chosen] = Job(zteam_command(command, *arguments), self.environment, may_end=True)
        self._supervisor.start_job(chosen, job)
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
        if name not in self._processes:
            known = ", ".join(self._processes) or "no process yet"
            raise UsageError(f"there is no process {name!r}; this team has {known}")
        return self._processes[name]

    def wait_for_processes(self, *processes: str) -> None:
        """Wait until these names are present on the bus; a process that ends instead fails the test at once."""

        def ended() -> list[str]:
            known = self._processes
            return [n for n in processes if n in known and not known[n].running]

        self._wait(lambda: bool(ended()) or all(self.alive(n) for n in processes), START_LIMIT)
        if ended():
            first = ended()[0]
            raise TeamTimeout(f"{first} ended ({exit_text(self.exit_code(first))}): {self._words(first)}")
        missing = [n for n in processes if not self.alive(n)]
        if missing:
            raise TeamTimeout(f"{', '.join(missing)} did not come up within {START_LIMIT:g} s")
        self._present.update(self._processes.keys() & {*processes})

    def wait_for_line(self, name: str, text: str) -> None:
        """Wait until a process has written a line that holds `text`."""
        if not self._wait(lambda: any(text in line for line in self.lines(name)), START_LIMIT):
            raise TeamTimeout(f"{name} never said {text!r}; its last lines: {self.lines(name)[-3:]}")

    def wait_for_exit(self, name: str) -> int:
        """Wait until a process has ended, which it may do; its exit code."""
        process = self._process(name)
        self.expect_end(name)
        if not process.join(START_LIMIT):
            raise TeamTimeout(f"{name} still runs after {START_LIMIT:g} s")
        code: int = process.exit_code
        return code

    def wait_for(self, condition: Callable[[], bool]) -> None:
        """Wait until `condition()` by the host's clock: for what processes say or do while the world stands still."""
        if not self._wait(condition, START_LIMIT):
            raise TeamTimeout(f"not true within {START_LIMIT:g} s")

    def report_log(self) -> str:
        """Everything the processes wrote, for a failed test's report."""
        return "\n".join(f"[{name}] {line}" for name, line in self.log)
