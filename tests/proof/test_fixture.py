"""Tests of a user's own."""

import re
from pathlib import Path

import pytest

from zteam.testing import Team

pytest_plugins = "pytester"
pytestmark = pytest.mark.team


PROJECT = """
def test_line(team):
    team.start("arena", robots=2, follow={1: 0})
    team.wait_for_go()
    team.until(lambda: team.robot(1).distance_travelled > 0.3, within=30)

def test_fails(team):
    team.spawn("zteam-sim", "arena", name="sim")
    team.wait_for_line("sim", "2 robots")
    assert team.robot(7).commands == 1

def test_fails_alone():
    assert 1 == 2
"""
OWN = """
from zteam import Behavior
from zteam.messages import Twist, Vector3

class Raises(Behavior):
    def step(self, view):
        if view.now > 1_000_000_000:
            self.fail()
        return Twist(Vector3(0.1))

    def fail(self):
        raise ValueError("out of plans")
"""


@pytest.mark.gate
def test_a_failure_shows_the_output_of_the_processes(pytester: pytest.Pytester) -> None:
    """Five lines in a user's project test a team, and only a test that fails shows what each of its processes said."""
    pytester.makepyfile(PROJECT)
    result = pytester.runpytest_subprocess("-W", "error", "-rA")
    result.assert_outcomes(passed=1, failed=2)
    lines = result.stdout.str()
    first, _, second = lines.partition("_ test_fails_alone _")
    failed, _, passed = second.partition("= PASSES =")
    assert "processes of the team" in first
    assert re.search(r"^\[sim\] .*arena: 2 robots", first, re.MULTILINE)
    assert "processes of the team" not in failed
    assert "test_line" in passed
    assert "processes of the team" not in passed


@pytest.mark.few(1)
@pytest.mark.parametrize("in_process", [False, True])
def test_a_behavior_that_raises_fails_the_call_and_the_end(team: Team, empty_folder: Path, in_process: bool) -> None:
    """A behaviour that raises fails its test with the user's error and lines, in processes and in one process."""
    (empty_folder / "bad_ways.py").write_text(OWN)
    team.start("arena", 1, behavior="bad_ways:Raises", in_process=in_process)
    team.wait_for_go()
    for call in (lambda: team.run(3), lambda: team.robot(0), team.check_at_end):
        with pytest.raises(AssertionError) as told:
            call()
        first, *frames = str(told.value).splitlines()
        assert first == "robot_0 ended (exit code 1): ValueError: out of plans"
        places = [line.split("/")[-1] for line in frames if line.startswith("  File")]
        assert places == ['bad_ways.py", line 8, in step', 'bad_ways.py", line 12, in fail']
    team.expect_end("robot_0")
    team.run(1)
