"""One child process: its own process group, its output line by line, its peak memory. It does not outlive us."""

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import IO, Protocol, Self

import msgspec

from zteam.clock import monotonic
from zteam.errors import log
from zteam.node.launcher import LINK, Report

PROC = Path("/proc")
_KEPT_LINES = 200
MAX_LINE = 16_384
"""Characters of a line of a child's output. What a longer line has beyond them is read and dropped."""
_CUT = "… (the line is longer)"
_LONGEST_REPORT = 1 << 20
"""Bytes: an answer may name every mistake of a team."""
_LAST_LINES = 1.0
"""Host seconds for the lines and reports that a process has left when it ends. Both end with it, unless a process that
it started holds them open from a session of its own."""


class ProcessReport(msgspec.Struct):
    """One process of a run; memory at its peak (MB, 10⁶ bytes), and processor time so far."""

    name: str
    pid: int
    exit: int | None = None
    restarts: int = 0
    rss_mb: float = 0.0
    pss_mb: float = 0.0
    cpu_seconds: float = 0.0

    def measure(self) -> Self:
        """Take the present figures of the process, and return the row; leave them unchanged if it is gone."""
        try:
            status, rollup, stat = (_read(f"{PROC}/{self.pid}/{name}") for name in ("status", "smaps_rollup", "stat"))
        except OSError:
            return self
        fields = stat.rpartition(")")[2].split()
        kib = dict(re.findall(r"^(VmHWM|Pss):\s*(\d+)", f"{status}\n{rollup}", re.MULTILINE))
        self.rss_mb = max(self.rss_mb, round(int(kib.get("VmHWM", 0)) * 1024 / 1e6, 1))
        self.pss_mb = max(self.pss_mb, round(int(kib.get("Pss", 0)) * 1024 / 1e6, 1))
        # Fields 14 and 15 of proc(5) stat; the list begins at field 3.
        self.cpu_seconds = round((int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), 2)
        return self


def _read(path: str) -> str:
    # pathlib interns the parts of a path: with a process id in it that table grew by half a megabyte in an hour.
    with open(path) as file:  # noqa: PTH123
        return file.read()


def zteam_command(command: str, *arguments: str) -> list[str]:
    """The command line of a zteam command for this interpreter. Files in the current folder do not shadow modules."""
    return [sys.executable, "-P", "-m", "zteam", *(() if command == "zteam" else (command,)), *arguments]


class Job(msgspec.Struct, frozen=True):
    """What it takes to start a process, once or again."""

    command: Sequence[str]
    environment: Mapping[str, str] = {}
    """Added to this process's."""
    folder: Path | None = None
    """Where it runs; None = where this process runs."""
    words: str = ""
    """Its standard input, a line."""
    restarts: bool = False
    """Whether it is started again when it has failed."""
    may_end: bool = False
    """Whether it may end by itself, with exit code 0."""
    batch: bool = False
    """Whether it takes no processor from another process when it wakes, on Linux (SCHED_BATCH)."""
    learn: "Callable[[Job, Report], Job | None] | None" = None
    """`learn(job, report)` is asked for each report of the process: the job that follows when this one has failed, such
    as one with the port that the process has found; None = the same as before."""


class Child(Protocol):
    """As a `subprocess.Popen`, but `wait` also ends the rest of its group, and releases the process id only then."""

    pid: int
    returncode: int | None
    stdin: IO[str] | None
    stdout: IO[str] | None

    def poll(self) -> int | None: ...
    def wait(self) -> int: ...
    def send_signal(self, sig: int) -> None: ...


StartChild = Callable[[Job, int], Child]
"""`start(job, link)` starts a child: its own process group, pipes for its input and output, and its end of the link to
this launcher (`zteam.node.launcher`). Raises OSError if the command cannot be started."""


def environment_of(added: Mapping[str, str]) -> dict[str, str]:
    """The environment of a child, without the number of its link."""
    return {**os.environ, **added, "PYTHONUNBUFFERED": "1"}


_GUARD = "trap '' HUP INT TERM; read -r line; kill -TERM 0; sleep 2; kill -KILL 0"
"""Waits for the end of the link, and ends its own process group: what handles SIGTERM has 2 s to end in order."""


def runs_zteam(command: Sequence[str]) -> bool:
    """Whether it is a command line of a module of zteam, as `zteam_command` makes them."""
    return list(command[:3]) == [sys.executable, "-P", "-m"] and command[3].partition(".")[0] == "zteam"


class _Spawned(subprocess.Popen[str]):
    guard: "subprocess.Popen[bytes] | None" = None
    """Of a program that may not watch its link: a shell in the program's group, which ends with the group."""

    def watch(self, link: int) -> None:
        """End the program and all that it has started, in its group, when the launcher is gone."""
        # Without a shell, or when the program has ended already, there is nothing to do.
        with contextlib.suppress(OSError):
            self.guard = subprocess.Popen(
                ["/bin/sh", "-c", _GUARD, "zteam-guard"],
                stdin=link,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                process_group=self.pid,
            )

    def wait(self, timeout: float | None = None) -> int:
        # Without waitid the process id is free before the group is ended.
        if timeout is None and self.returncode is None and hasattr(os, "waitid"):
            with contextlib.suppress(ChildProcessError):
                os.waitid(os.P_PID, self.pid, os.WEXITED | os.WNOWAIT)
        else:
            super().wait(timeout)
        kill_group(self.pid)
        if self.guard is not None:
            self.guard.kill()
            self.guard.wait()
        return super().wait(timeout)


def kill_group(pid: int) -> None:
    """End a process that leads a group, and the whole group, at once."""
    # It may be gone already.
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)


def spawn(job: Job, link: int) -> Child:
    """Start a child as a program of its own."""
    child = _Spawned(
        list(job.command),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        pass_fds=(link,),
        env={**environment_of(job.environment), LINK: str(link)},
        cwd=job.folder,
        # Its own group: the terminal's Ctrl+C reaches the launcher alone, which stops the team in order.
        process_group=0,
        text=True,
        errors="replace",
    )
    if not runs_zteam(job.command):
        child.watch(link)
    return child


class Process:
    """A running child. `on_line(process, line)`, `on_report(process, report)` and `on_exit(process)` are called from
    threads of its own."""

    def __init__(
        self,
        name: str,
        job: Job,
        on_line: Callable[["Process", str], None],
        on_report: Callable[["Process", Report], None],
        on_exit: Callable[["Process"], None],
        start_child: StartChild = spawn,
    ) -> None:
        self.name = name
        self.lines: deque[str] = deque(maxlen=_KEPT_LINES)
        self.stopping = False
        """Whether it was asked to end."""
        self.report = Report()
        """What it has reported, the newest of each field."""
        self._on_line, self._on_report, self._on_exit = on_line, on_report, on_exit
        self._link, theirs = socket.socketpair()
        with theirs, contextlib.ExitStack() as failing:
            failing.callback(self._link.close)
            self._child = start_child(job, theirs.fileno())
            failing.pop_all()
        if job.batch:
            # Before it reads its options, so that all of its threads are like that. It may have ended already.
            with contextlib.suppress(OSError, AttributeError):
                os.sched_setscheduler(self._child.pid, os.SCHED_BATCH, os.sched_param(0))
        self.usage = ProcessReport(name, self._child.pid)
        self._readers = [
            threading.Thread(target=read, name=f"{what} of {name}", daemon=True)
            for read, what in ((self._read, "output"), (self._read_reports, "reports"))
        ]
        for reader in self._readers:
            reader.start()
        self._watcher = threading.Thread(target=self._watch, name=f"watch {name}", daemon=True)
        self._watcher.start()
        if job.words:
            self.write_line(job.words)

    @property
    def pid(self) -> int:
        return self._child.pid

    @property
    def exit_code(self) -> int | None:
        """As in subprocess: negative for a signal, None while it runs."""
        return self._child.returncode

    @property
    def fault(self) -> str:
        """The text of the error that ended it; empty if there is none."""
        return self.report.fault

    @property
    def running(self) -> bool:
        return self._child.poll() is None

    def _read(self) -> None:
        assert self._child.stdout is not None
        begins = True
        for part in iter(partial(self._child.stdout.readline, MAX_LINE), ""):
            ends = part.endswith("\n") or len(part) < MAX_LINE
            is_rest, begins = not begins, ends
            if is_rest:
                continue
            text = part.rstrip("\n") if ends else part + _CUT
            self.lines.append(text)
            try:
                self._on_line(self, text)
            except Exception:
                # The reader of the output may be gone (`zteam up | head`); the process must still be watched.
                log.debug("a line of %s could not be passed on", self.name, exc_info=True)
        self._child.stdout.close()

    def _read_reports(self) -> None:
        with self._link, self._link.makefile("rb") as lines:
            while line := lines.readline(_LONGEST_REPORT):
                try:
                    news = msgspec.json.decode(line, type=Report)
                except (ValueError, RecursionError) as error:
                    log.debug("report of %s: %s", self.name, error)
                    continue
                given = {field: value for field in Report.__struct_fields__ if (value := getattr(news, field))}
                self.report = msgspec.structs.replace(self.report, **given)
                try:
                    self._on_report(self, news)
                except Exception:
                    # The end of this thread would close the link, and so stop the child.
                    log.exception("a report of %s could not be passed on", self.name)

    def _watch(self) -> None:
        self._child.wait()
        end = monotonic() + _LAST_LINES
        for reader in self._readers:
            reader.join(max(0.0, end - monotonic()))
        # A process in a session of its own may hold the other end.
        with contextlib.suppress(OSError):
            self._link.shutdown(socket.SHUT_RDWR)
        assert self._child.stdin is not None
        # Buffered text may have no reader any more.
        with contextlib.suppress(BrokenPipeError):
            self._child.stdin.close()
        self._on_exit(self)

    def write_line(self, text: str) -> None:
        """Write a line to its standard input, and close that."""
        assert self._child.stdin is not None
        # It may have ended already (ValueError: its input is closed too); `on_exit` reports the end.
        with contextlib.suppress(BrokenPipeError, ValueError):
            self._child.stdin.write(text + "\n")
            self._child.stdin.close()

    def signal(self, number: int) -> None:
        if self.running:
            self._child.send_signal(number)

    def terminate(self) -> None:
        self.stopping = True
        self.signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it and its whole process group at once."""
        kill_group(self.pid)

    def join(self, timeout: float) -> bool:
        """Wait for its end and its last line; False if they did not come within `timeout` s."""
        self._watcher.join(timeout)
        return not self._watcher.is_alive()


def exit_text(code: int | None) -> str:
    if code is None:
        return "still running"
    if code < 0:
        try:
            return f"killed by {signal.Signals(-code).name}"
        except ValueError:
            return f"killed by signal {-code}"
    return f"exit code {code}"
