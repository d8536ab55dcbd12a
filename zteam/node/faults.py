"""How an error of a user's own code is shown: its traceback without the frames of zteam around it; and where code is
that does not return."""

import gc
import logging
import os
import signal
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from zteam.node.shutdown import Stop

log = logging.getLogger("zteam")

_OWN = str(Path(__file__).parents[1])
"""The folder of zteam."""
_PYTHON = str(Path(os.__file__).parent)
_MEMORY = "memory or threads", "'ulimit -v', 'ulimit -u', a container's"
_FILES = "open files", "'ulimit -n'"
_SHORTAGES = {
    "can't start new thread": _MEMORY,
    "can't spawn worker thread": _MEMORY,
    "failed to map segment": _MEMORY,
    "Cannot allocate memory": _MEMORY,
    "Too many open files": _FILES,
    # Zenoh's threads could not be made, for whatever reason.
    "Failed to init": ("open files, memory or threads", f"{_FILES[1]}, {_MEMORY[1]}"),
}
"""What Python, Zenoh, the dynamic loader and the system say; of what there is no more, and the limits to raise."""
ENDED = "ended by an error:"
"""What the log says before the text of an error."""
STACKS = "ZTEAM_STACKS"
"""Environment: a folder of the `team` fixture. A process that finds it there lets the fixture read where it hangs."""
STACK_SIGNALS = "SIGUSR2", "SIGUSR1"
"""Each has a process write the stacks of its threads to its file in that folder. The second one is for a process that
does not answer the first one."""


def is_own(file: str) -> bool:
    """Whether the code of this file is zteam's."""
    return file.startswith(_OWN)


@contextmanager
def reading_frames() -> Iterator[None]:
    """Within, frames of threads that run may be read.

    Before Python 3.12, an allocation can run the garbage collector at once, also while CPython reads a frame. The
    finalizers let the other threads run, and if the frame ends then, CPython reads memory that was freed.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def offer_stacks(name: str, stop: Stop) -> None:
    """On each of STACK_SIGNALS the process `name` writes its stacks to a file of its own in the folder STACKS.

    `stop` is not installed yet. The file's name ends with the process id. The process holds a lock on the file as long
    as it lives, so that its reader signals no other process.

    The first signal is answered by a thread of Python, so the frames stay as they are while it writes. The second one
    is answered also where all threads wait for one that hangs. Where they run, it may read a frame that has just ended,
    and CPython crashes.
    """
    folder = os.environ.get(STACKS)
    if not folder:
        return
    import faulthandler
    import fcntl

    path = f"{folder}/{name.replace(os.sep, chr(95))}.{os.getpid()}"
    try:
        descriptor = os.open(path, os.O_CREAT | os.O_WRONLY | os.O_APPEND, 0o600)
        first, second = (getattr(signal, name) for name in STACK_SIGNALS)
        stop.on_signal(first, lambda: faulthandler.dump_traceback(descriptor))
        faulthandler.register(second, file=descriptor, chain=False)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
    except OSError as error:
        log.debug("%s: %s", path, error)


def is_library(file: str) -> bool:
    """Whether the code of this file is Python's own library."""
    return file.startswith("<frozen") or (file.startswith(_PYTHON) and "-packages" not in file)


def unreturned_text(function: str, stack: traceback.StackSummary) -> str:
    """Of a call that has not returned: the user's line in which it is, and its traceback; the outermost frame first."""
    of_user = [frame for frame in stack if not (is_own(frame.filename) or is_library(frame.filename))]
    # What an environment has installed is not the user's, unless all of it is.
    now = ([frame for frame in of_user if not frame.filename.startswith(sys.prefix)] or of_user or stack)[-1]
    text = "".join(["Traceback (most recent call last):\n", *stack.format()]).rstrip()
    return f"{function} has not returned ({now.filename}:{now.lineno})\n{text}"


def fault_text(error: BaseException) -> str:
    """The traceback of `error` as text, cut to the user's frames; whole where there are none."""
    told = traceback.TracebackException.from_exception(error)
    links: list[traceback.TracebackException | None] = [told]
    while links:
        link = links.pop()
        if link is not None:
            mine = [frame for frame in link.stack if not is_own(frame.filename)]
            link.stack = traceback.StackSummary.from_list(mine or link.stack)
            links += link.__cause__, link.__context__
    return "".join(told.format()).rstrip()


def shortage_text(error: BaseException) -> str:
    """One line for an error that says that the system gives the process no more of something; empty for others."""
    found = ((line, short) for line in str(error).splitlines() for sign, short in _SHORTAGES.items() if sign in line)
    line, (what, limits) = next(found, ("", _MEMORY))
    if not line and not isinstance(error, MemoryError):
        return ""
    reason = f" ({line.strip()})" if line else ""
    return f"the system gives no more {what}{reason}: raise the limit ({limits})"


def log_fault(error: BaseException) -> int:
    """Log an error that ends the process; the exit code."""
    shortage, fault = shortage_text(error), f"{ENDED}\n{fault_text(error)}"
    is_users = any(not is_own(frame.filename) for frame in traceback.extract_tb(error.__traceback__))
    log.error("%s", f"{fault}\n{shortage}".rstrip() if is_users or not shortage else shortage)
    return 1
