"""Starts, watches and ends a set of processes. None of them outlives the supervisor, however it ends."""

import logging
import os
import signal
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType

import msgspec

from zteam.clock import HOST_FACTOR, monotonic, wait_until
from zteam.errors import ZteamError
from zteam.launch.process import Process, StartChild, spawn
from zteam.launch.restarts import Again, Restarts
from zteam.launch.sampling import Sampler

log = logging.getLogger("zteam")

GRACE = 2.0 * HOST_FACTOR
"""Seconds from SIGTERM until SIGKILL; the processes end themselves after 1.5."""
_SAMPLE_PERIOD = 5.0
"""Seconds between measurements: reading a process's PSS walks its page tables, which delays it by milliseconds."""


_CLEAN = frozenset({0, -signal.SIGHUP, -signal.SIGINT, -signal.SIGTERM, -signal.SIGPIPE})
"""Exit codes of a process that has not failed, or that was asked to end; systemd has the same."""


class Job(msgspec.Struct, frozen=True):
    """What it takes to start a process, once or again."""

    command: Sequence[str]
    environment: Mapping[str, str] = {}
    """Added to this process's."""
    folder: Path | None = None
    """Where it runs; None = where this process runs."""
    words: str = ""
    """The first line of its standard input."""
    restarts: bool = False
    """Whether it is started again when it has failed."""
    may_end: bool = False
    """Whether it may end by itself, with exit code 0."""


class Supervisor:
    """A set of processes by name.

    Each child inherits the read end of a pipe; this process alone has the write end. When this process ends, the
    children read the end of the file and stop.
    """

    def __init__(
        self,
        on_line: Callable[[str, str], None],
        on_failure: Callable[[Process, Again], None],
        start_child: StartChild = spawn,
    ) -> None:
        """`on_failure(process, again)`: it has failed, and whether it is started again."""
        self._on_line = on_line
        self._on_failure = on_failure
        self._start_child = start_child
        self.processes: dict[str, Process] = {}
        self.changed = threading.Condition()
        """Notified when a process writes a line or ends."""
        self.failures: list[Process] = []
        """Processes that ended without being asked to, and are not started again."""
        self.ended: set[str] = set()
        """Names of the processes that have ended and are not started again."""
        self._jobs: dict[str, Job] = {}
        self._told: dict[str, str] = {}
        self.restarts = Restarts(self._start_after_failure)
        self._read_end, self._write_end = os.pipe()
        self._sampler = Sampler(self.measure, _SAMPLE_PERIOD)

    def __enter__(self) -> "Supervisor":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def start(self, name: str, command: Sequence[str], environment: Mapping[str, str] | None = None) -> Process:
        """Start a process. It replaces one of the same name, which is killed first if it still runs."""
        return self.start_job(name, Job(command, environment or {}))

    def start_job(self, name: str, job: Job) -> Process:
        """As `start`. Raises ZteamError if the command cannot be started."""
        if name in self.processes:
            self.processes[name].stopping = True
            self.processes[name].kill()
            self.processes[name].join(GRACE)
        self._jobs[name] = job
        self.ended.discard(name)
        if job.restarts:
            self.restarts.allow(name)
        process = self._begin(name, job)
        with self.changed:
            self.processes[name] = process
        return process

    def _begin(self, name: str, job: Job) -> Process:
        self.restarts.note_start(name)
        try:
            process = Process(
                name,
                job.command,
                self._read_end,
                on_line=self._take_line,
                on_exit=self._take_exit,
                environment=job.environment,
                folder=job.folder,
                start_child=self._start_child,
            )
        except OSError as error:
            raise ZteamError(f"{name}: cannot start {job.command[0]}: {error.strerror or error}") from None
        if job.words:
            process.write_line(job.words, last=False)
        return process

    def restart(self, name: str) -> Process:
        """Start a process of this set again, with the same command and the line that it was told."""
        process = self.start_job(name, self._jobs[name])
        if name in self._told:
            process.write_line(self._told[name])
        return process

    def tell(self, name: str, text: str) -> None:
        """Write a line to the standard input of a process, and of those that replace it, then close the input."""
        self._told[name] = text
        self.processes[name].write_line(text)

    def _start_after_failure(self, name: str) -> None:
        try:
            self.restart(name)
        except ZteamError as error:
            log.error("%s; it is not started again", error)
            self.failures.append(self.processes[name])
            self.ended.add(name)

    def _take_line(self, process: Process, line: str) -> None:
        self._on_line(process.name, line)
        with self.changed:
            self.changed.notify_all()

    def _take_exit(self, process: Process) -> None:
        name, code = process.name, process.exit_code
        failed = not process.stopping and not (code == 0 and self._jobs[name].may_end)
        again = self.restarts.take_failure(name) if failed and code not in _CLEAN else Again()
        if again.delay is None:
            self.ended.add(name)
        if failed:
            self._on_failure(process, again)
        with self.changed:
            if failed and again.delay is None:
                self.failures.append(process)
            self.changed.notify_all()

    def wait(self, ready: Callable[[], bool], timeout: float) -> bool:
        """Wait until `ready()`, checked when a process writes a line or ends, for at most `timeout` s."""
        with self.changed:
            return wait_until(self.changed, ready, timeout)

    def stop(self, names: Sequence[str], hurry: Callable[[], bool] = lambda: False) -> None:
        """Ask these processes to stop, all at once; kill the rest after GRACE, or as soon as `hurry()`."""
        self.restarts.cancel(names)
        chosen = [self.processes[name] for name in names if name in self.processes]
        for process in chosen:
            process.terminate()
        deadline = monotonic() + GRACE
        self.wait(lambda: hurry() or not any(p.running for p in chosen), max(0.0, deadline - monotonic()))
        for process in chosen:
            if process.running:
                process.kill()
            process.join(GRACE)

    def close(self) -> None:
        """Kill every process that still runs."""
        self.restarts.end()
        for process in self.processes.values():
            process.stopping = True
            if process.running:
                process.kill()
        for process in self.processes.values():
            process.join(GRACE)
        for end in (self._read_end, self._write_end):
            if end >= 0:
                os.close(end)
        self._read_end = self._write_end = -1
        self._sampler.close(GRACE)

    def measure(self) -> None:
        """Update the memory and processor time of every process."""
        for process in list(self.processes.values()):
            process.measure()
