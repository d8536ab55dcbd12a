"""A live line on a pseudo-terminal, as a reader sees it."""

import fcntl
import logging
import os
import pty
import struct
import sys
import termios
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

import pytest

from support.terminal import Screen
from zteam.cli.doctor import format_findings
from zteam.cli.log import format_line
from zteam.cli.up_display import RunDisplay
from zteam.messages import LogLevel
from zteam.monitor.doctor.facts import problem
from zteam.monitor.process.display import Row, showing
from zteam.monitor.process.start_gate import Event
from zteam.node.live_line import LiveLine, has_color, has_live_line
from zteam.node.logs import LogLine, start_logging
from zteam.node.output import Clean
from zteam.node.process_options import MonitorOptions

MARK = "\x05"


class PseudoTerminal:
    """A terminal of this process, and what is on its screen."""

    def __init__(self, columns: int) -> None:
        self._master, slave = pty.openpty()
        self.stream: TextIO = os.fdopen(slave, "w")
        self.screen = Screen(columns)
        self.text = ""
        """All that was written."""
        self._set_size(columns)

    def _set_size(self, columns: int) -> None:
        fcntl.ioctl(self._master, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))

    def resize(self, columns: int) -> None:
        """Change the width, as a user does with the mouse."""
        self.rows()
        self._set_size(columns)
        self.screen.resize(columns)

    def rows(self) -> list[str]:
        """The rows of the screen now."""
        # A terminal delivers later than it is written to: the mark shows that everything has come.
        self.stream.write(MARK)
        self.stream.flush()
        text = ""
        while not text.endswith(MARK):
            text += os.read(self._master, 1 << 16).decode()
        self.text += text
        self.screen.feed(text.removesuffix(MARK))
        return self.screen.rows

    def close(self) -> None:
        """Close both ends."""
        self.stream.close()
        os.close(self._master)


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[PseudoTerminal]:
    """A terminal of 80 columns."""
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    made = PseudoTerminal(80)
    yield made
    made.close()


def test_the_lines_are_rewritten_in_place(terminal: PseudoTerminal) -> None:
    """New lines replace the old ones, also where they are fewer or shorter; what is printed above stays whole."""
    with LiveLine(terminal.stream) as live:
        live.show("a long text\nand a second line")
        assert terminal.rows() == ["a long text", "and a second line"]
        live.print("x" * 300)
        live.show("sh\x1b[2Jort")
        assert terminal.rows() == ["x" * 80, "x" * 80, "x" * 80, "x" * 60, "sh\ufffd[2Jort"]
        live.show("…é\n" + "x" * 90 + "\nlast")
        assert terminal.rows()[-3:] == ["…é", "x" * 80, "last"]
        live.show("\n".join(map(str, range(40))))
        assert terminal.rows()[-23:] == [str(i) for i in range(23)]
    assert terminal.rows() == ["x" * 80, "x" * 80, "x" * 80, "x" * 60, ""]


def test_what_is_printed_above_is_harmless(terminal: PseudoTerminal) -> None:
    """A text of the bus commands no terminal; what is ready for one comes as it is."""
    with LiveLine(terminal.stream) as live:
        live.show("live")
        live.print("a\x1b[2Jb\nc")
        live.print(Clean("\033[31mred\033[0m"))
        assert terminal.rows() == ["a\ufffd[2Jb\ufffdc", "red", "live"]


def test_a_resized_terminal_keeps_its_lines(terminal: PseudoTerminal) -> None:
    """On a terminal made narrower the wrapped live line is erased as a whole, nothing else is, and the text fits."""
    with LiveLine(terminal.stream) as live:
        live.print("above")
        live.show("#" * 200)
        assert len(terminal.rows()[-1]) == 77
        terminal.resize(30)
        live.print("more")
        assert terminal.rows() == ["above", "more", "#" * 27]
        terminal.resize(100)
        live.show("#" * 200)
        assert terminal.rows() == ["above", "more", "#" * 97]


def test_an_echoed_ctrl_c_is_erased(terminal: PseudoTerminal) -> None:
    """The terminal writes ^C behind the line, which has room for it, and the next text erases both."""
    with LiveLine(terminal.stream) as live:
        live.show("#" * 200)
        terminal.rows()
        terminal.screen.feed("^C")
        live.print("stopped")
        assert terminal.rows() == ["stopped", "#" * 77]
    assert terminal.rows() == ["stopped", ""]


def test_standard_error_prints_above(terminal: PseudoTerminal, monkeypatch: pytest.MonkeyPatch) -> None:
    """A log line and a text written in parts come above the live line; afterwards standard error is as before."""
    monkeypatch.setattr(sys, "stderr", terminal.stream)
    logger = logging.getLogger("zteam")
    before = list(logger.handlers), logger.level, logger.propagate
    try:
        start_logging("up")
        with LiveLine(terminal.stream) as live:
            live.show("live")
            logger.warning("a log line")
            sys.stderr.write("in ")
            sys.stderr.write("parts\n")
            rows = terminal.rows()
            assert rows[0].endswith("[up] warning: a log line")
            assert rows[1:] == ["in parts", "live"]
            sys.stderr.write("no end")
    finally:
        logger.handlers[:], logger.level, logger.propagate = before
    assert terminal.rows()[1:] == ["in parts", "no end", ""]
    assert sys.stderr is terminal.stream


def test_only_a_terminal_that_can_erase_has_a_live_line(
    terminal: PseudoTerminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file has none, nor has a terminal that TERM calls dumb or does not name."""
    assert has_live_line(terminal.stream)
    with Path(os.devnull).open("w") as file:
        assert not has_live_line(file)
    monkeypatch.setenv("TERM", "dumb")
    assert not has_live_line(terminal.stream)
    monkeypatch.delenv("TERM")
    assert not has_live_line(terminal.stream)


def test_a_process_in_the_background_draws_nothing(terminal: PseudoTerminal, monkeypatch: pytest.MonkeyPatch) -> None:
    """While the shell has the terminal, lines are printed and nothing of the shell's is erased."""
    monkeypatch.setattr(os, "tcgetpgrp", lambda descriptor: os.getpgrp() + 1)
    with LiveLine(terminal.stream) as live:
        terminal.screen.feed("$ ")
        live.show("live")
        live.print("line")
        assert terminal.rows() == ["$ line", ""]
        monkeypatch.setattr(os, "tcgetpgrp", lambda descriptor: os.getpgrp())
        live.show("live")
        assert terminal.rows() == ["$ line", "live"]


@pytest.mark.parametrize(
    ("variable", "value"), [("TERM", "dumb"), ("NO_COLOR", "1"), ("NO_COLOR", ""), ("TERM", "xterm")]
)
def test_no_command_has_colours_where_they_are_not_wanted(
    variable: str, value: str, monkeypatch: pytest.MonkeyPatch, terminal: PseudoTerminal
) -> None:
    """Logs, findings, the lines of `zteam up` and the monitor's table: a colour is written on an xterm alone."""
    monkeypatch.setenv(variable, value)
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    monkeypatch.setattr(sys, "stdout", terminal.stream)
    shown: list[str] = []
    monkeypatch.setattr(RunDisplay, "print", lambda _display, line: shown.append(line))
    RunDisplay(None).line("robot_0", "ready")
    shown.append(format_line(LogLine(1, "robot_0", LogLevel.ERROR, "no", "f", "f", 1), has_color(sys.stdout)))
    shown.append(format_findings([problem("world", "stands", "go")], has_color(sys.stdout)))
    with showing(MonitorOptions(1)) as output:
        output.show(Event("lost", 1, "lost"))
        output.print_table([Row("robot_1", "running")], ["GO is out"])
        assert "GO is out" in terminal.rows()
    colored = {code: f"\033[{code}m" in terminal.text for code in ("1;31", "32")}
    assert [*colored.values(), *("\033[" in text for text in shown)] == [value == "xterm"] * 5
