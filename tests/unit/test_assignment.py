"""The assignment of docs/teaching.md: its graded file passes the reference solution and tells the wrong ones why."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from support.commands import IMPORTED_FROM
from support.limits import LIMIT
from support.pages import DOCS, find_file

ASSIGNMENT = DOCS / "assignment"
TESTS = ("test_1_avoid_obstacles", "test_2_start_together", "test_3_drive_in_line")
PAGE = DOCS / "teaching.md"
SENTENCES = dict(re.findall(r"^\| `(wrong_\w+\.py)` \| .* \| (.*) \|$", PAGE.read_text(), re.MULTILINE))
"""What the page says that each wrong hand-in fails with."""
WRONG = dict(zip(SENTENCES, TESTS, strict=True))
"""By hand-in: the test that it fails."""


LOOPS = """
from reference import Follower, racer
from zteam import Behavior

class Avoider(Behavior):
    def step(self, view):
        while True:
            pass
"""


def grade(hand_in: str, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run the graded file on a hand-in, a file of the assignment or a text, as a student does."""
    for file in ("test_homework.py", "reference.py"):
        shutil.copy(ASSIGNMENT / file, folder)
    text = (ASSIGNMENT / hand_in).read_text() if hand_in.endswith(".py") else hand_in
    (folder / "homework.py").write_text(text)
    command = [sys.executable, "-m", "pytest", "-rA", "--tb=line", "-p", "zteam.team.testing.plugin", *words]
    # Other plugins take longer to import than the tests take.
    environment = {**os.environ, "PYTHONPATH": IMPORTED_FROM, "COLUMNS": "200", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=3 * LIMIT, check=False
    )


@pytest.mark.ci
def test_the_reference_passes(tmp_path: Path) -> None:
    """The reference solution passes all three exercises."""
    done = grade("reference.py", tmp_path, "test_homework.py")
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.findall(r"^PASSED test_homework.py::(\w+)$", done.stdout, re.MULTILINE) == [*TESTS]


@pytest.mark.ci
@pytest.mark.parametrize("hand_in", WRONG)
def test_a_wrong_hand_in_is_told_why(hand_in: str, tmp_path: Path) -> None:
    """It fails its exercise with the page's sentence. What it has of the others is the reference's."""
    done = grade(hand_in, tmp_path, f"test_homework.py::{WRONG[hand_in]}")
    assert done.returncode == 1, done.stdout + done.stderr
    failed = re.findall(r"^FAILED test_homework.py::(\w+) - AssertionError: (.*)$", done.stdout, re.MULTILINE)
    assert failed == [(WRONG[hand_in], SENTENCES[hand_in])]


@pytest.mark.ci
def test_a_hand_in_that_loops_fails_its_exercise_alone(tmp_path: Path) -> None:
    """The page's command names the line of the loop, grades the other exercises, and writes a row for each."""
    found = re.search(r"pytest -q --tb=line (--show-capture=no .* test_homework.py)", PAGE.read_text())
    assert found is not None
    done = grade(LOOPS, tmp_path, "-p", "pytest_timeout", *found[1].split())
    assert done.returncode == 1, done.stdout + done.stderr
    assert re.findall(r"^FAILED test_homework.py::(\w+)", done.stdout, re.MULTILINE) == [TESTS[0]]
    rows = ElementTree.parse(tmp_path / "result.xml").getroot().iter("testcase")
    failures = {row.get("name"): [failure.get("message", "") for failure in row] for row in rows}
    assert list(failures) == [*TESTS]
    assert [*map(len, failures.values())] == [1, 0, 0]
    assert "robot_0 hangs: after 10 s step has not returned" in failures[TESTS[0]][0]


def test_every_wrong_hand_in_is_on_the_page() -> None:
    """The page tells of the hand-ins that there are, and shows a test as it is in the graded file."""
    assert {path.name for path in ASSIGNMENT.glob("wrong_*.py")} == {*SENTENCES}
    assert find_file("test_homework_1.py", PAGE).code in (ASSIGNMENT / "test_homework.py").read_text()
