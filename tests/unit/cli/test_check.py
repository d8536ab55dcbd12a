"""`zteam check`: what it prints, and its exit codes."""

import json
import sys
from pathlib import Path

import pytest

from support.commands import Run
from support.pages import DOCS, blocks_of, find_file
from zteam.robot.trials import check

LOUD = """
class Loud(list):
    def append(self, x):
        print("mine")
        super().append(x)

Hasty.seen = Loud()
print("imported")
"""


@pytest.fixture(autouse=True)
def short_drives(empty_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is printed does not depend on how long the behaviour drives in the worlds, nor on other load."""
    monkeypatch.setattr(sys, "path", sys.path.copy())
    monkeypatch.setattr(check, "SECONDS", 1.0)
    monkeypatch.setattr(check, "TICK", 2.0)


def test_each_fault_has_a_line(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """A row for each trial, then each fault once, as the page of behaviours shows it; what the behaviour prints is not
    among them. The exit code is 1. With --json scripts get the same, and nothing else on standard output."""
    page = DOCS / "behaviors.md"
    block = find_file("hasty.py", page)
    with block.save(Path()).open("a") as file:
        file.write(LOUD)
    tried, run_trials = [], check.run_trials
    monkeypatch.setattr(check, "run_trials", lambda *named: tried.extend(run_trials(*named)) or tried)
    out, err = run("zteam check hasty:Hasty", 1)
    rows, told = out.split("\n\n", 1)
    assert err == "imported\n"
    assert rows.splitlines()[0] == "in the middle of a room          WRONG"
    blocks = blocks_of(page)
    assert told == blocks[blocks.index(block) + 1].code
    monkeypatch.setattr(check, "run_trials", lambda *_: tried)
    answer = json.loads(run("zteam check hasty:Hasty --json", 1).out)
    assert (answer["behavior"], answer["good"]) == ("hasty:Hasty", False)
    assert {fault["place"].partition(":")[0] for t in answer["trials"] for fault in t["faults"]} == {"hasty.py"}


def test_a_good_behaviour_ends_with_0(run: Run) -> None:
    """A shipped one by its name, with a parameter."""
    assert "\n\navoid: no faults in " in run("zteam check avoid --param speed=0.3").out
