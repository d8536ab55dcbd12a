"""Commands on a terminal: how they get it, and what a reader sees of the characters that they write."""

import re

CONTROLLED = "import fcntl, os, sys, termios\nfcntl.ioctl(0, termios.TIOCSCTTY, 0)\nos.execv(sys.argv[1], sys.argv[1:])"
"""Makes standard input the controlling terminal, as in a shell, and runs the command in this process."""

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
        end = 0
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
