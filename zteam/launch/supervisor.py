"""Starts, watches and ends a set of processes, and leaves none behind on any way out."""

import os
import threading
from collections.abc import Callable, Sequence
from types import TracebackType

from zteam.clock import monotonic, wait_until
from zteam.launch.process import Process

GRACE = 2.0
"""Seconds from SIGTERM until SIGKILL; the processes end themselves after 1.5."""
_SAMPLE_PERIOD = 5.0
"""Seconds between looks at memory: reading a process's PSS walks its page tables and holds it up for milliseconds."""


class Supervisor:
    """A set of processes by name.

    Each child holds the read end of a pipe whose write end only this process has: when this process is gone, however
    it ended, they stop by themselves.
    """

    def __init__(self, on_line: Callable[[str, str], None], on_failure: Callable[[Process], None]) -> None:
        self._on_line = on_line
        self._on_failure = on_failure
        self.processes: dict[str, Process] = {}
        self.changed = threading.Condition()
        """Notified when a process says a line or ends."""
        self.failures: list[Process] = []
        """Processes that ended and were not asked to."""
        self._read_end, self._write_end = os.pipe()
        self._closing = threading.Event()
        self._sampler = threading.Thread(target=self._sample, name="usage", daemon=True)
        self._sampler.start()

    def __enter__(self) -> "Supervisor":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def start(self, name: str, command: Sequence[str], environment: dict[str, str] | None = None) -> Process:
        """Start a process; one of the same name is replaced, and ended first if it still runs."""
        before = self.processes.get(name)
        if before is not None:
            before.stopping = True
            before.kill()
            before.join(GRACE)
        process = Process(
            name, command, self._read_end, on_line=self._take_line, on_exit=self._take_exit, environment=environment
        )
        with self.changed:
            self.processes[name] = process
        return process

    def _take_line(self, process: Process, line: str) -> None:
        self._on_line(process.name, line)
        with self.changed:
            self.changed.notify_all()

    def _take_exit(self, process: Process) -> None:
        failed = not process.stopping
        if failed:
            self._on_failure(process)
        with self.changed:
            if failed:
                self.failures.append(process)
            self.changed.notify_all()

    def wait(self, ready: Callable[[], bool], timeout: float) -> bool:
        """Wait until `ready()`, looked at when a process says something or ends, or for `timeout` s."""
        with self.changed:
            return wait_until(self.changed, ready, timeout)

    def stop(self, names: Sequence[str], hurry: Callable[[], bool] = lambda: False) -> None:
        """Ask these to stop, all at once; kill what is left after GRACE, or as soon as `hurry()`."""
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
        """Kill whatever still runs."""
        self._closing.set()
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
        self._sampler.join(GRACE)

    def measure(self) -> None:
        """Bring every process's memory and time up to date."""
        for process in list(self.processes.values()):
            process.measure()

    def _sample(self) -> None:
        while not self._closing.wait(_SAMPLE_PERIOD):
            self.measure()
