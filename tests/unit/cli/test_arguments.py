"""The numeric options of every command, and the values that several commands share."""

import argparse
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import pytest

from support.commands import exit_code
from zteam.cli import bench, sim, tf, topic, up, world, zteam_robot, zteam_router, zteam_sim, zteam_tf
from zteam.cli.arguments import add_options, parse_speed, read_options
from zteam.cli.options import Parser
from zteam.config.option import option
from zteam.config.simulation_options import LockStepOptions, Options
from zteam.errors import UsageError
from zteam.node.process_options import AggregatorOptions, ViewOptions

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
    assert f"{option}: " in line
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


@pytest.mark.parametrize("number", ["-1", "-1e-3", "-.5", "-inf", "-1_000.5"])
def test_a_negative_number_is_no_option(number: str) -> None:
    """In any notation it is a value, also behind an option; other words with a dash are options."""
    parser = Parser()
    parser.add_argument("values", nargs="*")
    parser.add_argument("--at")
    found = parser.parse_args(["1", number, "--at", number])
    assert (found.values, found.at) == (["1", number], number)
    assert exit_code(parser.parse_args, ["-x"]) == 2


class Sample(msgspec.Struct):
    """One option of each kind, and a field that is none."""

    plain: int = 7
    cell_size: Annotated[float, option("metres", "M", typed=(0.1, 9.0, "metres"))] = 0.5
    count: Annotated[int | None, option("how many", typed=(0, 9, "a count"))] = None
    way: Annotated[Literal["near", "far"] | None, option("which way")] = None
    quiet: Annotated[bool, option("print less")] = False
    gate: Annotated[bool, option("drive at once")] = True
    has_map: Annotated[bool, option("publish none", flag="no-map")] = True
    names: Annotated[tuple[str, ...], option("wait for these", "NAME", flag="expect", nargs="+")] = ()
    file: Annotated[Path | None, option("read it", "FILE", type=Path)] = None


def sample(words: str, options: Any = Sample, *names: str, **texts: str) -> argparse.Namespace:
    """A command line, parsed."""
    parser = argparse.ArgumentParser()
    add_options(parser, options, *names, **texts)
    return parser.parse_args(words.split())


@pytest.mark.parametrize(
    ("words", "given"),
    [
        ("", {}),
        ("--cell-size 2 --count 3", {"cell_size": 2.0, "count": 3}),
        ("--way far --quiet --no-gate --no-map", {"way": "far", "quiet": True, "gate": False, "has_map": False}),
        ("--expect a b --file x.yaml", {"names": ("a", "b"), "file": Path("x.yaml")}),
    ],
)
def test_fields_that_say_so_are_options(words: str, given: dict[str, Any]) -> None:
    """What a user does not type has the default of its field; a field without an option is given by the command."""
    assert read_options(Sample, sample(words), plain=8) == Sample(plain=8, **given)


@pytest.mark.parametrize("words", ["--cell-size 10", "--count 1.5", "--way up", "--gate", "--plain 1"])
def test_a_field_bounds_what_may_be_typed(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Ranges and choices are those of the field; no option has two names."""
    assert exit_code(sample, words) == 2
    assert words.split()[0] in capsys.readouterr().err


def test_a_command_may_take_some_options_with_texts_and_defaults_of_its_own() -> None:
    """As `zteam up` takes those of the world from `zteam-sim`."""
    parser = argparse.ArgumentParser()
    add_options(parser, Sample(cell_size=3.0), "cell_size", way="the way home")
    text = " ".join(parser.format_help().split())
    assert "metres (default: 3)" in text
    assert "the way home" in text
    assert "--count" not in text


@pytest.mark.parametrize("kind", [Options, LockStepOptions, AggregatorOptions, ViewOptions])
def test_without_words_a_process_has_its_defaults(kind: type[msgspec.Struct]) -> None:
    """A command line without options and a launcher without a team file start equal processes."""
    assert read_options(kind, sample("", kind)) == kind()
