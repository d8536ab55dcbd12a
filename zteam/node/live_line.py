"""The last lines of a terminal, rewritten in place, while other lines scroll by above them."""

import os
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack, redirect_stderr
from itertools import starmap
from typing import Any, TextIO, cast

from zteam.clock import Every
from zteam.errors import printable
from zteam.node.output import Clean, painted, print_line

_MARGIN = 3
"""Columns of the last line that stay free, for the ^C that a terminal echoes: a line that wraps could not be erased."""
PERIOD = 5.0
"""Host seconds between two lines of progress where one cannot be rewritten."""
_SIZE = os.terminal_size((80, 24))
"""Columns and lines of a terminal that does not report its own."""


def has_live_line(stream: TextIO) -> bool:
    """Whether a line of `stream` can be rewritten: on a terminal that knows how to erase."""
    return stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"


def has_color(stream: TextIO) -> bool:
    """Whether `stream` is a terminal that shows colours, and its user wants them (https://no-color.org)."""
    return has_live_line(stream) and "NO_COLOR" not in os.environ


Paint = Callable[[int, str], str]
"""What is written for a line: it gets the line's number, and the part of it for which there is room."""


class LiveLine:
    """The last lines of a terminal. In its context standard error prints above them; leaving erases them, unless it
    `keeps` them."""

    def __init__(self, stream: TextIO, *, keeps: bool = False) -> None:
        self._stream, self._keeps = stream, keeps
        # Reentrant: the report of a failed write is printed above the lines too.
        self._lock = threading.RLock()
        self._text = ""
        self._drawn: list[int] = []
        """The lengths of the lines that are on the terminal."""
        self._left = False
        self.has_color = has_color(stream)
        self._paint: Paint | None = None
        self._redirection = ExitStack()

    def __enter__(self) -> "LiveLine":
        if sys.stderr.isatty():
            above = _Above(self, sys.stderr)
            self._redirection.callback(above.end)
            self._redirection.enter_context(redirect_stderr(cast(TextIO, above)))
        return self

    def __exit__(self, *_how: object) -> None:
        self._redirection.close()
        if self._keeps and self._drawn:
            self._stream.write("\n")
        else:
            self.show("")

    def show(self, text: str, paint: Paint | None = None) -> None:
        """Show `text` from now on, as far as there is room; in bold, or with the colours of `paint`."""
        with self._lock:
            # As wide as it will be written.
            encoding = self._stream.encoding or "ascii"
            self._text, self._paint = text.encode(encoding, "backslashreplace").decode(encoding), paint
            self._write("", self._stream)

    def leave(self) -> None:
        """Erase the lines and draw no more: the terminal belongs to a debugger from now on."""
        with self._lock:
            self._left = True
            self._write("", self._stream)

    def print(self, text: str, stream: TextIO | None = None) -> None:
        """Print a line above, on `stream` if that is another one on the same terminal."""
        with self._lock:
            self._write(f"{text if isinstance(text, Clean) else printable(text)}\n", stream or self._stream)

    def _write(self, text: str, stream: TextIO) -> None:
        columns, height = self.size()
        is_ours = self._in_foreground()
        if not is_ours:
            # The shell has the terminal now.
            self._drawn = []
        shown = "" if self._left or not is_ours else self._text
        fitting = shown.split("\n")[: max(1, height - 1)] if shown else []
        room = [columns] * (len(fitting) - 1) + [max(0, columns - _MARGIN)]
        lines = [printable(line[:most]) for line, most in zip(fitting, room, strict=False)]
        # A terminal that was made narrower has wrapped them.
        rows = sum(1 + max(0, length - 1) // columns for length in self._drawn) - 1
        erase = f"\r\033[{rows}A\033[J" if rows > 0 else "\r\033[J" if self._drawn else ""
        if stream is not self._stream:
            stream.write(erase + text)
            stream.flush()
            erase = text = ""
        paint = self._paint or (lambda _number, line: painted(line, 1))
        drawn = "\n".join(starmap(paint, enumerate(lines)) if self.has_color else lines)
        if erase or text or drawn:
            self._stream.write(erase + text + drawn)
            self._stream.flush()
        self._drawn = list(map(len, lines))

    def size(self) -> os.terminal_size:
        """Columns and lines of the terminal now."""
        try:
            found = os.get_terminal_size(self._stream.fileno())
        except (OSError, ValueError):
            return _SIZE
        return found if all(found) else _SIZE

    def _in_foreground(self) -> bool:
        try:
            return os.tcgetpgrp(self._stream.fileno()) == os.getpgrp()
        except (OSError, ValueError):
            # It is not the controlling terminal, so no shell writes on it.
            return True


class ProgressLine(ExitStack):
    """How far something is, on standard error: a live line, or a line now and then."""

    def __init__(self) -> None:
        super().__init__()
        self.is_live = has_live_line(sys.stderr)
        """Whether a line is rewritten."""
        self._live = self.enter_context(LiveLine(sys.stderr)) if self.is_live else None
        self._due = Every(PERIOD)

    def say(self, text: str) -> None:
        if self._live is None:
            print_line(text, file=sys.stderr)
        else:
            self._live.print(text)

    def show(self, text: str) -> None:
        """Show `text` in place of what was shown before; where that cannot be, print it if it is time to."""
        if self._live is not None:
            self._live.show(text)
        elif self._due.due():
            self.say(text)


class _Above:
    """A stream whose whole lines are printed above a live line, as they are: also those of a debugger."""

    def __init__(self, live: LiveLine, stream: TextIO) -> None:
        self._live, self._stream, self._part = live, stream, ""

    def end(self) -> None:
        """Print the rest."""
        if self._part:
            self._live.print(Clean(self._part), self._stream)

    def __getattr__(self, name: str) -> Any:
        # Such as encoding, fileno and isatty.
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Print what is a whole line now; keep the rest."""
        lines, newline, self._part = (self._part + text).rpartition("\n")
        if newline:
            self._live.print(Clean(lines), self._stream)
        return len(text)

    def flush(self) -> None:
        """Nothing: a line is printed when it is whole."""
