"""Children that are forked from a warm parent instead of spawned: they start at once and share its memory.

A warm parent is a process that has imported what children need (`fork_server.py`). Where that cannot be had, children
are spawned: they take more time and memory, and behave alike.
"""

import contextlib
import io
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import IO

import msgspec

from zteam.clock import HOST_FACTOR
from zteam.errors import log
from zteam.team.launch.fork_server import MAX_MESSAGE, Order, Reply, StartChild
from zteam.team.launch.process import Child, Job, environment_of, runs_zteam, spawn

NAME = "warm_parent"
"""What a report calls it."""
NO_FORK = "ZTEAM_NO_FORK"
"""Environment: anything but nothing makes all children be spawned."""
UNKNOWN = 255
"""Exit code of a child whose warm parent was killed, which alone knew it."""
_HOOKS = ("COVERAGE_PROCESS_START", "COV_CORE_SOURCE")
"""Environment: measures every interpreter from its first line on, so a fork would miss some."""
_OWN_VARIABLES = ("ZTEAM_", "PYTEST_")
"""Prefixes of the variables that zteam reads when it needs them, and that modules and libraries do not read."""
_PATIENCE = 60.0 * HOST_FACTOR
"""Host seconds for a warm parent to answer: it may have to import from a slow disk first."""


def can_fork() -> bool:
    """Whether this system has what a warm parent needs, and the user has not refused it."""
    refused = os.environ.get(NO_FORK) or any(name in os.environ for name in _HOOKS)
    return hasattr(os, "pidfd_open") and not refused


class _Server:
    """A process that forks. It ends when its socket is closed."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.children: set[int] = set()
        """Process ids of those that have not been collected."""
        self.environment = _inherited_environment()
        self._end, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._end.settimeout(_PATIENCE)
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "zteam.team.launch.fork_server", str(theirs.fileno())],
                # Pipes, as its children will have them. What modules say while they are imported is not read.
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=(theirs.fileno(),),
                env=environment_of({}),
                process_group=0,
            )
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.close()
        self.process.stdout.close()

    @property
    def running(self) -> bool:
        """Whether it can be asked."""
        return self._end.fileno() >= 0 and self.process.poll() is None

    def fork(self, job: Job, link: int) -> "ForkedChild":
        """A child. Raises OSError."""
        given = {os.fsencode(name): os.fsencode(value) for name, value in environment_of(job.environment).items()}
        start = StartChild(job.command[3], list(job.command[4:]), given)
        with contextlib.ExitStack() as theirs, contextlib.ExitStack() as ours:
            stdin, writer = os.pipe()
            theirs.callback(os.close, stdin)
            ours.callback(os.close, writer)
            reader, stdout = os.pipe()
            theirs.callback(os.close, stdout)
            ours.callback(os.close, reader)
            place = os.open(job.folder or ".", os.O_PATH)
            theirs.callback(os.close, place)
            pid = self._ask(start, [stdin, stdout, stdout, link, place])
            try:
                descriptor = os.pidfd_open(pid)
            except OSError:
                # There is none left to watch it with. It must not run beside the one that is spawned in its place.
                os.kill(pid, signal.SIGKILL)
                raise
            ours.pop_all()
        self.children.add(pid)
        return ForkedChild(pid, descriptor, self, writer, reader)

    def collect(self, pid: int) -> int:
        """The exit code of a child that has ended; its process id becomes free."""
        self.children.discard(pid)
        try:
            return self._ask(pid)
        except OSError as error:
            log.debug("exit code of process %d: %s", pid, error)
            return UNKNOWN

    def close(self) -> None:
        """End the process. Its children go on, but their exit codes are lost."""
        self._end.close()
        self.process.kill()
        self.process.wait()

    def _ask(self, order: Order, descriptors: Sequence[int] = ()) -> int:
        with self._lock:
            try:
                socket.send_fds(self._end, [msgspec.msgpack.encode(order)], descriptors)
                data = self._end.recv(MAX_MESSAGE)
            except TimeoutError:
                # What it says later would be taken for the reply to another order.
                self._end.close()
                raise
        if not data:
            raise ConnectionResetError("the warm parent is gone")
        reply = msgspec.msgpack.decode(data, type=Reply)
        if isinstance(reply, int):
            return reply
        raise OSError(reply)


class ForkedChild:
    """A child of a warm parent: a `Child`."""

    def __init__(self, pid: int, descriptor: int, server: _Server, writer: int, reader: int) -> None:
        self.pid, self._descriptor, self._server = pid, descriptor, server
        self.returncode: int | None = None
        # As subprocess.Popen opens them.
        self.stdin: IO[str] | None = io.TextIOWrapper(os.fdopen(writer, "wb"), write_through=True, errors="replace")
        self.stdout: IO[str] | None = os.fdopen(reader, errors="replace")
        self._lock = threading.Lock()

    def poll(self) -> int | None:
        """Find out whether it has ended; its exit code."""
        with self._lock:
            if self.returncode is None and _wait_for(self._descriptor, 0):
                self.returncode = self._server.collect(self.pid)
        return self.returncode

    def wait(self) -> int:
        """Wait until it has ended; the warm parent ends the rest of its group and releases its process id. Once."""
        _wait_for(self._descriptor, None)
        code = self.poll()
        os.close(self._descriptor)
        assert code is not None
        return code

    def send_signal(self, sig: int) -> None:
        with self._lock:
            if self.returncode is None:
                with contextlib.suppress(ProcessLookupError):
                    signal.pidfd_send_signal(self._descriptor, sig)


def _wait_for(descriptor: int, timeout: float | None) -> bool:
    # Host time: a process has ended when its descriptor can be read; no time is measured.
    waiting = select.poll()  # noqa: TID251
    waiting.register(descriptor, select.POLLIN)
    return bool(waiting.poll(timeout))


class WarmParent:
    """Starts children as `spawn` does, but forks those that run a command of zteam. Its process starts with `prepare`
    or the first child, and anew when it has died."""

    def __init__(self) -> None:
        self._server: _Server | None = None
        self._lock = threading.Lock()

    @property
    def pids(self) -> dict[str, int]:
        """Process id of the warm parent by its name, if it runs."""
        server = self._server
        return {NAME: server.process.pid} if server is not None and server.running else {}

    def prepare(self) -> None:
        """Begin to import now."""
        with contextlib.suppress(OSError):
            self._find_server()

    def start(self, job: Job, link: int) -> Child:
        if runs_zteam(job.command) and all(n.startswith(_OWN_VARIABLES) for n in job.environment):
            try:
                return self._find_server().fork(job, link)
            except OSError as error:
                log.debug("%s is spawned: %s", job.command[3], error)
        return spawn(job, link)

    def close(self) -> None:
        with self._lock:
            if self._server is not None:
                self._server.close()
            self._server = None

    def _find_server(self) -> _Server:
        if not can_fork():
            raise OSError("this system or the user has refused it")
        with self._lock:
            server = self._server
            if server is not None and server.running and server.environment != _inherited_environment():
                if server.children:
                    raise OSError("the environment is another one than that of the processes that run")
                server.close()
            if server is None or not server.running:
                if server is not None:
                    server.close()
                self._server = server = _Server()
            return server


def _inherited_environment() -> dict[str, str]:
    """What a warm parent takes over when it starts: the environment, as far as modules and libraries read it."""
    found = {name: value for name, value in os.environ.items() if not name.startswith(_OWN_VARIABLES)}
    paths = filter(None, found.get("PYTHONPATH", "").split(os.pathsep))
    return {**found, "PYTHONPATH": os.pathsep.join(str(Path(path).absolute()) for path in paths)}
