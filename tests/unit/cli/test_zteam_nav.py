"""The command line of `zteam-nav`: which robots, and which parameters."""

import logging
from pathlib import Path

import pytest

from zteam.cli import processes
from zteam.team.parts import part_of


def read(*arguments: str):  # type: ignore[no-untyped-def]
    """The options of a command line."""
    args = processes.build_parser("zteam-nav").parse_args(arguments)
    options = processes.read("zteam-nav", args)[1]()
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
        "2 unknown parameters without effect: amcl.beam_skip_distance, amcl.do_beamskip"
    ]


def test_what_is_replaced_in_a_file_of_nav2_is_told_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """In one line, for all robots together."""
    file = tmp_path / "nav2.yaml"
    file.write_text("controller_server: {ros__parameters: {FollowPath: {plugin: 'dwb_core::DWBLocalPlanner'}}}")
    with caplog.at_level(logging.WARNING, "zteam"):
        read("--ids", "0-3", "--params", str(file))
    (record,) = caplog.records
    assert f"{file}: controller_server.FollowPath.plugin: dwb_core::DWBLocalPlanner" in record.getMessage()
