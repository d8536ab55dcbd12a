"""`zteam COMMAND`."""

from pathlib import Path

import pytest

from zteam.cli.main import COMMANDS, main


def test_the_list_of_commands_fits_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    """`zteam --help` has a line for each command, and no line is longer than 80 columns."""
    assert main(["--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert set(COMMANDS) <= {line.split()[0] for line in lines if line.startswith("  ")}
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        ("run", "did you mean 'zteam up'?"),
        ("start arena", "did you mean 'zteam up arena'?"),
        ("launch", "did you mean 'zteam up'?"),
        (
            "--connect tcp/localhost:7447 topic list",
            "options stand behind the command, e.g. 'zteam topic list --connect",
        ),
        ("rostopic echo map", "did you mean 'zteam topic echo map'?"),
        ("tf_echo map odom", "did you mean 'zteam tf echo map odom'?"),
        ("pause", "did you mean 'zteam sim pause'?"),
        ("shutdown", "'zteam stop' stops the robots; to end a team, press Ctrl+C where 'zteam up' runs"),
        ("release 1", "did you mean 'zteam stop --release 1'?"),
        ("arena", "did you mean 'zteam up arena'?"),
        ("mine.toml --for 3", "did you mean 'zteam up mine.toml --for 3'?"),
        ("office.world", "a team drives in a world: 'zteam up --world office.world'"),
        ("zteam-sim office", "the processes are separate commands: zteam-sim office"),
        ("toppic", "did you mean topic?"),
        ("qqq", "commands: up, topic, "),
    ],
)
def test_a_word_that_is_no_command_gets_the_command_that_was_meant(
    words: str, hint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line with the command to type; the exit code is 2."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").touch()
    assert main(words.split()) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"zteam: no command {words.split()[0]!r}")
    assert hint in line
