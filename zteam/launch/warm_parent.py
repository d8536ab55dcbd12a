"""Children that are forked from a warm parent instead of spawned: they start at once and share its memory.

A warm parent is a process that has imported what children need (`fork_server.py`). Where that cannot be had, children
are spawned: they take more time and memory, and behave alike.
"""

import contextlib
import io
import logging
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from zteam.launch.children import Child, environment_of, spawn
from zteam.launch.fork_protocol import PADDING, Start, make_sockets
from zteam.launch.forked_child import ForkedChild, Orders, start_child
from zteam.launch.preloads import all_preloads, preloads_of

log = logging.getLogger("zteam")

NAME = "warm_parent"
"""What a report calls it."""
NO_FORK = "ZTEAM_NO_FORK"
"""Environment: anything but nothing makes all children be spawned."""
_HOOKS = ("COVERAGE_PROCESS_START", "COV_CORE_SOURCE")
"""Environment: measures every interpreter from its first line on, so a fork would miss some."""
_OWN_VARIABLES = ("ZTEAM_", "PYTEST_")
"""Prefixes of the variables that zteam reads when it needs them, and that modules and libraries do not read."""


_MEMORY = {"MALLOC_ARENA_MAX": "1"}
"""For the C library, which reads it when a program starts: one heap, not one for each thread. It saves 0.3 MB a child;
its threads seldom allocate at the same time."""


def can_fork() -> bool:
    """Whether this system has what a warm parent needs, and the user has not refused it."""
    if sys.platform != "linux" or os.environ.get(NO_FORK) or any(name in os.environ for name in _HOOKS):
        return False
    try:
        os.close(os.pidfd_open(os.getpid()))
    except (AttributeError, OSError):
        return False
    return True


class WarmParent:
    """Starts children as `spawn` does, but forks those that run a module of zteam.

    Its process starts with `prepare` or the first child, and anew when it has died.
    """

    def __init__(self) -> None:
        self._orders: Orders | None = None
        self._surroundings: dict[str, str] = {}
        self._processes: list[subprocess.Popen[bytes]] = []
        self._children: list[ForkedChild] = []

    def __enter__(self) -> "WarmParent":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def pids(self) -> dict[str, int]:
        """Process id of the warm parent by its name, if it runs."""
        running = [process.pid for process in self._processes if process.poll() is None]
        return {NAME: running[-1]} if running else {}

    def prepare(self, *, view: bool = False) -> None:
        """Begin to import now, with `view` what a view needs too."""
        if can_fork():
            with contextlib.suppress(OSError):
                orders = self._find_orders()
                if view:
                    orders.load(all_preloads(view=True))

    def start(
        self, command: Sequence[str], lifeline: int, environment: Mapping[str, str], folder: Path | None = None
    ) -> Child:
        """Start a child, as StartChild says."""
        if folder is not None:
            return spawn(command, lifeline, environment, folder)
        with contextlib.ExitStack() as theirs, contextlib.ExitStack() as ours:
            stdin, writer = os.pipe()
            theirs.callback(os.close, stdin)
            ours.callback(os.close, writer)
            reader, stdout = os.pipe()
            theirs.callback(os.close, stdout)
            ours.callback(os.close, reader)
            child = self.start_with(command, [stdin, stdout, stdout, lifeline], environment)
            if child is not None:
                ours.pop_all()
        if child is None:
            return spawn(command, lifeline, environment)
        # As subprocess.Popen opens them.
        child.stdin = io.TextIOWrapper(os.fdopen(writer, "wb"), write_through=True, errors="replace")
        child.stdout = os.fdopen(reader, errors="replace")
        return child

    def start_with(
        self, command: Sequence[str], descriptors: Sequence[int], environment: Mapping[str, str]
    ) -> ForkedChild | None:
        """Fork a child with these as standard input, output, error and lifeline; None if it has to be spawned."""
        if not (can_fork() and _is_own(command) and all(name.startswith(_OWN_VARIABLES) for name in environment)):
            return None
        try:
            return self._fork(command, descriptors, environment)
        except OSError as error:
            log.debug("%s is spawned: %s", command[3], error)
            return None

    def close(self) -> None:
        """End the process. Its children go on, but their exit codes are lost."""
        self._forget()
        self._children.clear()
        for process in self._processes:
            process.kill()
            process.wait()
        self._processes.clear()

    def _fork(self, command: Sequence[str], descriptors: Sequence[int], environment: Mapping[str, str]) -> ForkedChild:
        orders = self._find_orders()
        try:
            child = start_child(orders, _make_start(command, environment), descriptors)
        except ConnectionError:
            # It is dead. The next child gets a new one.
            self._forget()
            raise
        self._children.append(child)
        return child

    def _forget(self) -> None:
        if self._orders is not None:
            self._orders.close()
        self._orders = None

    def _find_orders(self) -> Orders:
        self._children = [child for child in self._children if child.returncode is None]
        surroundings = _find_surroundings()
        if surroundings != self._surroundings and self._orders is not None:
            if self._children:
                raise OSError("the environment is another one than that of the processes that run")
            self.close()
        if self._orders is None:
            self._surroundings = surroundings
            self._orders, process = _spawn_server()
            self._processes.append(process)
            self._orders.load(all_preloads())
        return self._orders


def _spawn_server() -> tuple[Orders, "subprocess.Popen[bytes]"]:
    ours, theirs = make_sockets()
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "zteam.launch.fork_server", str(theirs.fileno()), PADDING],
            # Pipes, as its children will have them. What modules say while they are imported is not read.
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            pass_fds=(theirs.fileno(),),
            env={**_MEMORY, **environment_of({})},
            process_group=0,
        )
    assert process.stdin is not None and process.stdout is not None
    process.stdin.close()
    process.stdout.close()
    return Orders(ours), process


def _make_start(command: Sequence[str], environment: Mapping[str, str]) -> Start:
    return Start(
        [os.fsencode(word) for word in command],
        {os.fsencode(name): os.fsencode(value) for name, value in environment_of(environment).items()},
        os.fsencode(Path.cwd()),
        _read_umask(),
        [int(number) for number in signal.valid_signals() if signal.getsignal(number) == signal.SIG_IGN],
        preloads_of(command),
    )


def _is_own(command: Sequence[str]) -> bool:
    """Whether it is a command line as `zteam_command` makes them."""
    return list(command[:3]) == [sys.executable, "-P", "-m"] and command[3].startswith("zteam.")


def _find_surroundings() -> dict[str, str]:
    """What a warm parent has taken over when it started: the environment, as far as modules and libraries read it."""
    found = {name: value for name, value in os.environ.items() if not name.startswith(_OWN_VARIABLES)}
    paths = filter(None, found.get("PYTHONPATH", "").split(os.pathsep))
    return {**found, "PYTHONPATH": os.pathsep.join(str(Path(path).absolute()) for path in paths)}


def _read_umask() -> int:
    # Asking the system would mean to set it, which other threads would see.
    label = "Umask:"
    return next(
        int(line.removeprefix(label), 8)
        for line in Path("/proc/self/status").read_text().splitlines()
        if line.startswith(label)
    )
