"""`zteam up` on a pseudo-terminal, as a user sees it."""

import fcntl
import os
import pty
import re
import struct
import subprocess
import sys
import termios
from collections.abc import Callable
from contextlib import suppress

import pytest

from support.terminal import CONTROLLED, Screen
from zteam.launch.process import zteam_command
from zteam.testing.team import TeamFixture

pytestmark = pytest.mark.team

LIMIT = 60.0


class Shown:
    """`zteam up` on a terminal of 100 columns, and the screens that it shows."""

    def __init__(self, team: TeamFixture, *arguments: str, **environment: str) -> None:
        self._master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
        command = zteam_command("zteam", "up", *arguments, "--connect", team.endpoint, "--namespace", team.namespace)
        kept = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "ZTEAM_LOG_FORMAT")}
        self._launcher = subprocess.Popen(
            [sys.executable, "-c", CONTROLLED, *command],
            stdin=slave, stdout=slave, stderr=slave, env={**kept, "TERM": "xterm", **environment},
            start_new_session=True,
        )  # fmt: skip
        os.close(slave)
        self.text = ""
        self.screen = Screen(100)

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
        return self._launcher.wait(LIMIT), self.screen.rows

    def hang_up(self) -> int:
        """Close the terminal, as a user closes a window; the exit code."""
        os.close(self._master)
        self._master = os.open(os.devnull, os.O_RDWR)
        return self._launcher.wait(LIMIT)

    def close(self) -> None:
        """End the command if it still runs."""
        with suppress(ProcessLookupError):
            self._launcher.kill()
        self._launcher.wait()
        os.close(self._master)


def test_a_run_shows_its_progress_and_leaves_its_lines(team: TeamFixture) -> None:
    """The bar grows below the log, robots drive, and at the end there is only the log and the table."""
    shown = Shown(team, "arena", "--for", "60")
    try:
        bar = re.compile(r"\[#*-*\] ([\d.]+) of 60 s, [\d.]+ x real time, .*, [12] of 2 robots driving")
        rows = shown.wait_for(lambda rows: bar.fullmatch(rows[-1]) is not None)
        first = bar.fullmatch(rows[-1])
        assert any("All robots GO!" in row for row in rows[:-1])
        rows = shown.wait_for(
            lambda rows: bool(found := bar.fullmatch(rows[-1])) and bool(first) and float(found[1]) > float(first[1])
        )
        assert not any(bar.search(row) for row in rows[:-1])
        # The rest of the minute as fast as it runs.
        team.sim.set_speed(None)
        code, rows = shown.end()
    finally:
        shown.close()
    assert code == 0, rows
    assert not any("x real time, " in row or "before GO" in row or row == "stopping" for row in rows), rows
    assert "robot    follows" in "\n".join(rows)
    assert rows[-1] == ""


def test_ctrl_c_leaves_a_clean_terminal(team: TeamFixture) -> None:
    """The live line and the echoed ^C are gone, and the cursor is at the beginning of an empty line."""
    shown = Shown(team, "arena")
    try:
        shown.wait_for(lambda rows: re.search("[12] of 2 robots driving", rows[-1]) is not None)
        shown.press(b"\x03")
        code, rows = shown.end()
    finally:
        shown.close()
    assert code == 0, rows
    assert rows[-1] == ""
    assert not any("simulated" in row or "^C" in row for row in rows), rows
    assert sum(row.endswith(" stopped") for row in rows) == 2


def test_a_closed_terminal_ends_the_team(team: TeamFixture) -> None:
    """The hang-up stops the team in order, although nothing can be written any more."""
    shown = Shown(team, "arena")
    try:
        shown.wait_for(lambda rows: re.search("[12] of 2 robots driving", rows[-1]) is not None)
        code = shown.hang_up()
    finally:
        shown.close()
    assert code == 0
    team.wait_for(lambda: not any(team.alive(name) for name in ("robot_0", "robot_1", "sim")))


def test_a_paused_world_is_said_so(team: TeamFixture) -> None:
    """Another client's pause is on the line, and its end too."""
    shown = Shown(team, "arena")
    try:
        shown.wait_for(lambda rows: re.search("[12] of 2 robots driving", rows[-1]) is not None)
        team.sim.pause()
        assert re.match(r"[\d.]+ s simulated, paused, ", shown.wait_for(lambda rows: "paused" in rows[-1])[-1])
        team.sim.resume()
        shown.wait_for(lambda rows: "x real time" in rows[-1])
        shown.press(b"\x03")
        code, _ = shown.end()
    finally:
        shown.close()
    assert code == 0


def test_the_world_without_a_live_line(team: TeamFixture) -> None:
    """With JSON logs a terminal gets the lines alone, and nothing is ever erased."""
    shown = Shown(team, "arena", "--for", "1", "--log-format", "json")
    try:
        code, rows = shown.end()
    finally:
        shown.close()
    assert code == 0, rows
    assert "\x1b[J" not in shown.text
    assert "of 2 robots driving" not in shown.text
