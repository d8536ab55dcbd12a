"""The command line of `zteam chaos`: what does not belong together is refused before the team is looked for."""

import pytest

from zteam.cli.chaos import main


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ("", "say one of: a fault and a process ('pause robot_1'), --plan FILE, --random SEED"),
        ("pause robot_1 --random 3", "say one of"),
        ("freeze robot_1", "freeze: say kill, pause, cut, slow and a process"),
        ("pause", "pause: say kill, pause, cut, slow and a process"),
        ("pause robot_1 --delay 1", "--delay and --rate belong to slow"),
        ("--plan plan.toml --for 3", "--for: a plan says itself how long its faults last"),
        ("--random 3", "--random needs --for SECONDS"),
        ("kill tf --print", "--print needs --random"),
        ("pause robot_1 --for 0", "give seconds from 0.001"),
        ("slow robot_1 --rate 0", "give bytes a second from 1"),
    ],
)
def test_words_that_do_not_belong_together_are_refused(
    words: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line says what is wrong, and the exit code is that of a mistake in the command line."""
    try:
        code = main(words.split())
    except SystemExit as end:
        code = int(end.code or 0)
    assert code == 2
    assert told in capsys.readouterr().err
