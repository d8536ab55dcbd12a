"""Ctrl+C at any moment ends a command with exit code 130 and no traceback."""

import os
import signal
from functools import partial
from types import FrameType
from typing import Any

INTERRUPTED = 130
"""Exit code of a command that Ctrl+C ended, as in shells."""


def _leave(_number: int, _frame: FrameType | None) -> None:
    os._exit(INTERRUPTED)


def _on_interrupt(handler: Any) -> None:
    """Set what Ctrl+C does, unless it is ignored or has a handler of someone else."""
    before = signal.getsignal(signal.SIGINT)
    if before in (_leave, signal.default_int_handler) and before is not handler:
        signal.signal(signal.SIGINT, handler)


leave_at_once = partial(_on_interrupt, _leave)
"""From here on Ctrl+C ends the process at once. Use it during the imports, before anything is open.

KeyboardInterrupt can be lost there: Python prints an exception in a callback of the import system and goes on.
"""
raise_from_now = partial(_on_interrupt, signal.default_int_handler)
"""From here on Ctrl+C raises KeyboardInterrupt again. Use it once the command has something to close."""
ignore_from_now = partial(_on_interrupt, signal.SIG_IGN)
"""From here on Ctrl+C does nothing: the command is over and keeps its exit code."""
