"""Where a process hangs: in which line of the user's code one is that gives no sign of life."""

import contextlib
import fcntl
import os
import shutil
import signal
import tempfile
from pathlib import Path

from zteam.clock import HOST_FACTOR, monotonic, pause
from zteam.node.faults import STACK_SIGNALS, STACKS, unreturned_calls

LOOK = 1.0
"""Host seconds between two looks at what is waited for."""
_ANSWER = 1.0 * HOST_FACTOR
"""Host seconds for a process to write its stacks on a signal; a frozen one writes none."""
_WHOLE = 0.3 * HOST_FACTOR
"""Host seconds without a further line after which that is all: it writes line by line, and may have to wait between."""


class Stacks:
    """The stacks of the processes of a team, each of which writes its own (`zteam.node.faults.offer_stacks`)."""

    def __init__(self) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="zteam_stacks_"))
        self.environment = {STACKS: str(self._folder)}
        """Lets a process that gets it show where it is."""

    def close(self) -> None:
        """Remove the files."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def where(self, name: str) -> str:
        """Which call of the user's code the process `name` is in, with its line and its traceback; empty if in none."""
        return "\n".join(dict.fromkeys(unreturned_calls(self._read(name)).values()))

    def _read(self, name: str) -> str:
        """What the living process `name` writes now; empty if it has not offered that."""
        found = [path for path in self._folder.glob(f"{name}.*") if path.stem == name and _is_held(path)]
        if not found:
            return ""
        # Of two that claim the name the newer one waits.
        path = min(found, key=lambda path: path.stat().st_ctime)
        return next(filter(None, (_ask(path, name) for name in STACK_SIGNALS)), "")


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
    with contextlib.suppress(ValueError, BlockingIOError), path.open("rb") as file:
        int(path.suffix[1:])
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        return False
    return path.suffix[1:].isdigit()
