"""`zteam up` on a pseudo-terminal, as a user sees it."""

import re

import pytest

from support.terminal import TerminalCommand
from zteam.messages import Twist
from zteam.team.launch.process import zteam_command
from zteam.team.testing.team import TeamFixture

pytestmark = [pytest.mark.team, pytest.mark.real_time]


def show(team: TeamFixture, *arguments: str, **environment: str) -> TerminalCommand:
    """`zteam up` on a terminal."""
    command = zteam_command("zteam", "up", *arguments, "--connect", team.endpoint, "--namespace", team.namespace)
    return TerminalCommand(command, environment)


def test_a_run_shows_its_progress_and_leaves_its_lines(team: TeamFixture) -> None:
    """The bar grows below the log, robots drive, and at the end there is only the log and the table."""
    shown = show(team, "arena", "--for", "60")
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


def test_a_pause_is_shown_and_ctrl_c_leaves_a_clean_terminal(team: TeamFixture) -> None:
    """Another client's pause is on the line, and its end too. At the end the live line and the echoed ^C are gone, and
    the cursor is at the beginning of an empty line. Each robot's last command is a zero velocity."""
    shown = show(team, "arena")
    try:
        shown.wait_for(lambda rows: re.search("[12] of 2 robots driving", rows[-1]) is not None)
        team.sim.pause()
        assert re.match(r"[\d.]+ s simulated, paused, ", shown.wait_for(lambda rows: "paused" in rows[-1])[-1])
        team.sim.resume()
        shown.wait_for(lambda rows: "x real time" in rows[-1])
        team.wait_for(lambda: all(team.robot(i).commands > 5 for i in (0, 1)))
        shown.press(b"\x03")
        code, rows = shown.end()
    finally:
        shown.close()
    assert code == 0, rows
    assert rows[-1] == ""
    assert not any("simulated" in row or "^C" in row for row in rows), rows
    team.wait_for(lambda: all(team.robot(i).command == Twist() for i in (0, 1)))
    assert any(line.startswith("\033[") and "[robot_0]\033[0m " in line for line in shown.text.splitlines())
    # The monitor may still say so too.
    assert sum(row.startswith("[robot_") and row.endswith(" stopped") for row in rows) == 2, rows


def test_a_closed_terminal_ends_the_team(team: TeamFixture) -> None:
    """The hang-up stops the team in order, although nothing can be written any more."""
    shown = show(team, "arena")
    try:
        shown.wait_for(lambda rows: re.search("[12] of 2 robots driving", rows[-1]) is not None)
        code = shown.hang_up()
    finally:
        shown.close()
    assert code == 0
    team.wait_for(lambda: not any(team.alive(name) for name in ("robot_0", "robot_1", "sim")))


def test_the_world_without_a_live_line(team: TeamFixture) -> None:
    """With JSON logs a terminal gets the lines alone, and nothing is ever erased."""
    shown = show(team, "arena", "--for", "1", "--log-format", "json")
    try:
        code, rows = shown.end()
    finally:
        shown.close()
    assert code == 0, rows
    assert "\x1b[J" not in shown.text
    assert "of 2 robots driving" not in shown.text
