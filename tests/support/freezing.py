"""Processes that are stopped for a while, as a debugger or a laptop's lid does it."""

import os
import signal
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from support.limits import LIMIT
from zteam.clock import monotonic, pause


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


def wait_until_frozen(pid: int) -> None:
    """Wait until no thread of a process that was stopped runs: on a crowded machine the signal takes its time."""
    deadline = monotonic() + LIMIT
    threads = Path(f"/proc/{pid}/task")
    while {(thread / "stat").read_text().rpartition(")")[2].split()[0] for thread in threads.iterdir()} != {"T"}:
        assert monotonic() < deadline, f"process {pid} was stopped and still runs"
        pause(0.001)
