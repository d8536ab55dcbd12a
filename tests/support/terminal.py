"""Commands on a terminal: how they get it, and what a reader sees of the characters that they write."""

import codecs
import fcntl
import os
import pty
import struct
import subprocess
import sys
import termios
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

import pyte

from support.limits import LIMIT

CONTROLLED = "import fcntl, os, sys, termios\nfcntl.ioctl(0, termios.TIOCSCTTY, 0)\nos.execv(sys.argv[1], sys.argv[1:])"
"""Makes standard input the controlling terminal, as in a shell, and runs the command in this process."""


ROWS = 30


class Screen:
    """A terminal of 30 rows of `columns` characters, and the rows that have scrolled away."""

    def __init__(self, columns: int) -> None:
        self._screen = pyte.HistoryScreen(columns, ROWS, history=10_000)
        self._stream = pyte.Stream(self._screen)

    def feed(self, text: str) -> "Screen":
        """Take what a program wrote."""
        self._stream.feed(text)
        return self

    def resize(self, columns: int) -> None:
        """Change the width. Lines flow anew, as on most terminals; the cursor is behind the last line."""
        # A full row is taken for one that goes on in the next.
        full = self._screen.columns
        text = "".join(row if len(row) == full else f"{row}\r\n" for row in self.rows)
        self.__init__(columns)  # type: ignore[misc]
        self.feed(text.removesuffix("\r\n"))

    @property
    def rows(self) -> list[str]:
        """The rows down to the cursor or the last text, as a reader sees them."""
        screen = self._screen
        lines = [*screen.history.top, *(screen.buffer[y] for y in range(ROWS))]
        rows = ["".join(line[x].data for x in range(screen.columns)).rstrip() for line in lines]
        while len(rows) > len(screen.history.top) + screen.cursor.y + 1 and not rows[-1]:
            rows.pop()
        return rows


class TerminalCommand:
    """A command on a terminal of 100 columns, and the screens that it shows."""

    def __init__(self, command: Sequence[str], environment: Mapping[str, str]) -> None:
        self._master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", ROWS, 100, 0, 0))
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
        self._decoder = codecs.getincrementaldecoder("utf-8")("replace")
        """What is read at once may end within a character."""
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
            data = os.read(self._master, 65536)
        except OSError:
            # Linux raises EIO at the end of a terminal's output.
            return False
        part = self._decoder.decode(data)
        self.text += part
        self.screen.feed(part)
        return bool(data)

    def press(self, keys: bytes) -> None:
        """Type on the terminal."""
        os.write(self._master, keys)

    def end(self) -> tuple[int, list[str]]:
        """The exit code, and the last screen."""
        while self._read():
            continue
        return self.process.wait(LIMIT), self.screen.rows

    def hang_up(self) -> int:
        """Close the terminal, as a user closes a window; the exit code."""
        os.close(self._master)
        self._master = os.open(os.devnull, os.O_RDWR)
        return self.process.wait(LIMIT)

    def close(self) -> None:
        """End the command if it still runs."""
        with suppress(ProcessLookupError):
            self.process.kill()
        self.process.wait()
        os.close(self._master)
