"""`zteam check`: what it prints, and its exit codes."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.commands import exit_code
from support.pages import DOCS, blocks_of, find_file
from zteam.cli import main as zteam
from zteam.robot.trials import check

FAULTY = """
import math

from zteam import Behavior, View
from zteam.messages import Twist, Vector3

print("imported")


class Blind(Behavior):
    def step(self, view: View) -> Twist:
        print("a line of my own")
        return Twist(Vector3(0.1), Vector3(z=1.0 / float(view.scan.ranges[0])))
"""
SHOWN = """
blind.py:11: step asks for 0.1 m/s, nan rad/s (trial: all beams say nothing (nan))
blind.py:13: step raises ZeroDivisionError: float division by zero (trial: all ranges are 0)
blind:Blind: 2 faults in 22 trials
"""


@pytest.fixture(autouse=True)
def short_drives(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is printed does not depend on how long the behaviour drives in the worlds, nor on other load."""
    monkeypatch.setattr(check, "SECONDS", 1.0)
    monkeypatch.setattr(check, "TICK", 2.0)


@pytest.fixture
def blind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The test stands in a folder with a faulty behaviour, which is forgotten afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path.copy())
    (tmp_path / "blind.py").write_text(FAULTY)
    yield
    sys.modules.pop("blind", None)


@pytest.mark.usefixtures("blind")
def test_each_fault_has_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    """A row for each trial, then each fault once; what the behaviour prints is not among them; exit code 1."""
    assert zteam.main(["check", "blind:Blind"]) == 1
    shown = capsys.readouterr()
    assert shown.err == "imported\n"
    assert shown.out.startswith("in the middle of a room          ok\nall beams say nothing (nan)      WRONG\n")
    assert shown.out.endswith(SHOWN)


@pytest.mark.usefixtures("blind")
def test_the_page_shows_what_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The faulty behaviour of the page of behaviours, and below it what `zteam check` says of it."""
    page = DOCS / "behaviors.md"
    block = find_file("hasty.py", page)
    block.save(tmp_path)
    assert zteam.main(["check", "hasty:Hasty"]) == 1
    sys.modules.pop("hasty")
    told = capsys.readouterr().out.split("\n\n", 1)[1]
    blocks = blocks_of(page)
    assert told == blocks[blocks.index(block) + 1].code


@pytest.mark.usefixtures("blind")
def test_json_is_one_object(capsys: pytest.CaptureFixture[str]) -> None:
    """With --json scripts get the same, and nothing else on standard output."""
    assert zteam.main(["check", "blind:Blind", "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert (told["behavior"], told["good"]) == ("blind:Blind", False)
    (fault,) = next(t for t in told["trials"] if t["name"] == "all ranges are 0")["faults"]
    assert fault["kind"] == "raises"
    assert fault["place"] == "blind.py:13"


def test_a_good_behaviour_ends_with_0(capsys: pytest.CaptureFixture[str]) -> None:
    """A shipped one by its name, with a parameter."""
    assert zteam.main(["check", "avoid", "--param", "speed=0.3"]) == 0
    assert "\n\navoid: no faults in 23 trials\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("wandr", "no behaviour 'wandr' (did you mean wander?)"),
        ("wander --param speed=9", "behaviour wander: speed: "),
        ("wander --param speed", "--param: 'speed' is not KEY=VALUE, e.g. --param speed=0.4"),
        ("path", "behaviour path needs waypoints: give --param waypoints=VALUE"),
    ],
)
def test_a_bad_command_line_is_refused(words: str, line: str, capsys: pytest.CaptureFixture[str]) -> None:
    """One line says what is wrong, nothing is tried, and the exit code is 2."""
    assert exit_code(zteam.main, ["check", *words.split()]) == 2
    shown = capsys.readouterr()
    assert not shown.out
    assert line in shown.err.splitlines()[0]
