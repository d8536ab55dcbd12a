"""The monitor's live table on a terminal."""

import threading
from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from zteam import names
from zteam.clock import monotonic
from zteam.messages import RobotState
from zteam.nodes.monitor.members import Event, Member, printable
from zteam.nodes.monitor.start_gate import Gate
from zteam.runtime.node import Node

_COLORS = {
    "GO": "bold green", "ready": "cyan", "running": "green", "stopped": "yellow", "fault": "red", "lost": "bold red",
    "silent": "red", "boot": "white", "absent": "dim",
}  # fmt: skip


class LiveTable:
    """Shows events as lines, and below them one row a robot, refreshed four times a second."""

    def __init__(self) -> None:
        self._console = Console()
        self._gate: Gate | None = None
        self._lock: threading.Condition | None = None
        # Last: it renders at once.
        self._live = Live(console=self._console, refresh_per_second=4, get_renderable=self._render)

    def __enter__(self) -> "LiveTable":
        self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.stop()

    def watch(self, node: Node, gate: Gate) -> None:
        """Show this gate's robots."""
        self._lock, self._gate = node.changed, gate

    def show(self, event: Event) -> None:
        """Print an event above the table."""
        subject = "" if event.robot is None else f"{names.robot_name(event.robot)} "
        style = {"go": "bold green", "lost": "bold red", "fault": "red", "silent": "red", "link": "yellow"}
        # As Text: a robot's words are no markup. The event's style must not colour the table, which is drawn with it.
        self._console.print(Text(f"{subject}{event.text}", style.get(event.kind, "")))

    def _render(self) -> Table:
        table = Table(title=None, expand=False)
        for column in ("robot", "state", "status age", "epoch", "says"):
            table.add_column(column, no_wrap=column != "says")
        if self._gate is None or self._lock is None:
            return table
        with self._lock:
            rows = [_row(i, member) for i, member in sorted(self._gate.members.by_id.items())]
            table.caption = "GO" if self._gate.gone else f"waiting for {self._gate.waiting_for()}"
        for robot, state, age, epoch, text in rows:
            table.add_row(robot, Text(state, _COLORS[state]), age, epoch, Text(text))
        return table


def _row(robot_id: int, member: Member) -> tuple[str, str, str, str, str]:
    status = member.status
    state = "absent" if status is None else RobotState.TEXT[min(status.state, RobotState.FAULT)]
    if member.was_lost:
        state = "stopped" if member.stopped else "lost"
    elif member.silent:
        state = "silent"
    age = "" if status is None else f"{monotonic() - member.heard:.1f} s"
    says = printable(status.text) if status else ""
    return names.robot_name(robot_id), state, age, str(status.epoch) if status else "", says
