"""A child that a test has started, forked or spawned: what it was told to do, what it wrote, and its end."""

import select
import sys
import threading

from support.limits import LIMIT
from zteam.team.launch.process import Job, Process, StartChild


def obey(code: str, *arguments: str) -> list[str]:
    """The command line of a child that runs this Python text."""
    return [sys.executable, "-P", "-m", "support.obedient_child", code, *arguments]


class Started:
    """A Process, the lines that it has written, and its end."""

    def __init__(self, start: StartChild, command: list[str], *, batch: bool = False, **environment: str) -> None:
        self.heard: list[str] = []
        self.up = threading.Event()
        self.process = Process(
            "child",
            Job(command, environment, batch=batch),
            self._take,
            lambda *_: self.up.set(),
            lambda _process: self.up.set(),
            start,
        )

    def _take(self, _process: Process, line: str) -> None:
        self.heard.append(line)
        self.up.set()

    def finish(self) -> int | None:
        """Wait for its end; its exit code."""
        assert self.process.join(LIMIT)
        return self.process.exit_code


def has_ended(pidfd: int) -> bool:
    """Whether the process ends within the limit."""
    return bool(select.select([pidfd], [], [], LIMIT)[0])  # noqa: TID251
