"""Mistakes on the command line of every command: one line with the cause and the usage, and exit code 2."""

import argparse
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

from zteam import cli
from zteam.cli.main import COMMANDS, PROCESSES, main

MODULES = sorted({module for module, _ in COMMANDS.values()} | {name.replace("-", "_") for name in PROCESSES})


def parser_of(module: str) -> argparse.ArgumentParser:
    """The parser of a command."""
    built = import_module(f"zteam.cli.{module}").build_parser()
    assert isinstance(built, argparse.ArgumentParser)
    return built


def subcommands(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The subcommands of a command by name."""
    groups = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return {name: sub for group in groups for name, sub in group.choices.items()}


def leaves() -> Iterator[tuple[str, list[str], argparse.ArgumentParser]]:
    """(module, the words that choose the subcommand, its parser) of everything that can be called."""
    for module in MODULES:
        parser = parser_of(module)
        subs = subcommands(parser)
        yield from ((module, [name], sub) for name, sub in subs.items())
        if not subs:
            yield module, [], parser


def required_by(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """The arguments without which a command is refused."""
    return [action for action in parser._actions if action.required and action.nargs != "*"]


UNDEMANDING = [
    pytest.param(*leaf, id=leaf[2].prog) for leaf in leaves() if not required_by(leaf[2]) and leaf[0] != "zteam_nav"
]
DEMANDING = [pytest.param(*leaf, id=leaf[2].prog) for leaf in leaves() if required_by(leaf[2])]


def refused(module: str, words: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """The one line with which a command refuses `words`."""
    with pytest.raises(SystemExit) as end:
        import_module(f"zteam.cli.{module}").main(words)
    assert end.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    return str(line)


def test_every_command_is_checked() -> None:
    """Each file of `cli/` that has a `main` is in this test."""
    files = Path(cli.__file__).parent.glob("*.py")
    commands = {file.stem for file in files if re.search(r"^(def )?main\b", file.read_text(encoding="utf-8"), re.M)}
    assert commands - {"main"} == set(MODULES)


@pytest.mark.parametrize(("module", "words", "parser"), UNDEMANDING)
def test_an_unknown_option_is_refused_with_the_usage(
    module: str, words: list[str], parser: argparse.ArgumentParser, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line begins with the subcommand, names the option and ends with the subcommand's usage."""
    line = refused(module, [*words, "--no-such-option"], capsys)
    assert line.startswith(f"{parser.prog}: ")
    assert "no option '--no-such-option'" in line
    assert f"; usage: {parser.prog}" in line


@pytest.mark.parametrize(("module", "words", "parser"), DEMANDING)
def test_a_missing_argument_is_named(
    module: str, words: list[str], parser: argparse.ArgumentParser, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without the arguments that it requires, a command names them, and the usage shows them without brackets."""
    required = required_by(parser)
    line = refused(module, words, capsys)
    assert line.startswith(f"{parser.prog}: ")
    told, _, usage = line.partition("; usage: ")
    assert " required" in told
    for action in required:
        name = action.option_strings[-1] if action.option_strings else str(action.metavar or action.dest)
        assert name in told
        assert f"[{name}" not in usage


@pytest.mark.parametrize("module", [module for module in MODULES if subcommands(parser_of(module))])
def test_a_wrong_subcommand_is_answered_with_the_right_one(module: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A mistyped subcommand is recognized; without a subcommand the usage lists them."""
    for name in subcommands(parser_of(module)):
        assert f"no subcommand '{name}e': did you mean {name}" in refused(module, [f"{name}e"], capsys)
    line = refused(module, [], capsys)
    assert ": the following arguments are required: " in line
    assert all(name in line for name in subcommands(parser_of(module)))


def test_a_wrong_command_is_answered_with_the_right_one(capsys: pytest.CaptureFixture[str]) -> None:
    """A mistyped command is recognized."""
    for name in COMMANDS:
        assert main([f"{name}e"]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"zteam: no command '{name}e': did you mean ")
        assert name in line


@pytest.mark.parametrize(
    ("module", "words", "line"),
    [
        (
            "topic",
            ["pub", "robot_0/cmd_vel"],
            "zteam topic pub: the following arguments are required: TYPE; usage: zteam topic pub KEY TYPE ['{…}' …]",
        ),
        ("world", ["show", "arena", "-o", "x.svg", "--scam"], "no option '--scam': did you mean --scan?; usage:"),
        (
            "up",
            ["line", "arena"],
            "zteam up: 'arena' is not NAME=VALUE, such as leader=2; usage: zteam up [TEAM]",
        ),
        ("tf", ["static", "1", "--pos"], "zteam tf static: no option '--pos'; usage: zteam tf static X Y Z YAW"),
        (
            "up",
            ["--robots", "4"],
            "zteam up: no option '--robots': a team file lists the robots, one table [[robots]] each; u",
        ),
        ("zteam_sim", ["arena", "--gui"], "zteam-sim: no option '--gui': there is no window; 'zteam world show' draws"),
        (
            "zteam_robot",
            ["--id", "0", "--speed", "0.5"],
            "no option '--speed': say --param speed=VALUE; usage: zteam-r",
        ),
        (
            "zteam_robot",
            ["--id", "0", "--param", "speed", "0.5"],
            "--param: 'speed' is not KEY=VALUE, e.g. --param speed=0.4; usage: zteam-robot --id N",
        ),
        ("zteam_robot", ["--id", "0", "--behaviour", "wander"], "did you mean --behavior?; usage: zteam-robot --id N"),
        ("sim", ["unpause"], "no subcommand 'unpause': did you mean resume?; usage"),
        ("topic", ["publish"], "no subcommand 'publish': did you mean pub?; usage"),
        (
            "sim",
            ["speed"],
            "zteam sim speed: the following arguments are required: X|max; usage: zteam sim speed X|max [--json]",
        ),
        ("up", ["--for"], "zteam up: --for: expected one argument; usage: zteam up [TEAM]"),
        (
            "up",
            ["--report", "x.json"],
            "zteam up: --report needs --for SECONDS or --until TICK: only a run with an end ",
        ),
        ("up", ["--speed", "fast"], "zteam up: speed 'fast': give simulated seconds a second from 1e-06 to 1e+06, or "),
        ("param", ["set", "0", "speed"], "zteam param set: set 'speed': give each parameter a value, e.g. speed 0.3 "),
        ("log", ["robot_0/odom"], "zteam log: 'robot_0/odom' is not the name of a process, such as robot_1, sim or "),
        ("tf", ["static", "1", "2"], "zteam tf static: give X Y Z YAW PITCH ROLL PARENT CHILD, e.g. 0.1 0 0.2 0 0 0 "),
        ("tf", ["tree", "-o", "x.gif"], "zteam tf tree: --output x.gif: name a .svg, .png, .pdf or .dot file; usage: "),
        ("topic", ["pub", "a", "Bool", "-1", "-t", "2"], "--times: not allowed with argument -1/--once; usage: zteam "),
        ("zteam_monitor", ["--ids", "0-"], "zteam-monitor: --ids: '0-': give robot ids from 0 to 9999, such as 0 2 5"),
        ("zteam_robot", ["--id", "0", "--follow", "x"], "zteam-robot: --follow: robot id 'x' is not a whole number fr"),
        (
            "zteam_robot",
            ["--id", "0", "--law", "direct"],
            "zteam-robot: --law direct says how to follow: say --follow I",
        ),
        (
            "zteam_robot",
            ["--id", "0", "--follow", "1", "--law", "trail", "--param", "law=direct"],
            "zteam-robot: --law names the law already: leave --param law out",
        ),
        ("zteam_robot", ["--id", "x"], "zteam-robot: --id: robot id 'x' is not a whole number from 0 to 9999"),
        ("zteam_sim", ["arena", "--gap", "1"], "zteam-sim: --gap '1' is not FOLLOWER:LEADER, e.g. 1:0; usage: zteam-"),
        ("zteam_sim", ["arena", "--no-gate"], "zteam-sim: --no-gate needs --lockstep; usage: zteam-sim WORLD"),
    ],
)
def test_the_line_says_what_to_type(
    module: str, words: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Examples of whole answers."""
    told = refused(module, words, capsys)
    assert line in told
    assert "; usage: zteam" in told
