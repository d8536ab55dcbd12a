"""The command line of `zteam-nav`: which robots, which parameters, and what is refused."""

import logging
from pathlib import Path

import pytest

from zteam.cli import zteam_nav
from zteam.errors import UsageError
from zteam.team.parts import part_of


def read(*arguments: str):  # type: ignore[no-untyped-def]
    """The options of a command line."""
    args = zteam_nav.build_parser().parse_args(arguments)
    options = zteam_nav._read(args)[1]()
    part_of(options)
    return options


def test_parameters_of_the_command_line_count_before_those_of_the_team_file(tmp_path: Path) -> None:
    """Each robot has its own table; `--param` and `--localizer` are for all."""
    team = tmp_path / "team.toml"
    team.write_text(
        '[team]\nworld = "arena"\n[[robots]]\nid = 0\nnavigation = {localizer = "fake", amcl.alpha1 = 0.5}\n'
        "[[robots]]\nid = 1\nnavigation = true\nbase = {max_vel_x = 0.3}\n"
    )
    options = read(str(team), "--ids", "0-1", "--param", "amcl.alpha2=0.4", "--seed", "7")
    first, second = options.robots[0].parameters, options.robots[1].parameters
    assert first == {"localizer": "fake", "amcl": {"alpha1": 0.5, "alpha2": 0.4}}
    assert second == {"amcl": {"alpha2": 0.4}}
    assert (options.robots[1].base.max_vel_x, options.seed) == (0.3, 7)
    assert read(str(team), "--id", "0", "--localizer", "none").robots[0].parameters["localizer"] == "none"


def test_names_that_are_not_known_are_listed_once(caplog: pytest.LogCaptureFixture) -> None:
    """In one line, for all robots together."""
    with caplog.at_level(logging.WARNING, "zteam"):
        read("--ids", "0-3", "--param", "amcl.beam_skip_distance=0.5", "--param", "amcl.do_beamskip=false")
    assert [record.getMessage() for record in caplog.records] == [
        "2 parameters are not known here and have no effect: amcl.beam_skip_distance, amcl.do_beamskip"
    ]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--id", "0", "--param", "alpha1"), "--param 'alpha1' is not NODE.NAME=VALUE"),
        (("--id", "0", "--params", "x.yaml", "--param", "params.a=1"), "--param 'params.a=1' is not NODE.NAME=VALUE"),
        (("--id", "0", "--param", "amcl.alpha1=fast"), 'the parameters: amcl.alpha1: a number is expected, not "fast"'),
        (("--id", "0", "--params", "none.yaml"), "cannot read the parameters none.yaml"),
        (("--id", "x"), "robot id 'x' is not a whole number"),
        (("--ids", "1", "1"), "--ids names a robot twice: 1"),
    ],
)
def test_mistakes_are_refused(arguments: tuple[str, ...], told: str) -> None:
    """Each with the option, or with the key."""
    with pytest.raises(UsageError) as error:
        read(*arguments)
    assert told in str(error.value)


def test_a_robot_that_the_team_file_lacks_is_named(tmp_path: Path) -> None:
    """With the file."""
    team = tmp_path / "team.toml"
    team.write_text("[[robots]]\nid = 0\nnavigation = true\n")
    with pytest.raises(UsageError, match=r"team\.toml has no robot 3"):
        read(str(team), "--ids", "0", "3")


def test_one_of_the_options_for_robots_is_needed(capsys: pytest.CaptureFixture[str]) -> None:
    """`--id` or `--ids`."""
    with pytest.raises(SystemExit) as error:
        zteam_nav.main([])
    assert error.value.code == 2
    assert "--id" in capsys.readouterr().err
