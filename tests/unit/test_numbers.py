"""Numbers that come from outside as text, and the options of every command that take one."""

import pytest

from support.commands import exit_code
from zteam.cli import bench, sim, tf, topic, up, world, zteam_robot, zteam_router, zteam_sim, zteam_tf
from zteam.errors import UsageError
from zteam.numbers import is_number, parse_number, parse_whole, percentile

BAD = ("nan", "inf", "-inf", "1e308", "-1e308", "word", "", "1e-300x", "9" * 5000)
"""What no option takes for a number."""

REAL = [
    (zteam_sim, ["arena"], "--map-resolution"),
    (zteam_sim, ["arena"], "--for"),
    (zteam_sim, ["arena"], "--lockstep-timeout"),
    (zteam_sim, ["arena"], "--lease"),
    (up, ["line"], "--for"),
    (up, ["line"], "--lockstep-timeout"),
    (zteam_tf, [], "--rate"),
    (zteam_router, [], "--detached"),
    (topic, ["echo", "clock"], "--timeout"),
    (topic, ["pub", "flag", "Bool"], "--rate"),
    (tf, ["echo", "a", "b"], "--rate"),
    (tf, ["echo", "a", "b"], "--at"),
    (tf, ["echo", "a", "b"], "--timeout"),
    (tf, ["monitor"], "--for"),
    (tf, ["positions"], "--rate"),
    (world, ["scan", "arena", "--robot", "0"], "--fov-deg"),
    (world, ["scan", "arena", "--robot", "0"], "--range"),
    (bench, ["sim", "arena"], "--fov-deg"),
    (bench, ["sim", "arena"], "--range"),
    (bench, ["sim", "arena"], "--seconds"),
    (bench, ["team"], "--seconds"),
]
"""(command, the words it needs, its option)"""
WHOLE = [
    (zteam_sim, ["arena"], "--seed"),
    (up, ["line"], "--seed"),
    (zteam_robot, ["--id", "0"], "--seed"),
    (topic, ["hz", "clock"], "--window"),
    (topic, ["pub", "flag", "Bool"], "--times"),
    (world, ["scan", "arena"], "--robot"),
    (world, ["scan", "arena", "--robot", "0"], "--beams"),
    (world, ["show", "arena", "-o", "x.svg"], "--width"),
    (bench, ["sim", "arena"], "--robots"),
    (bench, ["sim", "arena"], "--beams"),
    (bench, ["team"], "--robots"),
    (bench, ["team"], "--beams"),
]


@pytest.mark.parametrize("text", BAD)
@pytest.mark.parametrize(("command", "words", "option"), [*REAL, *WHOLE])
def test_an_option_refuses_what_is_no_number_of_its_range(
    command: object, words: list[str], option: str, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """One short line that names the option and its range, exit code 2, and nothing is started."""
    assert exit_code(command.main, [*words, f"{option}={text}"]) == 2  # type: ignore[attr-defined]
    (line,) = capsys.readouterr().err.splitlines()
    assert f"argument {option}: " in line
    assert ": give " in line
    assert len(line) < 200


@pytest.mark.parametrize(
    ("command", "words", "text"),
    [
        (
            zteam_sim,
            ["arena", "--speed", "1e-300"],
            "speed '1e-300': give simulated seconds a second from 1e-06 to 1e+06",
        ),
        (up, ["line", "--speed", "inf"], "speed 'inf': give simulated seconds a second"),
        (zteam_sim, ["arena", "--add", "7:erratic:1e308:0:0"], "'1e308': give metres and radians from"),
        (zteam_sim, ["arena", "--add", "7:erratic:nan:0:0"], "'nan': give metres and radians from"),
        (zteam_sim, ["arena", "--gaussian-noise", "1e308"], "gaussian_noise must be from 0 to 1000"),
        (zteam_sim, ["arena", "--odom-alphas", "0,0,0,nan"], "odom_alphas must be from 0 to 1000"),
        (zteam_sim, ["arena", "--dazzle-angle", "inf"], "dazzle_angle must be from 0 to"),
        (sim, ["speed", "1e-11"], "speed '1e-11': give simulated seconds a second"),
        (sim, ["move", "0", "1e308", "0", "0"], "pose '1e308 0 0': give X Y YAW"),
        (
            topic,
            ["list", "--connect", "tcp/127.0.0.1:99999"],
            "'tcp/127.0.0.1:99999': port '99999': give a port",
        ),
        (topic, ["list", "--connect", "tcp/127.0.0.1:²"], "port '²': give a port from 0 to 65535"),
        (topic, ["list", "--connect", "7447"], "give PROTOCOL/ADDRESS, such as tcp/127.0.0.1:"),
        (zteam_router, ["--listen", "tcp/127.0.0.1:99999"], "port '99999': give a port from 0 to 65535"),
        (tf, ["static", "1e308", "0", "0", "0", "0", "0", "map", "table"], "give X Y Z YAW PITCH ROLL"),
    ],
)
def test_other_numbers_have_bounds_too(
    command: object, words: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Speeds, poses, noise, ports: one line, exit code 2."""
    assert exit_code(command.main, words) == 2  # type: ignore[attr-defined]
    (line,) = capsys.readouterr().err.splitlines()
    assert text in line


def test_numbers_in_range_are_taken() -> None:
    """The bounds belong to the range; spaces around a number do not matter."""
    assert parse_number(" 0.5 ", 0.5, 1.0, "shares") == 0.5
    assert parse_number("1", 0.5, 1.0, "shares") == 1.0
    assert parse_whole("-3", -3, 5, "steps") == -3
    assert parse_whole(" 0005 ", -3, 5, "steps") == 5


@pytest.mark.parametrize("text", ["1.5", "--1", "²", "1_0", "0x1", "6", "-4"])
def test_a_whole_number_has_digits_only(text: str) -> None:
    """No other notation is guessed at."""
    with pytest.raises(UsageError, match="give steps from -3 to 5"):
        parse_whole(text, -3, 5, "steps")


@pytest.mark.parametrize("text", ["0", "-1e-3", " 2.5 ", "inf", "-inf", "nan"])
def test_a_number_is_what_float_reads(text: str) -> None:
    """Infinities and NaN included."""
    assert is_number(text)


@pytest.mark.parametrize("text", ["", "-", "map", "1,5", "--for"])
def test_a_word_is_no_number(text: str) -> None:
    """Options and frame names stay words."""
    assert not is_number(text)


@pytest.mark.parametrize(("share", "expected"), [(0.0, 1.0), (0.5, 51.0), (0.99, 100.0), (1.0, 100.0)])
def test_a_percentile_is_one_of_the_values(share: float, expected: float) -> None:
    """The order of the values does not matter, and the whole share is the largest value."""
    assert percentile([float(i) for i in range(100, 0, -1)], share) == expected


def test_a_single_value_is_every_percentile() -> None:
    """No index is out of range."""
    assert {percentile([7.0], share) for share in (0.0, 0.5, 0.99, 1.0)} == {7.0}


def test_no_values_have_no_percentile() -> None:
    """None, not 0."""
    assert percentile([], 0.5) is None
