"""What `zteam up` shows of a running team: on a terminal one live line, elsewhere a log line now and then."""

import re
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from zteam.cli.tables import duration_text
from zteam.config.numbers import counted, format_factor
from zteam.errors import log, printable
from zteam.node.live_line import LiveLine, has_color, has_live_line
from zteam.node.output import Clean, painted, print_line
from zteam.team.launch.progress import Overview, TeamOverview

_TAB = "\t"
_OWN_COLORS = re.compile(r"\033\[[0-9;]*m")
"""Of a child that colours its lines although its output is a pipe: they are left out."""
_COLORS = (36, 32, 33, 35, 34, 96, 92, 93, 95, 94)
_LIVE_PERIOD = 0.5
"""Host seconds between two looks at the team for the live line."""
_LOG_PERIOD = 10.0
"""Host seconds between two looks at the team for the log."""


def progress_line(seen: Overview, run_for: float | None) -> str:
    """What a team does; `run_for`, if given, is its end in simulated seconds from GO."""
    return ", ".join(_after_go(seen, run_for) if seen.begun else _before_go(seen))


def _before_go(seen: Overview) -> Iterator[str]:
    team = seen.team
    if team is None:
        yield "starting"
        return
    yield f"before GO: {len(team.ready)} of {counted(seen.robots, 'robot')} ready"
    if seen.simulator is not None and seen.simulator.paused:
        yield "paused"
    if team.waiting_for:
        yield f"waiting for {team.waiting_for}"


def _after_go(seen: Overview, run_for: float | None) -> Iterator[str]:
    simulator, elapsed = seen.simulator, seen.elapsed
    if simulator is not None and elapsed is not None:
        shown = f"{elapsed:.1f}" if elapsed < 1000.0 else f"{elapsed:.0f}"
        yield f"{shown} s simulated" if run_for is None else f"{shown} of {run_for:g} s"
        if simulator.finished:
            yield "finished"
        elif simulator.paused:
            yield "paused"
        elif seen.held_by:
            yield f"held by {seen.held_by}"
        else:
            factor = simulator.real_time_factor
            yield f"{format_factor(factor)} x real time"
            if run_for is not None and factor > 0.0:
                yield f"{duration_text(max(0.0, run_for - elapsed) / factor)} left"
    elif seen.is_simulated:
        yield "the simulator does not answer"
    yield f"{seen.driving} of {counted(seen.robots, 'robot')} driving"


def bar(share: float) -> str:
    filled = int(min(1.0, share) * 11)
    return f"[{'#' * filled}{'-' * (11 - filled)}]"


class RunDisplay:
    """Prints the lines of the processes, and reports how the team does: on a live line below them, or without one, of a
    run with an end, in a log line now and then. `run_for` is simulated seconds from GO."""

    def __init__(self, run_for: float | None, live: LiveLine | None = None) -> None:
        self._run_for, self._live = run_for, live
        self._lock = threading.Lock()
        self._has_color = has_color(sys.stdout)
        self._seen: dict[str, int] = {}
        """The processes, in the order of their first lines."""

    def line(self, name: str, text: str) -> None:
        """Print what a process has printed, after its name; coloured on a terminal."""
        with self._lock:
            number = self._seen.setdefault(name, len(self._seen))
            prefix = painted(f"[{name}]", _COLORS[number % len(_COLORS)]) if self._has_color else f"[{name}]"
            # The name once: a line of a log has it too. A traceback of a node in this process has many lines.
            for part in _OWN_COLORS.sub("", text).replace(f" [{name}]", "", 1).split("\n"):
                self.print(Clean(f"{prefix} {printable(part, _TAB)}"))

    def print(self, line: str) -> None:
        (print_line if self._live is None else self._live.print)(line)

    def say(self, text: str) -> None:
        """Show what the launcher does, on a live line alone."""
        if self._live is not None:
            self._live.show(text)

    @contextmanager
    def following(self, watch: Callable[[], TeamOverview]) -> Iterator[None]:
        """In this context look at the team now and then, on a thread of its own."""
        if self._live is None and self._run_for is None:
            yield
            return
        team, closed, lock = watch(), threading.Event(), threading.Lock()
        period = _LOG_PERIOD if self._live is None else _LIVE_PERIOD

        def look() -> None:
            while not closed.wait(period):
                seen = team.look()
                with lock:
                    if not closed.is_set():
                        self._show(seen)

        threading.Thread(target=look, name="progress", daemon=True).start()
        try:
            yield
        finally:
            with lock:
                closed.set()

    def leave_terminal(self) -> None:
        """From now on only print lines: a debugger has the terminal."""
        if self._live is not None:
            self._live.leave()

    def _show(self, seen: Overview) -> None:
        text = progress_line(seen, self._run_for)
        if self._live is None:
            log.info("%s", text)
        elif self._run_for and seen.elapsed is not None:
            self._live.show(f"{bar(seen.elapsed / self._run_for)} {text}")
        else:
            self._live.show(text)


@contextmanager
def open_display(log_format: str, run_for: float | None) -> Iterator[RunDisplay]:
    if log_format == "text" and has_live_line(sys.stdout):
        with LiveLine(sys.stdout) as line:
            yield RunDisplay(run_for, line)
    else:
        yield RunDisplay(run_for)
