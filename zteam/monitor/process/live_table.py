"""The monitor's live table on a terminal."""

import os
from collections.abc import Sequence

from rich.console import Console
from rich.live import Live
from rich.text import Text

from zteam.monitor.process.members import Event
from zteam.monitor.process.table import Lines, Row, TableLine, format_table

_COLORS = {
    "ready": "cyan", "running": "green", "stopped": "yellow", "fault": "red", "lost": "bold red", "silent": "red",
    "boot": "white", "absent": "dim",
}  # fmt: skip
_EVENTS = {"go": "bold green", "lost": "bold red", "fault": "red", "silent": "red", "link": "yellow", "process": "red"}


class LiveTable(Lines):
    """Shows events as lines, and below them the table as it was when it was drawn last."""

    is_live = True

    def __init__(self) -> None:
        self._console = Console(no_color="NO_COLOR" in os.environ or None)
        self.live = Live(Text(), console=self._console, auto_refresh=False)
        """It shows nothing outside of this context."""

    def print_table(self, rows: Sequence[Row], notes: Sequence[str]) -> None:
        lines = enumerate(format_table(rows, notes, self._console.width))
        table = Text("\n").join(_colored(line, bold=number == 0) for number, line in lines)
        self.live.update(table, refresh=True)

    def show(self, event: Event) -> None:
        # As Text: a robot's words are no markup. The event's style must not colour the table, which is drawn with it.
        self._console.print(Text(event.sentence, _EVENTS.get(event.kind, "")))


def _colored(line: TableLine, *, bold: bool) -> Text:
    text = Text(line.text, "bold" if bold else "")
    if line.state:
        text.stylize(_COLORS.get(line.state, ""), line.column, line.column + len(line.state))
    return text
