"""What `ps` and `top` call a command's process, and how it ends without a crash."""

import atexit
import contextlib
import os
import sys
import threading
from pathlib import Path
from typing import NoReturn


def show_name(command: str) -> None:
    """Show this process under the name of its command, as if that were a program: `python -m` would hide it.

    Linux keeps 15 characters. On other systems nothing changes.
    """
    with contextlib.suppress(OSError):
        Path("/proc/self/comm").write_text(command)


def leave(code: int) -> NoReturn:
    """End the process with this exit code: what a normal exit does, without taking the interpreter apart.

    A thread of Zenoh's that calls into an interpreter that is being taken apart is ended inside of foreign code, which
    aborts the process: after a good run it would have the exit code -6.
    """
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        # Closed when the process started, or its reader is gone: the command has said so.
        with contextlib.suppress(AttributeError, OSError, ValueError):
            stream.flush()
    os._exit(code)
