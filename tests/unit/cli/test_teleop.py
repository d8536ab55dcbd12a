"""The command line of `zteam teleop`."""

import pytest

from zteam.cli.teleop import build_parser, main


def test_the_speeds_are_those_of_teleop_twist_keyboard() -> None:
    """0.5 m/s and 1 rad/s unless the user says otherwise."""
    args = build_parser().parse_args(["--id", "0"])
    assert (args.speed, args.turn) == (0.5, 1.0)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--id", "0"], "standard input and output are no terminal: give the keys with --script"),
        (["--id", "a", "--script", "i"], "--id: 'a': give robot ids"),
        (["--id", "0,0", "--script", "i"], "--id names a robot twice: 0"),
        (["--id", "0", "--script", "i*0"], "--script: 'i*0'"),
        (["--id", "0", "--speed", "0", "--script", "i"], "--speed: '0': give a speed from 0.01 to 10"),
        (["--script", "i"], "required: --id"),
    ],
)
def test_bad_command_lines(arguments: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 2 and one line that says what to give; without a terminal a script is needed."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert text in told
    assert told.count("\n") == 1
