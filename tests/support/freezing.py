"""Processes that are stopped for a while, as a debugger or a laptop's lid does it."""

import os
import signal
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from zteam.clock import pause


def descendants_of(pid: int) -> list[int]:
    """Ids of the processes that `pid` has started, and of those that they have started."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[1]) == pid:
                found += [int(entry.name), *descendants_of(int(entry.name))]
    return found


def freeze(pids: Sequence[int], seconds: float) -> None:
    """Stop these processes for so many seconds of the host, then let them go on."""
    try:
        for pid in pids:
            os.kill(pid, signal.SIGSTOP)
        pause(seconds)
    finally:
        for pid in pids:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)
