"""Shows errors of a user's own code by a traceback without zteam's frames, and finds code that does not return."""

import contextlib
import faulthandler
import os
import re
import signal
import sys
import traceback
from itertools import takewhile
from pathlib import Path
from traceback import FrameSummary, StackSummary

from zteam.clock import HOST_FACTOR, monotonic, pause
from zteam.errors import log
from zteam.node.launcher import report
from zteam.node.shutdown import Stop

_OWN = str(Path(__file__).parents[1])
"""The folder of zteam."""
_PYTHON = str(Path(os.__file__).parent)
_SHORTAGES = (
    "can't start new thread",
    "can't spawn worker thread",
    "failed to map segment",
    "Cannot allocate memory",
    "Too many open files",
    # Zenoh's threads could not be made, for whatever reason.
    "Failed to init",
)
"""What Python, Zenoh, the dynamic loader and the system say where there is no more memory, thread or descriptor."""
STACKS = "ZTEAM_STACKS"
"""Environment: a folder of the `team` fixture. A process that finds it there lets the fixture read where it hangs."""
_STACK_SIGNALS = "SIGUSR2", "SIGUSR1"
"""Each has a process write the stacks of its threads to its file in that folder. The second one is for a process that
does not answer the first one."""
_ANSWER = 1.0 * HOST_FACTOR
"""Host seconds for a process to write its stacks on a signal; a frozen one writes none."""
_WHOLE = 0.3 * HOST_FACTOR
"""Host seconds without a further line after which that is all: it writes line by line, and may have to wait between."""
_THREAD = re.compile(r"^(?:Current thread|Thread) 0x([0-9a-f]+).*$", re.MULTILINE)
_FRAME = re.compile(r'^  (?:File "(.*)", line (\d+) in (.*)|\.\.\.)$', re.MULTILINE)
"""As `faulthandler` writes them. Three dots follow the frames of a long stack."""
_DEBUGGERS = ("bdb.", "pydevd", "_pydevd")
"""Files of pdb, and of the debuggers of VS Code and PyCharm."""


def is_own(file: str) -> bool:
    """Whether the code of this file is zteam's."""
    return file.startswith(_OWN)


def offer_stacks(name: str, stop: Stop) -> None:
    """On each of _STACK_SIGNALS the process `name` writes its stacks to a file of its own in the folder STACKS.

    `stop` is not installed yet. The file's name ends with the process id. The process holds a lock on the file as long
    as it lives, so that its reader signals no other process.

    A thread of Python answers the first signal, and no frame changes while it writes. The second one is answered even
    where all threads wait for one that hangs. Where they run, it may read a frame that has just ended, and CPython
    crashes.
    """
    folder = os.environ.get(STACKS)
    if not folder:
        return
    import fcntl

    path = f"{folder}/{name.replace(os.sep, chr(95))}.{os.getpid()}"
    try:
        descriptor = os.open(path, os.O_CREAT | os.O_WRONLY | os.O_APPEND, 0o600)
        first, second = (getattr(signal, name) for name in _STACK_SIGNALS)
        stop.on_signal(first, lambda: faulthandler.dump_traceback(descriptor))
        faulthandler.register(second, file=descriptor, chain=False)
        fcntl.flock(descriptor, fcntl.LOCK_EX)
    except OSError as error:
        log.debug("%s: %s", path, error)


def where_it_is(folder: str, name: str) -> str:
    """The call of the user's code that the process `name` is in, with its line and traceback. Empty without one, or if
    no process of this name offers its stacks in `folder`."""
    found = [path for path in Path(folder).glob(f"{name}.*") if path.stem == name and _is_held(path)]
    if not found:
        return ""
    # Of two that claim the name the newer one waits.
    path = min(found, key=lambda path: path.stat().st_ctime)
    dump = next(filter(None, (_ask(path, name) for name in _STACK_SIGNALS)), "")
    return "\n".join(dict.fromkeys(unreturned_calls(dump).values()))


def _ask(path: Path, name: str) -> str:
    """What the process that holds `path` writes on the signal; empty if it does not answer."""
    before = seen = path.stat().st_size
    with contextlib.suppress(ProcessLookupError):
        os.kill(int(path.suffix[1:]), getattr(signal, name))
    grown = monotonic()
    end = grown + _ANSWER
    while monotonic() < end:
        pause(0.05)
        size = path.stat().st_size
        if size != seen:
            seen, grown = size, monotonic()
        elif size > before and monotonic() - grown > _WHOLE:
            break
    with path.open("rb") as file:
        file.seek(before)
        return file.read().decode(errors="replace")


def _is_held(path: Path) -> bool:
    """Whether the process that made the file lives: it holds a lock on it."""
    import fcntl

    with contextlib.suppress(ValueError, BlockingIOError), path.open("rb") as file:
        int(path.suffix[1:])
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return False
    return path.suffix[1:].isdigit()


def is_library(file: str) -> bool:
    """Whether the code of this file is Python's own library."""
    return file.startswith("<frozen") or (file.startswith(_PYTHON) and "-packages" not in file)


def dump_stacks() -> str:
    """What `faulthandler` writes of the threads of this process, up to 100."""
    import tempfile

    with tempfile.TemporaryFile() as file:
        faulthandler.dump_traceback(file)
        file.seek(0)
        return file.read().decode(errors="replace")


def stacks_in(dump: str) -> dict[int, StackSummary]:
    """The stacks in what `faulthandler` wrote, by thread; the outermost frame first."""
    _, *parts = _THREAD.split(dump)
    found = {}
    for thread, frames in zip(parts[::2], parts[1::2], strict=True):
        # What is left out of a long stack ends in zteam, which calls all code of users.
        stack = [FrameSummary(_path(file) or _OWN, int(line or 0), name) for file, line, name in _FRAME.findall(frames)]
        found[int(thread, 16)] = StackSummary.from_list(stack[::-1])
    return found


def unreturned_calls(dump: str) -> dict[int, str]:
    """By thread in what `faulthandler` wrote: the call of a user's code by zteam, with its line and its traceback.
    Threads in a debugger are left out."""
    found = {}
    for thread, stack in stacks_in(dump).items():
        # From the call that waits in zteam or in a library to the user's line, then up to what zteam has called.
        frames = stack[::-1]
        while frames and (is_own(frames[0].filename) or is_library(frames[0].filename)):
            frames.pop(0)
        call = [*takewhile(lambda frame: not is_own(frame.filename), frames)][::-1]
        is_debugged = any(Path(frame.filename).name.startswith(_DEBUGGERS) for frame in stack)
        if call and len(call) < len(frames) and not is_library(call[0].filename) and not is_debugged:
            stack = StackSummary.from_list(call)
            text = "".join(["Traceback (most recent call last):\n", *stack.format()]).rstrip()
            found[thread] = f"{call[0].name} has not returned ({place_in(stack)})\n{text}"
    return found


def _path(written: str) -> str:
    """A path whose characters beyond ASCII are written as in Python."""
    return re.sub(r"\\x..|\\u.{4}|\\U.{8}", lambda found: chr(int(found[0][2:], 16)), written)


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


def place_in(stack: StackSummary) -> str:
    """`file:line` of the innermost line in `stack` that is the user's own; empty without one."""
    others = [frame for frame in stack if not (is_own(frame.filename) or is_library(frame.filename))]
    # What an environment has installed is not the user's, unless all of it is.
    mine = [frame for frame in others if not frame.filename.startswith(sys.prefix)] or others
    return f"{mine[-1].filename}:{mine[-1].lineno}" if mine else ""


def shortage_text(error: BaseException) -> str:
    """One line for an error that says that the system gives the process no more of something; empty for others."""
    line = next((line for line in str(error).splitlines() if any(sign in line for sign in _SHORTAGES)), "")
    if not line and not isinstance(error, MemoryError):
        return ""
    reason = f" ({line.strip()})" if line else ""
    limits = "'ulimit -v', 'ulimit -u', 'ulimit -n', a container's"
    return f"the system gives no more memory, threads or open files{reason}: raise the limit ({limits})"


def log_fault(error: BaseException) -> int:
    """Log an error that ends the process as critical, and report it to the launcher; the exit code."""
    text = user_fault(error)
    log.critical("ended by an error:\n%s", text) if text else log.error("%s", shortage_text(error))
    report(fault=text)
    return 1


def user_fault(error: BaseException) -> str:
    """The text of an error that ended a node; empty for a shortage outside of the user's code."""
    shortage = shortage_text(error)
    is_users = any(not is_own(frame.filename) for frame in traceback.extract_tb(error.__traceback__))
    text = f"{fault_text(error)}\n{shortage}".rstrip() if is_users or not shortage else ""
    # JSON has no lone surrogates, which the names of files may have.
    return text.encode(errors="backslashreplace").decode()
