"""The numeric options of every command, and the values that several commands share."""

import pytest

from support.commands import exit_code
from zteam.cli import bench, sim, tf, topic, up, world, zteam_robot, zteam_router, zteam_sim, zteam_tf
from zteam.cli.arguments import negative_numbers, parse_speed
from zteam.errors import UsageError

BAD = ("nan", "inf", "-inf", "1e308", "-1e308", "word", "", "1e-300x", "9" * 5000)
"""Values that every numeric option refuses."""

REAL = [
    (zteam_sim, ["arena"], "--map-resolution"),
    (zteam_sim, ["arena"], "--for"),
    (zteam_sim, ["arena"], "--lockstep-timeout"),
    (zteam_sim, ["arena"], "--lease"),
    (up, ["line"], "--for"),
    (up, ["line"], "--lockstep-timeout"),
    (zteam_tf, [], "--rate"),
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


@pytest.mark.few(99)
@pytest.mark.parametrize("text", BAD)
@pytest.mark.parametrize(("command", "words", "option"), [*REAL, *WHOLE])
def test_an_option_refuses_a_number_out_of_its_range(
    command: object, words: list[str], option: str, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A command line with a wrong number ends with 2 and one short line that names the option and its range."""
    assert exit_code(command.main, [*words, f"{option}={text}"]) == 2  # type: ignore[attr-defined]
    (line,) = capsys.readouterr().err.splitlines()
    assert f": {option}: " in line
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
def test_numbers_within_other_arguments_have_bounds(
    command: object, words: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong speed, pose, noise or port ends with 2 and one line that names the bounds."""
    assert exit_code(command.main, words) == 2  # type: ignore[attr-defined]
    (line,) = capsys.readouterr().err.splitlines()
    assert text in line


def test_a_speed_is_a_number_or_max() -> None:
    """`max` is None: as fast as possible."""
    assert [parse_speed(text) for text in ("0.5", "1e3", "max")] == [0.5, 1000.0, None]


def test_a_wrong_speed_names_max_too() -> None:
    """The error names the bounds and the word `max`."""
    with pytest.raises(UsageError, match=r"^speed 'fast': give simulated seconds a second from .* to .*, or max$"):
        parse_speed("fast")


def test_negative_numbers_are_hidden_from_argparse() -> None:
    """Negative numbers in any notation get a space in front; options and other words stay."""
    words = ["move", "-1e-3", "-.5", "-inf", "2", "--force", "-x", "-"]
    assert negative_numbers(words) == ["move", " -1e-3", " -.5", " -inf", "2", "--force", "-x", "-"]
