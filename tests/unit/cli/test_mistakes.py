"""Each mistake of a new user is answered in one line with the cause and the way out."""

import argparse
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.commands import command_of, exit_code, run_here
from support.mistakes import ALONE, Mistake
from zteam import cli
from zteam.cli import listening
from zteam.cli.main import COMMANDS, PROCESSES, main
from zteam.team.launch.warm_parent import WarmParent
from zteam.team.run.team_run import TeamRun

MODULES = sorted({module for module, _ in COMMANDS.values()} | set(PROCESSES))
BAD = ("nan", "inf", "-inf", "1e308", "-1e308", "word", "", "1e-300x", "9" * 5000)
"""Values that every numeric option refuses."""


@pytest.fixture(autouse=True)
def nothing_runs(empty_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The user stands in an empty folder, and no process may be started."""
    monkeypatch.setattr(listening, "PATIENCE", 0.0)
    monkeypatch.setattr(WarmParent, "prepare", lambda _parent: None)
    monkeypatch.setattr(TeamRun, "start", lambda _run: pytest.fail("a process was started"))
    for name in ("CONNECT", "NAMESPACE"):
        monkeypatch.delenv(f"ZTEAM_{name}", raising=False)


@pytest.mark.parametrize("mistake", ALONE, ids=lambda mistake: mistake.label)
def test_a_mistake_is_answered(mistake: Mistake, capsys: pytest.CaptureFixture[str]) -> None:
    """The exit code is that of the mistake, the answer names what it must, and nothing is on standard output."""
    if name := mistake.file[0]:
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text(mistake.file[1])
    code = run_here(mistake.command)
    out, err = capsys.readouterr()
    assert code == mistake.exit_code, err
    assert [told for told in mistake.told if told not in err] == [], err
    assert len(err.splitlines()) <= mistake.lines
    assert not out or mistake.command == "zteam"


def subcommands(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """The subcommands of a command by name."""
    groups = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return {name: sub for group in groups for name, sub in group.choices.items()}


def leaves() -> Iterator[tuple[str, list[str], argparse.ArgumentParser]]:
    """(module, the words that choose the subcommand, its parser) of everything that can be called."""
    for module in MODULES:
        parser = command_of(module)[0]()
        subs = subcommands(parser)
        yield from ((module, [name], sub) for name, sub in subs.items())
        if not subs:
            yield module, [], parser


LEAVES = [pytest.param(*leaf, id=leaf[2].prog) for leaf in leaves()]


def test_every_command_is_checked() -> None:
    """Each file of `cli/` that has a `main` is in these tests."""
    files = Path(cli.__file__).parent.glob("*.py")
    commands = {file.stem for file in files if re.search(r"^(def )?main\b", file.read_text(encoding="utf-8"), re.M)}
    assert commands - {"main", "processes", "zteam_router"} == {name for name in MODULES if name not in PROCESSES}


@pytest.mark.parametrize(("module", "words", "parser"), LEAVES)
def test_an_unknown_option_is_refused_with_the_help_to_see(
    module: str, words: list[str], parser: argparse.ArgumentParser, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line begins with the subcommand, names the option or else what is required, and ends with the help."""
    required = [action for action in parser._actions if action.required and action.nargs != "*"]
    assert exit_code(command_of(module)[1], [*words, "--no-such-option"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{parser.prog}: ")
    told, _, end = line.partition("; see ")
    assert end == f"'{parser.prog} --help'"
    assert "no option '--no-such-option'" in told or "required" in told
    for action in required:
        assert (action.option_strings[-1] if action.option_strings else str(action.metavar or action.dest)) in told


@pytest.mark.parametrize(("module", "words", "parser"), LEAVES)
def test_a_number_is_within_bounds(module: str, words: list[str], parser: argparse.ArgumentParser) -> None:
    """Every numeric option and argument says what it takes."""
    for action in parser._actions:
        try:
            # What is a plain float here is checked with all other options of the simulator.
            number = action.type("1") if callable(action.type) and action.type is not float else None
        except argparse.ArgumentTypeError:
            continue
        for text in BAD if isinstance(number, int | float) else ():
            with pytest.raises(argparse.ArgumentTypeError, match=r"(?s): give |robot id .* is not"):
                pytest.fail(f"{action.dest} {action.type(text)}")  # type: ignore[operator]


def test_a_mistyped_word_is_answered_with_the_right_one(capsys: pytest.CaptureFixture[str]) -> None:
    """Of commands and of subcommands."""
    for name in COMMANDS:
        assert main([f"{name}e"]) == 2
        assert name in capsys.readouterr().err.partition("did you mean ")[2]
    for module, words, _ in leaves():
        for name in words:
            assert exit_code(command_of(module)[1], [f"{name}e"]) == 2
            assert f"no subcommand '{name}e': did you mean {name}" in capsys.readouterr().err
