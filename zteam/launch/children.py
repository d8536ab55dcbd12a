"""A child process as the launcher sees it, and how one is spawned."""

import os
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Protocol

from zteam.runtime.shutdown import PARENT_PIPE


class Child(Protocol):
    """What `Process` needs of a child; as in `subprocess.Popen`."""

    @property
    def pid(self) -> int:
        """Process id."""

    @property
    def returncode(self) -> int | None:
        """Its exit code as far as it is known: negative for a signal, None while it runs."""

    @property
    def stdin(self) -> IO[str] | None:
        """Write end of its standard input."""

    @property
    def stdout(self) -> IO[str] | None:
        """Read end of its standard output and error."""

    def poll(self) -> int | None:
        """Find out whether it has ended; its exit code."""

    def wait_for_end(self) -> None:
        """Wait until it has ended, and leave its process id taken, if no other thread has released it."""

    def wait(self) -> int:
        """Wait until it has ended, release its process id, and return its exit code."""

    def send_signal(self, sig: int) -> None:
        """Send it a signal if it still runs."""


class StartChild(Protocol):
    """Starts a child: its own process group, pipes for its input and output, and one end of the lifeline."""

    def __call__(
        self, command: Sequence[str], lifeline: int, environment: Mapping[str, str], folder: Path | None = None
    ) -> Child:
        """`environment` is added to this process's; it runs in `folder`, None = where this process runs.

        Raises OSError if the command cannot be started.
        """


def environment_of(added: Mapping[str, str]) -> dict[str, str]:
    """The environment of a child, without the number of its lifeline."""
    return {**os.environ, **added, "PYTHONUNBUFFERED": "1"}


class _Spawned(subprocess.Popen[str]):
    def wait_for_end(self) -> None:
        try:
            os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOWAIT)
        except ChildProcessError:
            # Another thread has called `poll`, which collects the exit code.
            pass


def spawn(command: Sequence[str], lifeline: int, environment: Mapping[str, str], folder: Path | None = None) -> Child:
    """Start a child as a program of its own."""
    return _Spawned(
        list(command),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        pass_fds=(lifeline,),
        env={**environment_of(environment), PARENT_PIPE: str(lifeline)},
        cwd=folder,
        # Its own group: the terminal's Ctrl+C reaches the launcher alone, which stops the team in order.
        process_group=0,
        text=True,
        errors="replace",
    )
