"""How a command's process ends: Ctrl+C at any moment gives exit code 130 and no traceback; its end never crashes."""

import atexit
import contextlib
import os
import signal
import sys
import threading
from types import FrameType
from typing import NoReturn

INTERRUPTED = 130
"""Exit code of a command that Ctrl+C ended, as in shells."""


def _leave(_number: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)


def leave_at_once() -> None:
    """From here on Ctrl+C ends the process at once. Use it during the imports, before anything is open.

    KeyboardInterrupt can be lost there: Python prints an exception in a callback of the import system and goes on.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)


def raise_from_now() -> None:
    """From here on Ctrl+C raises KeyboardInterrupt again. Use it once the command has something to close."""
    if signal.getsignal(signal.SIGINT) is _leave:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def ignore_from_now() -> None:
    """From here on Ctrl+C does nothing: the command is over and keeps its exit code."""
    if signal.getsignal(signal.SIGINT) in (_leave, signal.default_int_handler):
        signal.signal(signal.SIGINT, signal.SIG_IGN)


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
