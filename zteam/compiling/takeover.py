"""Compiled kernels for a process: from the cache, compiled before it runs, or meanwhile, to take over or for later."""

import gc
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from zteam.compiling import kernel_cache
from zteam.compiling.kernels import KernelSet, has_numba

FAILED = "failed: "
"""Prefix of the line in which a child says why kernels could not be compiled or kept."""
_AT_ONCE = 2
"""Processes that compile before a run; a third would end no sooner."""


def prepare(kernels: KernelSet) -> None:
    """Let all kernels of a set run compiled, unless that was decided before. What the cache lacks is compiled first.

    With an empty cache that takes 20 s of processor time in two processes; the log shows progress. If it fails, the log
    says why, and kernels are compiled in memory.
    """
    if kernels.choice is not None:
        return
    if has_numba():
        reason = fill_cache(kernels)
        if reason:
            kernels.give_up_cache(reason)
    kernels.use_compiled()


def fill_cache(kernels: KernelSet) -> str:
    """Compile what the cache lacks, in up to two processes; return why that failed, empty if it did not."""
    reason = kernel_cache.find_obstacle()
    if reason or kernel_cache.is_complete(kernels.name):
        return reason
    kernels.log.info("compiling %s, once on this machine", kernels.title)
    arguments: list[list[str]] = [[], ["--backwards"]]
    try:
        lock = kernel_cache.try_lock(kernels.name)
        children = _Children(kernels, arguments[: min(_AT_ONCE, os.cpu_count() or 1)], lock)
    except OSError as error:
        return f"no process can be started to compile ({error})"
    return children.wait(lambda ready, total: kernels.log.info("compiled %d of %d kernels", ready, total))


def begin(kernels: KernelSet) -> "Takeover | None":
    """Choose how kernels run in a process that must start at once; return the takeover to compiled ones, if any."""
    if not has_numba():
        kernels.use_compiled()
        return None
    reason = kernel_cache.find_obstacle()
    if reason:
        kernels.use_plain()
        kernels.warn_of_cache(reason, kernels.on_numpy)
        return None
    if kernel_cache.is_complete(kernels.name):
        kernels.use_compiled()
        return None
    kernels.use_plain()
    return Takeover(kernels)


@contextmanager
def run_kept(kernels: KernelSet) -> Iterator[None]:
    """In here kernels run as they are kept, without numba; all of them plain to the end if the set is not complete.

    Then a child compiles it meanwhile for processes that start later, unless another process does so already.
    """
    if kernels.choice is None:
        kernels.use_kept()
    children = None if kernels.choice else _fill_beside(kernels)
    try:
        yield
    finally:
        if children is not None:
            children.end()


def _fill_beside(kernels: KernelSet) -> "_Children | None":
    """What compiles the set into the cache from now on; None where that cannot be, or another process does it."""
    if not has_numba() or kernel_cache.find_obstacle():
        return None
    try:
        lock = kernel_cache.try_lock(kernels.name)
        children = None if lock is None else _Children(kernels, [["--nice"]], lock)
    except OSError as error:
        kernels.log.debug("no process can be started to compile (%s)", error)
        return None
    if children is not None:
        kernels.log.debug("compiling %s for the next start, once on this machine", kernels.title)
        # To wait for it is to note that the set is complete.
        threading.Thread(target=children.wait, args=(lambda _ready, _total: None,), name="kernels", daemon=True).start()
    return children


class Takeover:
    """For a run that began with plain kernels: a child compiles, a thread loads, and `poll` switches."""

    def __init__(self, kernels: KernelSet) -> None:
        self._kernels = kernels
        self._children: _Children | None = None
        self._thread: threading.Thread | None = None
        self._closing = False
        self._loaded = False

    def start(self) -> None:
        """Begin to compile."""
        kernels = self._kernels
        what = kernels.on_numpy.partition(",")[0]
        kernels.log.info("%s while their kernels are compiled, once on this machine", what)
        try:
            self._children = _Children(kernels, [["--nice"]], kernel_cache.try_lock(kernels.name))
        except OSError as error:
            kernels.warn_of_cache(f"no process can be started to compile ({error})", kernels.on_numpy)
            return
        self._thread = threading.Thread(target=self._work, args=(self._children,), name="kernels", daemon=True)
        self._thread.start()

    def wait(self, timeout: float) -> bool:
        """Wait for up to `timeout` s until kernels are loaded or that failed; return whether this wait is over."""
        if self._thread is not None:
            self._thread.join(timeout)
        return self._thread is None or not self._thread.is_alive()

    def poll(self) -> None:
        """Between two ticks: let kernels run compiled once they are loaded."""
        if self._loaded:
            self._loaded = False
            self._kernels.use_compiled()
            self._kernels.log.info("compiled kernels take over")

    def close(self) -> None:
        """End the child; the kernels that it finished are kept."""
        self._closing = True
        if self._children is not None:
            self._children.end()
        # The interpreter must not end while the compiler is at work in it.
        self.wait(1.0)

    def _work(self, children: "_Children") -> None:
        log = self._kernels.log
        reason = children.wait(lambda ready, total: log.debug("compiled %d of %d kernels", ready, total))
        if not reason:
            try:
                self._load()
            except Exception as error:
                # Any failure of the compiler: the run goes on with plain kernels.
                reason = f"{type(error).__name__}: {error}"
        if reason and not self._closing:
            self._kernels.warn_of_cache(reason, self._kernels.on_numpy)
        self._loaded = not reason

    def _load(self) -> None:
        """Load the kernels that have run so far; another is loaded when it is called first."""
        # A garbage collection would visit all objects of a running process and stop the interpreter meanwhile.
        gc.disable()
        try:
            for kernel in self._kernels.kernels:
                if kernel.sample is not None and not self._closing and not kernel.load(kernel.sample):
                    kernel.compile()
        finally:
            gc.freeze()
            gc.enable()


class _Children:
    """Processes that compile, one for each list of arguments. They end when this process ends, in any way."""

    def __init__(self, kernels: KernelSet, arguments: Sequence[Sequence[str]], lock: int | None) -> None:
        """`lock` is that of `kernel_cache.try_lock`: they hold it as long as one of them runs."""
        self._set = kernels.name
        reader, writer = os.pipe()
        self._lines = os.fdopen(reader)
        locks = () if lock is None else (lock,)
        try:
            self._processes = [
                subprocess.Popen(
                    [sys.executable, "-P", "-m", kernels.warmup, *given],
                    stdin=subprocess.PIPE,
                    stdout=writer,
                    stderr=subprocess.DEVNULL,
                    env={**os.environ, "NUMBA_CACHE_DIR": str(kernel_cache.FOLDER)},
                    pass_fds=locks,
                )
                for given in arguments
            ]
        finally:
            for descriptor in (writer, *locks):
                os.close(descriptor)

    def wait(self, on_progress: Callable[[int, int], None]) -> str:
        """Wait until all kernels are in the cache; return why they are not, empty if they are.

        `on_progress` is called with (kernels ready, all kernels).
        """
        ready: set[str] = set()
        try:
            with self._lines:
                for line in self._lines:
                    if line.startswith(FAILED):
                        return line.removeprefix(FAILED).strip()
                    steps, name, folder = line.rstrip("\n").split(" ", 2)
                    if name not in ready:
                        ready.add(name)
                        on_progress(len(ready), int(steps))
                    # The other process may still compile a kernel that is ready: do not wait for it.
                    if len(ready) == int(steps):
                        kernel_cache.mark_complete(self._set, Path(folder))
                        return ""
        except OSError as error:
            return f"{kernel_cache.FOLDER}: {error.strerror}"
        finally:
            self.end()
        return "the process that compiles ended early"

    def end(self) -> None:
        """End them now."""
        for process in self._processes:
            process.kill()
            process.wait()
            if process.stdin is not None:
                process.stdin.close()
