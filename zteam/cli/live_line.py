"""The last line of a terminal, rewritten in place, while other lines scroll by above it."""

import os
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack, redirect_stderr
from typing import Any, TextIO, cast

from zteam.cli.output import Clean, print_line
from zteam.clock import Every
from zteam.errors import printable

_MARGIN = 3
"""Columns that stay free, for the ^C that a terminal echoes: a line that wraps could not be erased."""
PERIOD = 5.0
"""Host seconds between two lines of progress where one cannot be rewritten."""
_COLUMNS = 80
"""Width of a terminal that does not tell its own."""


def has_live_line(stream: TextIO) -> bool:
    """Whether a line of `stream` can be rewritten: on a terminal that knows how to erase."""
    return stream.isatty() and os.environ.get("TERM", "dumb") != "dumb"


def has_color(stream: TextIO) -> bool:
    """Whether `stream` is a terminal that shows colours, and its user wants them (https://no-color.org)."""
    return has_live_line(stream) and "NO_COLOR" not in os.environ


class LiveLine:
    """The live line of a terminal. In its context standard error prints above it; leaving erases it."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        # Reentrant: the report of a failed write is printed above the line too.
        self._lock = threading.RLock()
        self._render: Callable[[int], str] = lambda columns: ""
        self._drawn = 0
        self._left = False
        self._bold = ("\033[1m", "\033[0m") if has_color(stream) else ("", "")
        self._redirection = ExitStack()

    def __enter__(self) -> "LiveLine":
        if sys.stderr.isatty():
            above = _Above(self, sys.stderr)
            self._redirection.callback(above.end)
            self._redirection.enter_context(redirect_stderr(cast(TextIO, above)))
        return self

    def __exit__(self, *_how: object) -> None:
        self._redirection.close()
        self.show(lambda columns: "")

    def show(self, render: Callable[[int], str]) -> None:
        """Show what `render(columns)` returns, from now on and after every resize of the terminal."""
        with self._lock:
            self._render = render
            self._write("", self._stream)

    def leave(self) -> None:
        """Erase the line and draw it no more: the terminal belongs to a debugger from now on."""
        with self._lock:
            self._left = True
            self._write("", self._stream)

    def print(self, text: str, stream: TextIO | None = None) -> None:
        """Print a line above, on `stream` if that is another one on the same terminal."""
        with self._lock:
            self._write(f"{text if isinstance(text, Clean) else printable(text)}\n", stream or self._stream)

    def _write(self, text: str, stream: TextIO) -> None:
        columns = self._columns()
        is_ours = self._in_foreground()
        if not is_ours:
            # The shell has the line now.
            self._drawn = 0
        if not is_ours or (self._left and not self._drawn):
            if text:
                stream.write(text)
                stream.flush()
            return
        line = "" if self._left else printable(self._render(columns - _MARGIN))
        # A terminal that was made narrower has wrapped the line.
        rows = max(0, self._drawn - 1) // columns
        erase = f"\r\033[{rows}A\033[J" if rows else "\r\033[J" if self._drawn else ""
        shown = f"{self._bold[0]}{line}{self._bold[1]}" if line else ""
        if stream is not self._stream:
            stream.write(erase + text)
            stream.flush()
            erase = text = ""
        self._stream.write(erase + text + shown)
        self._stream.flush()
        self._drawn = len(line)

    def _columns(self) -> int:
        try:
            return os.get_terminal_size(self._stream.fileno()).columns or _COLUMNS
        except (OSError, ValueError):
            return _COLUMNS

    def _in_foreground(self) -> bool:
        try:
            return os.tcgetpgrp(self._stream.fileno()) == os.getpgrp()
        except (OSError, ValueError):
            # It is not the controlling terminal, so no shell writes on it.
            return True


class ProgressLine:
    """How far something is, on standard error: a live line, or a line now and then. A context manager."""

    def __init__(self) -> None:
        self._live = LiveLine(sys.stderr) if has_live_line(sys.stderr) else None
        self.is_live = self._live is not None
        """Whether a line is rewritten."""
        self._due = Every(PERIOD)

    def __enter__(self) -> "ProgressLine":
        if self._live is not None:
            self._live.__enter__()
        return self

    def __exit__(self, *how: Any) -> None:
        if self._live is not None:
            self._live.__exit__(*how)

    def say(self, text: str) -> None:
        if self._live is None:
            print_line(text, file=sys.stderr)
        else:
            self._live.print(text)

    def show(self, text: str) -> None:
        """Show `text` in place of what was shown before; where that cannot be, print it if it is time to."""
        if self._live is not None:
            self._live.show(lambda columns: text[:columns])
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
