"""What `zteam goals` shows: on a terminal a table of the robots, elsewhere a line for each goal that has ended."""

import math
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

import msgspec

from zteam.cli.goal_progress import goal_facts, result_text, seconds_of, state_text
from zteam.cli.live_line import has_live_line
from zteam.cli.tables import format_table
from zteam.clock import monotonic
from zteam.nodes.goals.node import Dispatcher, Ended, Errand
from zteam.services.navigation import goal_text

if TYPE_CHECKING:
    from rich.live import Live

_PERIOD = 0.5
"""Host seconds between two looks."""
_PATIENCE = 3.0
"""Host seconds after which it says what a robot waits for."""
_HEAD = ("robot", "state", "left", "time", "recoveries", "reached", "failed", "goal")


@contextmanager
def open_display(dispatcher: Dispatcher, *, as_json: bool) -> Iterator[None]:
    """Show within this context how the robots do, on a thread of its own, and at the end the sums."""
    closed = threading.Event()
    with ExitStack() as ends:
        live = None if as_json or not has_live_line(sys.stdout) else ends.enter_context(_live())
        display = _Display(dispatcher, live, as_json)

        def look() -> None:
            while not closed.wait(_PERIOD):
                display.show()

        thread = threading.Thread(target=look, name="display", daemon=True)
        thread.start()
        try:
            yield
        finally:
            closed.set()
            thread.join()
            display.show()
    if not as_json:
        print(table(dispatcher), flush=True)


def _live() -> "Live":
    from rich.live import Live

    return Live(auto_refresh=False, transient=True)


class _Display:
    def __init__(self, dispatcher: Dispatcher, live: "Live | None", as_json: bool) -> None:
        self._dispatcher, self._live, self._as_json = dispatcher, live, as_json
        self._since = monotonic()
        self._told: dict[int, str] = {}
        """What each robot waits for, as it was told."""

    def show(self) -> None:
        """Show what is new."""
        for ended in self._dispatcher.take_ended():
            self._print(ended)
        for robot_id, errand in self._dispatcher.errands.items():
            waits = errand.client.waits_for
            if waits and waits != self._told.get(robot_id) and monotonic() - self._since > _PATIENCE:
                self._told[robot_id] = waits
                print(f"{errand.client.name}: waiting for {waits}", file=sys.stderr, flush=True)
        if self._live is not None:
            from rich.text import Text

            self._live.update(Text(table(self._dispatcher)), refresh=True)

    def _print(self, ended: Ended) -> None:
        client = self._dispatcher.errands[ended.robot].client
        if self._as_json:
            told = {**goal_facts(client, ended.watch, ended.seconds), "line": ended.goal.line}
            print(msgspec.json.encode(told).decode(), flush=True)
        else:
            print(f"{result_text(client, ended.watch, ended.seconds)} (line {ended.goal.line})", flush=True)


def table(dispatcher: Dispatcher) -> str:
    """One row a robot: what it does, and how many goals it has reached."""
    return format_table(_HEAD, [_row(errand) for errand in dispatcher.errands.values()])


def _row(errand: Errand) -> tuple[str, ...]:
    sums = (str(errand.reached), str(errand.failed))
    watch = errand.watch
    if watch is None:
        return errand.client.name, "no goal", "", "", "", *sums, ""
    status = watch.status
    left, time, recoveries = "", "", ""
    if status is not None:
        left = f"{status.distance_remaining:.1f} m" if math.isfinite(status.distance_remaining) else ""
        seconds = seconds_of(status.estimated_time_remaining)
        time = f"{seconds:.0f} s" if seconds > 0.0 else ""
        recoveries = str(status.recoveries)
    return errand.client.name, state_text(errand.client, watch), left, time, recoveries, *sums, goal_text(watch.goal)
