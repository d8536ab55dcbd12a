"""The options that all commands share."""

import argparse
from collections.abc import Callable

import pytest

from zteam.cli import bench, node, world, zteam_sim

COMMANDS = [
    (bench.build_parser, ["team"], "warning"),
    (world.build_parser, ["check", "arena"], "warning"),
    (node.build_parser, ["list"], "info"),
    (zteam_sim.build_parser, ["arena"], "info"),
]
"""(parser, the words it needs, its default log level)"""

Build = Callable[[], argparse.ArgumentParser]


@pytest.mark.parametrize(("build", "words", "level"), COMMANDS)
def test_every_command_has_a_default_log_level(
    build: Build, words: list[str], level: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without option and environment a command logs as text from its own default level up."""
    for name in ("ZTEAM_LOG_LEVEL", "ZTEAM_LOG_FORMAT"):
        monkeypatch.delenv(name, raising=False)
    args = build().parse_args(words)
    assert (args.log_level, args.log_format) == (level, "text")


@pytest.mark.parametrize(("build", "words", "level"), COMMANDS)
def test_the_environment_sets_the_log(
    build: Build, words: list[str], level: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """ZTEAM_LOG_LEVEL and ZTEAM_LOG_FORMAT replace the defaults of every command."""
    monkeypatch.setenv("ZTEAM_LOG_LEVEL", "error")
    monkeypatch.setenv("ZTEAM_LOG_FORMAT", "json")
    args = build().parse_args(words)
    assert (args.log_level, args.log_format) == ("error", "json")


def test_an_option_overrides_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong value in the environment does not matter if the option is given."""
    monkeypatch.setenv("ZTEAM_LOG_LEVEL", "loud")
    assert node.build_parser().parse_args(["list", "--log-level", "debug"]).log_level == "debug"


@pytest.mark.parametrize(("name", "option"), [("ZTEAM_LOG_LEVEL", "--log-level"), ("ZTEAM_LOG_FORMAT", "--log-format")])
def test_a_wrong_environment_is_a_usage_error(
    name: str, option: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong value in the environment ends a command with 2 and one line that lists the right ones."""
    monkeypatch.setenv(name, "loud")
    with pytest.raises(SystemExit) as end:
        node.build_parser().parse_args(["list"])
    assert end.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f": {option}: 'loud': give " in line
