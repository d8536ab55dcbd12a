"""Commands on a terminal: how they get it, and what a reader sees of the characters that they write."""

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

CONTROLLED = "import fcntl, os, sys, termios\nfcntl.ioctl(0, termios.TIOCSCTTY, 0)\nos.execv(sys.argv[1], sys.argv[1:])"
"""Makes standard input the controlling terminal, as in a shell, and runs the command in this process."""

_LIMIT = 60.0
"""Seconds for a command to end: many times what a crowded machine needs."""
_MODE = re.compile(r"\x1b\[\?\d+[hl]")
"""Turns a mode of the terminal on or off, which no reader sees."""
_TOKEN = re.compile(r"\x1b\[(\d*)([A-Za-z])|(\r|\n)|([^\x1b\r\n]+)")


class Screen:
    """Rows of `columns` characters that scroll up without an end; knows the few controls that a live line needs."""

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self._rows: list[list[str]] = [[]]
        self._wrapped: set[int] = set()
        self._row = self._column = 0

    def feed(self, text: str) -> "Screen":
        """Take what a program wrote."""
        text, end = _MODE.sub("", text), 0
        for found in _TOKEN.finditer(text):
            assert found.start() == end, f"unknown control in {text[end : end + 20]!r}"
            end = found.end()
            number, letter, control, plain = found.groups()
            if letter:
                self._control(int(number or "1"), letter)
            elif control == "\r":
                self._column = 0
            elif control == "\n":
                self._down(wrapped=False)
            else:
                self._write(plain)
        assert end == len(text), f"unknown control in {text[end:]!r}"
        return self

    def _control(self, number: int, letter: str) -> None:
        if letter == "A":
            self._row = max(0, self._row - number)
        elif letter == "J":
            del self._rows[self._row][self._column :]
            del self._rows[self._row + 1 :]
            self._wrapped = {row for row in self._wrapped if row <= self._row}
        else:
            assert letter == "m", f"unknown control {letter!r}"

    def _down(self, *, wrapped: bool) -> None:
        self._row += 1
        if self._row == len(self._rows):
            self._rows.append([])
        if wrapped:
            self._wrapped.add(self._row)
            self._column = 0

    def _write(self, plain: str) -> None:
        for character in plain:
            if self._column == self.columns:
                self._down(wrapped=True)
            row = self._rows[self._row]
            row += " " * (self._column + 1 - len(row))
            row[self._column] = character
            self._column += 1

    def resize(self, columns: int) -> None:
        """Change the width. Lines flow anew, as on most terminals; the cursor is behind the last line."""
        lines: list[str] = []
        for i, row in enumerate(self._rows):
            text = "".join(row)
            if i in self._wrapped:
                lines[-1] += text
            else:
                lines.append(text)
        self.__init__(columns)  # type: ignore[misc]
        self._write(lines[0])
        for line in lines[1:]:
            self.feed("\r\n")
            self._write(line)

    @property
    def rows(self) -> list[str]:
        """The rows as a reader sees them."""
        return ["".join(row).rstrip() for row in self._rows]


class TerminalCommand:
    """A command on a terminal of 100 columns, and the screens that it shows."""

    def __init__(self, command: Sequence[str], environment: Mapping[str, str]) -> None:
        self._master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
        self.mode = self.read_mode()
        """That of the terminal before the command has changed it."""
        kept = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "ZTEAM_LOG_FORMAT")}
        self.process = subprocess.Popen(
            [sys.executable, "-c", CONTROLLED, *command],
            stdin=slave, stdout=slave, stderr=slave, env={**kept, "TERM": "xterm", **environment},
            start_new_session=True,
        )  # fmt: skip
        os.close(slave)
        self.text = ""
        self.screen = Screen(100)

    def read_mode(self) -> list[object]:
        """The mode of the terminal: echo, lines or single keys, special characters."""
        return termios.tcgetattr(self._master)

    def wait_for(self, condition: Callable[[list[str]], bool]) -> list[str]:
        """The first screen with this condition; it must come before the command ends."""
        while not condition(self.screen.rows):
            assert self._read(), "\n".join(self.screen.rows)
        return self.screen.rows

    def _read(self) -> bool:
        try:
            part = os.read(self._master, 65536).decode(errors="replace")
        except OSError:
            # Linux raises EIO at the end of a terminal's output.
            return False
        self.text += part
        self.screen.feed(part)
        return bool(part)

    def press(self, keys: bytes) -> None:
        """Type on the terminal."""
        os.write(self._master, keys)

    def end(self) -> tuple[int, list[str]]:
        """The exit code, and the last screen."""
        while self._read():
            continue
        return self.process.wait(_LIMIT), self.screen.rows

    def hang_up(self) -> int:
        """Close the terminal, as a user closes a window; the exit code."""
        os.close(self._master)
        self._master = os.open(os.devnull, os.O_RDWR)
        return self.process.wait(_LIMIT)

    def close(self) -> None:
        """End the command if it still runs."""
        with suppress(ProcessLookupError):
            self.process.kill()
        self.process.wait()
        os.close(self._master)
