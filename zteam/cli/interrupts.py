"""Ctrl+C at any moment ends a command with exit code 130 and no traceback."""

import os
import signal
from types import FrameType

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
