"""Ctrl+C at any moment of a command ends it with 130 and without a traceback."""

import os
import signal
from types import FrameType

INTERRUPTED = 130
"""Exit code of a command that Ctrl+C ended, as shells have it."""


def _leave(_number: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)


def leave_at_once() -> None:
    """From here on Ctrl+C ends the process at once: for the imports, when nothing is open yet.

    An exception may be lost there: where it comes within a callback of the import system, Python prints it and goes on.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)


def raise_from_now() -> None:
    """From here on Ctrl+C raises KeyboardInterrupt again: for the work of a command that has something to close."""
    if signal.getsignal(signal.SIGINT) is _leave:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def ignore_from_now() -> None:
    """From here on Ctrl+C does nothing: the command is over, and its exit code stands."""
    if signal.getsignal(signal.SIGINT) in (_leave, signal.default_int_handler):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
