"""What `zteam up` shows of a running team: on a terminal one live line, elsewhere a log line now and then."""

import logging
import re
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial

from zteam.cli.live_line import LiveLine, has_color, has_live_line
from zteam.cli.output import Clean, painted, print_line
from zteam.cli.progress_text import duration_text, progress_line
from zteam.clock import Every
from zteam.config.numbers import format_factor
from zteam.errors import printable
from zteam.team.launch.progress import Overview, TeamOverview

log = logging.getLogger("zteam")

_TAB = "\t"
_OWN_COLORS = re.compile(r"\033\[[0-9;]*m")
"""Of a child that colours its lines although its output is a pipe: they are left out."""
_COLORS = (36, 32, 33, 35, 34, 96, 92, 93, 95, 94)
_LIVE_PERIOD = 0.5
"""Host seconds between two looks at the team for the live line."""
_LOG_PERIOD = 2.0
"""Host seconds between two looks at the team for the log."""
_LOG_PAUSE = 10.0
"""Host seconds between two log lines on the progress of a run, at least."""


class Printer:
    """Prints the lines of all processes, each after the name of its process; coloured on a terminal."""

    def __init__(self, write: Callable[[str], None]) -> None:
        self._write = write
        self._lock = threading.Lock()
        self._color = has_color(sys.stdout)
        self._seen: dict[str, int] = {}

    def line(self, name: str, text: str) -> None:
        with self._lock:
            number = self._seen.setdefault(name, len(self._seen))
            color = _COLORS[number % len(_COLORS)]
            prefix = painted(f"[{name}]", color) if self._color else f"[{name}]"
            # The name once: a line of a log has it too. A traceback of a node in this process has many lines.
            for part in _OWN_COLORS.sub("", text).replace(f" [{name}]", "", 1).split("\n"):
                self._write(Clean(f"{prefix} {printable(part, _TAB)}"))


class RunDisplay:
    """Prints the lines of the processes and tells how the team does: on a live line below them, or without one in a
    log line on every tenth of a run with an end, but not too often. `run_for` is simulated seconds from GO."""

    def __init__(self, run_for: float | None, live: LiveLine | None = None) -> None:
        self._run_for, self._live = run_for, live
        self.line = Printer(self.print).line
        self._tenth = 0
        self._pause = Every(_LOG_PAUSE)
        self._pause.due()

    def print(self, line: str) -> None:
        (print_line if self._live is None else self._live.print)(line)

    def say(self, text: str) -> None:
        """Show what the launcher does, on a live line alone."""
        if self._live is not None:
            self._live.show(lambda columns: text[:columns])

    def following(self, watch: Callable[[], TeamOverview]) -> AbstractContextManager[None]:
        """Tell about the team in this context."""
        if self._live is not None:
            return _looking(watch(), partial(self._show, self._live), _LIVE_PERIOD)
        return nullcontext() if self._run_for is None else _looking(watch(), self._tell, _LOG_PERIOD)

    def leave_terminal(self) -> None:
        """From now on only print lines: a debugger has the terminal."""
        if self._live is not None:
            self._live.leave()

    def _show(self, live: LiveLine, seen: Overview) -> None:
        live.show(lambda columns: progress_line(seen, self._run_for, columns))

    def _tell(self, seen: Overview) -> None:
        simulator, elapsed = seen.simulator, seen.elapsed
        if simulator is None or elapsed is None or self._run_for is None:
            return
        tenth = min(9, int(10.0 * elapsed / self._run_for))
        if tenth > self._tenth and self._pause.due():
            self._tenth = tenth
            factor = simulator.real_time_factor
            left = f", {duration_text((self._run_for - elapsed) / factor)} left" if factor > 0.0 else ""
            pace = f"{format_factor(factor)} x real time{left}"
            log.info("%d %% of %g simulated seconds, %s", 10 * tenth, self._run_for, pace)


@contextmanager
def open_display(log_format: str, run_for: float | None) -> Iterator[RunDisplay]:
    if log_format == "text" and has_live_line(sys.stdout):
        with LiveLine(sys.stdout) as line:
            yield RunDisplay(run_for, line)
    else:
        yield RunDisplay(run_for)


@contextmanager
def _looking(watch: TeamOverview, show: Callable[[Overview], None], period: float) -> Iterator[None]:
    """Pass a look at the team to `show` every `period` host seconds, on a thread of its own."""
    closed, lock = threading.Event(), threading.Lock()

    def look() -> None:
        while not closed.is_set():
            seen = watch.look()
            with lock:
                if not closed.is_set():
                    show(seen)
            closed.wait(period)

    threading.Thread(target=look, name="progress", daemon=True).start()
    try:
        yield
    finally:
        with lock:
            closed.set()
