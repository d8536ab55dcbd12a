"""`zteam new`: what it writes works, and it writes nothing over what is there."""

import subprocess
import sys
from pathlib import Path

import pytest

from support.commands import IMPORTED_FROM
from support.limits import LIMIT
from zteam.cli import main as zteam
from zteam.cli import new
from zteam.testing import find_faults


def written(empty_folder: Path) -> list[str]:
    """The names of all files in the folder."""
    return sorted(path.name for path in empty_folder.iterdir())


@pytest.mark.ci
@pytest.mark.parametrize(("kind", "name"), [("behavior", "my_robot"), ("node", "crowd_watch")])
def test_the_example_and_its_test_work(
    kind: str, name: str, empty_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In an empty folder the written test passes under pytest, in an interpreter of its own."""
    assert zteam.main(["new", kind, name]) == 0
    assert written(empty_folder) == [f"{name}.py", f"test_{name}.py"]
    assert capsys.readouterr().out.startswith(f"wrote {name}.py and test_{name}.py\n")
    monkeypatch.setenv("PYTHONPATH", IMPORTED_FROM)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"test_{name}.py"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=3 * LIMIT, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert " passed" in done.stdout


@pytest.mark.ci
def test_the_example_passes_the_check(empty_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`zteam check` finds nothing wrong with the written behaviour."""
    assert zteam.main(["new", "behavior", "my_checked"]) == 0
    monkeypatch.syspath_prepend(empty_folder)
    assert find_faults("my_checked:MyChecked") == []


@pytest.mark.ci
@pytest.mark.parametrize("kind", new.KINDS)
def test_the_examples_are_tidy(kind: str, empty_folder: Path) -> None:
    """ruff has nothing to say of them with its own settings, nor mypy with its strict ones."""
    ruff, mypy = pytest.importorskip("ruff"), pytest.importorskip("mypy")
    assert zteam.main(["new", kind, "my_example"]) == 0
    for module, *words in (
        (ruff, "check", "--isolated", "--select", "E,F,W,I,B,UP,N,SIM,RET,RUF", "."),
        (ruff, "format", "--isolated", "--check", "."),
        (mypy, "--strict", "my_example.py", "test_my_example.py"),
    ):
        command = [sys.executable, "-m", module.__name__, *words]
        done = subprocess.run(command, capture_output=True, text=True, timeout=3 * LIMIT, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


def test_the_lines_say_what_to_do_next(empty_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The module and the class are the written ones."""
    assert zteam.main(["new", "behavior", "my_robot"]) == 0
    lines = capsys.readouterr().out
    for command in (
        "pytest test_my_robot.py ",
        "zteam check my_robot:MyRobot ",
        "zteam-robot --id 0 --behavior my_robot:MyRobot ",
    ):
        assert f"\n{command}" in lines
    assert "class MyRobot(Behavior):" in (empty_folder / "my_robot.py").read_text()


@pytest.mark.parametrize("taken", ["my_robot.py", "test_my_robot.py"])
def test_nothing_is_overwritten(taken: str, empty_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """If one of the two files exists, neither is written."""
    (empty_folder / taken).write_text("mine")
    assert zteam.main(["new", "behavior", "my_robot"]) == 2
    assert capsys.readouterr().err == (f"zteam new: {taken} exists already; choose another name, or remove the file\n")
    assert written(empty_folder) == [taken]
    assert (empty_folder / taken).read_text() == "mine"


def test_a_folder_that_is_gone_is_said(empty_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing can be written there: one line, and exit code 1."""
    empty_folder.rmdir()
    assert zteam.main(["new", "node", "watch"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("zteam new: cannot write watch") and line.endswith(": No such file or directory")
