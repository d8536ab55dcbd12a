"""A terminal as a keyboard: single keys without echo, and whether it has the focus. It is restored on every way out."""

import os
import select
import sys
import termios
from collections.abc import Callable, Iterator
from contextlib import suppress
from types import TracebackType

from zteam.clock import monotonic
from zteam.nodes.teleop import KeyDecoder

PERIOD = 0.05
"""Host seconds from one command to the next: the robot and the simulator stop when none comes for a while."""
_FOCUS_ON, _FOCUS_OFF = "\x1b[?1004h", "\x1b[?1004l"
"""From then on the terminal tells when it gets and loses the focus."""


class KeyTerminal:
    """Standard input, in a context. Ctrl+C remains a signal; Ctrl+Z and Ctrl+\\ are keys like others."""

    def __init__(self, stopping: Callable[[], bool]) -> None:
        self._stopping = stopping
        self._input = sys.stdin.fileno()
        self._before = termios.tcgetattr(self._input)

    def __enter__(self) -> "KeyTerminal":
        mode = termios.tcgetattr(self._input)
        # Ctrl+S would stop the output, and with it this process.
        mode[0] &= ~termios.IXON
        mode[3] &= ~(termios.ECHO | termios.ICANON)
        mode[6][termios.VMIN], mode[6][termios.VTIME] = 1, 0
        # A process that is suspended or dumps its core cannot stop its robots or restore the terminal.
        mode[6][termios.VSUSP] = mode[6][termios.VQUIT] = b"\0"
        # What was typed before must not drive a robot.
        termios.tcsetattr(self._input, termios.TCSAFLUSH, mode)
        self._write(_FOCUS_ON)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._write(_FOCUS_OFF)
        finally:
            # A closed terminal cannot be restored.
            with suppress(termios.error):
                # The shell must not get the repeats of the last key.
                termios.tcflush(self._input, termios.TCIFLUSH)
                termios.tcsetattr(self._input, termios.TCSANOW, self._before)

    def _write(self, text: str) -> None:
        sys.stdout.write(text)
        sys.stdout.flush()

    def presses(self) -> Iterator[tuple[list[str], float]]:
        """Keys and the host's time, at once when a key comes and every PERIOD, until the stop or the terminal's end."""
        decoder, due = KeyDecoder(), monotonic()
        while not self._stopping():
            # Host time: neither a key nor the next command may wait for the other.
            if select.select([self._input], [], [], max(0.0, due - monotonic()))[0]:  # noqa: TID251
                data = self._read()
                if not data:
                    return
                yield decoder.feed(data), monotonic()
            else:
                yield decoder.flush(), monotonic()
                due = monotonic() + PERIOD

    def _read(self) -> bytes:
        try:
            return os.read(self._input, 1024)
        except OSError:
            # The terminal is gone.
            return b""
