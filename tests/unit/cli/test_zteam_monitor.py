"""The team that `zteam-monitor` is told to wait for."""

import pytest

from support.commands import exit_code
from zteam.cli.zteam_monitor import main, parse_team
from zteam.errors import UsageError


@pytest.mark.parametrize(
    ("size", "ids", "team"),
    [
        (4, None, (4, None)),
        (None, ["0", "2", "7"], (3, (0, 2, 7))),
        (2, ["5", "0"], (2, (5, 0))),
        (None, ["0,2-4"], (4, (0, 2, 3, 4))),
        (4, ["0", "2-4"], (4, (0, 2, 3, 4))),
        (1, None, (1, None)),
        (None, None, (0, None)),
        (10000, None, (10000, None)),
    ],
)
def test_team_sizes(size: int | None, ids: list[str] | None, team: tuple[int, tuple[int, ...] | None]) -> None:
    """A number, a list, or both if they agree; size 0, to look at the monitor that runs, without either."""
    assert parse_team(size, ids) == team


@pytest.mark.parametrize(
    ("size", "ids", "text"),
    [
        (3, ["0", "1"], "disagree"),
        (None, ["0", "1", "0"], "twice"),
        (None, ["0", "00"], "twice"),
        *[(None, [robot_id], repr(robot_id)) for robot_id in ("abc", "1x", "-1", "10000", "٣")],
        (None, ["3-1"], "--ids: '3-1': the first id is above the last"),
        (None, [""], "--ids: no id is given"),
    ],
)
def test_bad_teams_are_refused(size: int | None, ids: list[str] | None, text: str) -> None:
    """Nonsense ends with exit code 2 and one line that names it."""
    with pytest.raises(UsageError) as caught:
        parse_team(size, ids)
    assert text in str(caught.value)
    assert caught.value.exit_code == 2
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("size", ["0", "-1", "4x", "", "²", "1.0", "10001", "9" * 40])
def test_bad_sizes_are_refused(size: str, capsys: pytest.CaptureFixture[str]) -> None:
    """One line names the option and its bounds."""
    assert exit_code(main, [f"--team-size={size}"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--team-size: " in line and "give a whole number from 1 to 10000" in line
