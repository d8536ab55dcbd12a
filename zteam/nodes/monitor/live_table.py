"""The monitor's live table on a terminal."""

import os
from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.text import Text

from zteam import names
from zteam.nodes.monitor.display import Contents, Line, format_table
from zteam.nodes.monitor.members import Event

_COLORS = {
    "ready": "cyan", "running": "green", "stopped": "yellow", "fault": "red", "lost": "bold red", "silent": "red",
    "boot": "white", "absent": "dim",
}  # fmt: skip
_EVENTS = {"go": "bold green", "lost": "bold red", "fault": "red", "silent": "red", "link": "yellow", "process": "red"}


class LiveTable:
    """Shows events as lines, and below them the table as it was when it was drawn last.

    It asks for the contents only while it holds no lock of Rich's: they need the node's lock, and a line that is logged
    under that one needs Rich's, because the log goes through the display.
    """

    is_live = True

    def __init__(self) -> None:
        self._console = Console(no_color="NO_COLOR" in os.environ or None)
        self._contents: Contents = lambda: ([], [])
        self._live = Live(self._render(), console=self._console, auto_refresh=False)

    def __enter__(self) -> "LiveTable":
        self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._live.update(self._render())
        self._live.stop()

    def watch(self, contents: Contents) -> None:
        """From now on these are the contents of the table."""
        self._contents = contents

    def print_table(self) -> None:
        """Draw it as it is now."""
        self._live.update(self._render(), refresh=True)

    def show(self, event: Event) -> None:
        """Print an event above the table."""
        subject = "" if event.robot is None else f"{names.robot_name(event.robot)} "
        # As Text: a robot's words are no markup. The event's style must not colour the table, which is drawn with it.
        self._console.print(Text(f"{subject}{event.text}", _EVENTS.get(event.kind, "")))

    def _render(self) -> Text:
        lines = format_table(*self._contents(), self._console.width)
        return Text("\n").join(_colored(line, bold=number == 0) for number, line in enumerate(lines))


def _colored(line: Line, *, bold: bool) -> Text:
    text = Text(line.text, "bold" if bold else "")
    if line.state:
        start = line.text.index(line.state)
        text.stylize(_COLORS.get(line.state, ""), start, start + len(line.state))
    return text
