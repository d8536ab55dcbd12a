"""A lab's own project, whose modules only pytest finds: what passes there, what fails, and with which words."""

from pathlib import Path

import pytest

pytest_plugins = "pytester"
pytestmark = [pytest.mark.team, pytest.mark.gate]

GUARD = """
from zteam import Behavior
from zteam.messages import Twist, Vector3
from lab.speeds import SPEED

class Guard(Behavior):
    def step(self, view):
        return Twist(Vector3(SPEED))
"""
COUNTER = """
import os, sys, time
import zteam
from lab.speeds import SPEED

def main(node):
    def step(now):
        if now >= 3_000_000_000 and "raises" in sys.argv:
            raise ValueError("three seconds are over")
        if now >= 3_000_000_000 and "vanishes" in sys.argv:
            os._exit(7)
        if now >= 3_000_000_000 and "sleeps" in sys.argv:
            time.sleep(1000)
    node.run(step)

def raises(node):
    sys.argv.append("raises")
    main(node)

if __name__ == "__main__":
    zteam.run("counter", main)
"""
STARTS = """
import os, subprocess, sys
from contextlib import contextmanager
from pathlib import Path
import pytest
from lab.guard import Guard

@contextmanager
def counter(team, *words):
    command = [sys.executable, "-m", "lab.counter", *words]
    node = subprocess.Popen(command, env={**os.environ, **team.environment})
    try:
        yield node
    finally:
        node.terminate()
        node.wait(60)

def start(team, **how):
    team.start("arena", 1, behavior="lab.guard:Guard", **how)
    team.wait_for_go()
"""
PASSING = """
@pytest.mark.parametrize("in_process", [False, True])
def test_a_node_by_its_name(team, in_process):
    start(team, nodes={"crowd": "lab.counter:main"}, in_process=in_process)
    team.run(2)
    assert team.robot(0).distance_travelled > 0.1
    assert "crowd" in team.sim_status.participants

@pytest.mark.parametrize("lockstep", [False, True])
def test_a_node_by_popen(team, lockstep):
    with counter(team):
        start(team, expect=["counter"], lockstep=lockstep)
        team.run(2)

def test_a_node_that_the_test_ends(team):
    with counter(team) as node:
        start(team, expect=["counter"])
        team.expect_end("counter")
        node.terminate()
        team.run(2)

def test_programs(team, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("tool.py").write_text("import lab.guard, sys; print(lab.guard.SPEED, *sys.argv[1:])")
    start(team)
    team.spawn("python", "tool.py", 7, name="tool")
    team.spawn("sh", "-c", "pwd; echo $ZTEAM_NAMESPACE", name="shell")
    team.spawn(sys.executable, "-m", "lab.counter", name="counter")
    team.spawn("zteam", "behaviors", "lab.guard:Guard", name="behaviors")
    team.wait_for_processes("counter")
    assert [team.wait_for_exit(name) for name in ("tool", "shell", "behaviors")] == [0, 0, 0]
    assert (team.lines("tool"), team.lines("shell")) == (["0.2 7"], [str(tmp_path), team.namespace])
    team.run(1)
"""
FAILING = """
@pytest.mark.parametrize("lockstep", [False, True])
@pytest.mark.parametrize("how", ["raises", "vanishes"])
def test_a_node_by_popen(team, how, lockstep):
    with counter(team, how):
        start(team, expect=["counter"], lockstep=lockstep)
        team.run(60 if how == "vanishes" else 20)

def test_a_node_that_hangs(team):
    with counter(team, "sleeps") as node:
        start(team, expect=["counter"], lockstep_timeout=3.0)
        try:
            team.run(20)
        finally:
            node.kill()

def test_a_program(team):
    start(team)
    team.spawn(sys.executable, "-m", "lab.counter", "raises", name="counter")
    team.wait_for_processes("counter")
    team.run(20)

def test_a_node_by_its_name(team):
    start(team, nodes={"counter": "lab.counter:raises"})
    team.run(20)
"""


OWN_CLASS = """
from zteam import Behavior
from zteam.messages import Twist, Vector3

class Here(Behavior):
    def step(self, view):
        return Twist(Vector3(0.2))

@pytest.mark.parametrize("in_process", [False, True])
def test_of_the_test_file(team, in_process):
    team.start("arena", 1, behavior=f"{__name__}:Here", in_process=in_process)
    team.wait_for_go()
    team.run(2)
    assert team.robot(0).distance_travelled > 0.1
"""


def make_lab(folder: Path, test: str, *, importmode: str = "prepend") -> Path:
    """The lab's project in `folder`: one exercise with a source folder that only pytest's settings name."""
    files = {
        "pyproject.toml": f'[tool.pytest.ini_options]\npythonpath = ["src"]\naddopts = "--import-mode={importmode}"\n',
        "src/lab/__init__.py": "",
        "src/lab/speeds.py": "SPEED = 0.2\n",
        "src/lab/guard.py": GUARD,
        "src/lab/counter.py": COUNTER,
        "tests/test_lab.py": STARTS + test,
    }
    for name, text in files.items():
        path = folder / "hw1" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder / "hw1"


def test_a_lab_finds_its_modules_everywhere(pytester: pytest.Pytester) -> None:
    """From above the exercise, with xdist: behaviours, nodes by name and by Popen, and programs find what the test
    finds, and what the test ends by itself is no failure."""
    make_lab(pytester.path, PASSING)
    result = pytester.runpytest_subprocess("hw1", "-n", "2", "-p", "no:cacheprovider")
    result.assert_outcomes(passed=6)


@pytest.mark.parametrize("importmode", ["prepend", "importlib"])
def test_a_behavior_may_stand_in_the_test(pytester: pytest.Pytester, importmode: str) -> None:
    """However pytest imports the file: the children find it by the name that it has there."""
    make_lab(pytester.path, OWN_CLASS, importmode=importmode)
    result = pytester.runpytest_subprocess("hw1", "-p", "no:cacheprovider")
    result.assert_outcomes(passed=2)


@pytest.mark.real_time
def test_what_takes_part_fails_the_test_when_it_ends(pytester: pytest.Pytester) -> None:
    """An error (with its text and line), an end without one and a hang fail the test, in both paces."""
    make_lab(pytester.path, FAILING)
    result = pytester.runpytest_subprocess("hw1", "-n", "2", "-p", "no:cacheprovider")
    result.assert_outcomes(failed=7)
    told = [line.partition("TeamFailure: counter ")[2] for line in result.outlines if line.startswith("E  ")]
    assert sum("ValueError: three seconds are over" in line for line in told) == 4, told
    assert sum(line.startswith("is gone, without team.expect_end") for line in told) == 2, told
    assert sum(line.startswith("hangs") for line in told) == 1, told
    result.stdout.re_match_lines([r"E +File .*counter.py\", line \d+, in step"])
