"""Options: those that a struct declares, those that all commands share, and values that several commands take."""

import argparse
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import pytest

from support.commands import command_of, exit_code
from zteam.cli import bench, node, processes
from zteam.cli.main import COMMANDS, main
from zteam.cli.options import Parser, add_options, parse_speed, read_options
from zteam.config.option import option
from zteam.config.simulation_options import LockStepOptions, Options
from zteam.node.process_options import AggregatorOptions, MonitorOptions, ViewOptions


def test_the_list_of_commands_fits_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    """`zteam --help` has a line for each command, and no line is longer than 80 columns."""
    assert main(["--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert set(COMMANDS) <= {line.split()[0] for line in lines if line.startswith("  ")}
    assert max(map(len, lines)) <= 80


@pytest.mark.parametrize(
    ("name", "words", "defaults"),
    [
        ("up", "", {"team": "line", "seed": None, "run_for": None, "speed": None}),
        ("teleop", "--id 0", {"speed": 0.5, "turn": 1.0}),
        ("topic", "pub key Bool", {"rate": 1.0, "times": None, "clock": "auto"}),
        ("topic", "hz key", {"clock": "wall"}),
        ("bench", "team", {"robots": 4, "beams": 1081, "seconds": 60.0, "world": "office", "log_level": "warning"}),
        ("bench", "sim arena", {"robots": 20, "fov_deg": 270.0, "range": 30.0}),
        ("zteam-sim", "arena", {"log_level": "info", "log_format": "text"}),
    ],
)
def test_what_is_not_typed_has_a_default(
    name: str, words: str, defaults: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that the pages name."""
    for variable in ("LOG_LEVEL", "LOG_FORMAT"):
        monkeypatch.delenv(f"ZTEAM_{variable}", raising=False)
    found = vars(command_of(name)[0]().parse_args(words.split()))
    assert {each: found[each] for each in defaults} == defaults


def test_the_environment_sets_the_log(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """It replaces the defaults of every command, an option replaces it, and a wrong value is a usage error."""
    parse = node.build_parser().parse_args
    monkeypatch.setenv("ZTEAM_LOG_LEVEL", "error")
    monkeypatch.setenv("ZTEAM_LOG_FORMAT", "json")
    for build, words in ((node.build_parser, ["list"]), (bench.build_parser, ["team"])):
        args = build().parse_args(words)
        assert (args.log_level, args.log_format) == ("error", "json")
    for name, flag in (("LEVEL", "--log-level"), ("FORMAT", "--log-format")):
        with monkeypatch.context() as patch:
            patch.setenv(f"ZTEAM_LOG_{name}", "loud")
            parse = node.build_parser().parse_args
            assert exit_code(parse, ["list"]) == 2  # type: ignore[arg-type]
            assert f": {flag}: 'loud': give " in capsys.readouterr().err
            if name == "LEVEL":
                assert parse(["list", flag, "debug"]).log_level == "debug"


@pytest.mark.parametrize(
    ("words", "team"), [("--team-size 4", (4, None)), ("--ids 0 2-3", (3, (0, 2, 3))), ("", (0, None))]
)
def test_the_team_that_a_monitor_waits_for(words: str, team: tuple[int, Any]) -> None:
    """A number or a list; size 0, to look at the monitor that runs, without either."""
    args = processes.build_parser("zteam-monitor").parse_args(words.split())
    options = processes.read("zteam-monitor", args)[1]()
    assert isinstance(options, MonitorOptions)
    assert (options.team_size, options.ids) == team


def test_a_speed_is_a_number_or_max() -> None:
    """`max` is None: as fast as possible."""
    assert [parse_speed(text) for text in ("0.5", "1e3", "max")] == [0.5, 1000.0, None]


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
