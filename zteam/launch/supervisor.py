"""Starts, watches and ends a set of processes. None of them outlives the supervisor, however it ends."""

import os
import threading
from collections.abc import Callable, Sequence
from types import TracebackType

from zteam.clock import monotonic, wait_until
from zteam.launch.process import Process

GRACE = 2.0
"""Seconds from SIGTERM until SIGKILL; the processes end themselves after 1.5."""
_SAMPLE_PERIOD = 5.0
"""Seconds between measurements: reading a process's PSS walks its page tables, which delays it by milliseconds."""


class Supervisor:
    """A set of processes by name.

    Each child inherits the read end of a pipe; this process alone has the write end. When this process ends, the
    children read the end of the file and stop.
    """

    def __init__(self, on_line: Callable[[str, str], None], on_failure: Callable[[Process], None]) -> None:
        self._on_line = on_line
        self._on_failure = on_failure
        self.processes: dict[str, Process] = {}
        self.changed = threading.Condition()
        """Notified when a process writes a line or ends."""
        self.failures: list[Process] = []
        """Processes that ended without being asked to."""
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
        """Start a process. It replaces one of the same name, which is killed first if it still runs."""
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
        """Wait until `ready()`, checked when a process writes a line or ends, for at most `timeout` s."""
        with self.changed:
            return wait_until(self.changed, ready, timeout)

    def stop(self, names: Sequence[str], hurry: Callable[[], bool] = lambda: False) -> None:
        """Ask these processes to stop, all at once; kill the rest after GRACE, or as soon as `hurry()`."""
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
        """Update the memory and processor time of every process."""
        for process in list(self.processes.values()):
            process.measure()

    def _sample(self) -> None:
        while not self._closing.wait(_SAMPLE_PERIOD):
            self.measure()
