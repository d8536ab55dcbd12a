"""A process of the team that ends or hangs unasked fails the test of the `team` fixture."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from zteam.clock import HOST_FACTOR, monotonic
from zteam.testing import Team

pytestmark = [pytest.mark.team, pytest.mark.gate]
pytest_plugins = "pytester"

OWN = """
import pathlib, time
from zteam import Behavior
from zteam.messages import Twist, Vector3

class Loops(Behavior):
    def step(self, view):
        while view.now > 1_000_000_000:  # Loops
            pathlib.Path("looping").touch()
            try:
                pass
            except Exception:
                pass
        return Twist(Vector3(0.1))

class Sleeps(Behavior):
    def step(self, view):
        if view.now > 1_000_000_000:
            pathlib.Path("looping").touch()
            time.sleep(1000)  # Sleeps
        return Twist(Vector3(0.1))
"""
RETURNING = """
[team]
world = "arena"
restart = "on-failure"
[[robots]]
id = 0
behavior = "returns:Returns"
"""
RETURNS = """
import pathlib, zteam
from zteam.messages import Twist

class Returns(zteam.Behavior):
    def step(self, view):
        mark = pathlib.Path(__file__).parent / "mark"
        if not mark.exists():
            mark.touch()
            raise RuntimeError("the first of its kind")
        return Twist()
"""


@pytest.fixture
def folder(empty_folder: Path) -> Path:
    """With the behaviours of these tests."""
    (empty_folder / "bad_ways.py").write_text(OWN)
    return empty_folder


@pytest.fixture
def next_team() -> Iterator[Team]:
    """The team of a test that follows."""
    team = Team()
    yield team
    team.close()


@pytest.mark.parametrize("lockstep", [True, pytest.param(False, marks=pytest.mark.real_time)])
def test_a_loop_in_one_process_is_named_and_ended(team: Team, next_team: Team, folder: Path, lockstep: bool) -> None:
    """The failure has the user's line; the loop ends, so that the next team is not held up."""
    team.start("arena", 1, behavior="bad_ways:Loops", in_process=True, lockstep=lockstep, lockstep_timeout=HOST_FACTOR)
    team.wait_for_go()
    with pytest.raises(
        AssertionError,
        match=rf"^robot_0 hangs: after {HOST_FACTOR:g} s step has not returned .*bad_ways\.py:\d+",
    ):
        team.until(lambda: False, within=60)
    team.expect_end("robot_0")
    assert team.wait_for_exit("robot_0") is not None
    next_team.start("arena", 1, in_process=True)
    next_team.wait_for_go()
    next_team.run(1)


LIMIT = 2.0 * HOST_FACTOR
"""Host seconds after which a hang is one."""
WAITS: dict[str, Callable[[Team], object]] = {
    "run": lambda team: team.run(600),
    "until": lambda team: team.until(lambda: False, within=600),
}


@pytest.mark.parametrize(("wait", "way"), [("run", "Loops"), ("run", "Sleeps"), ("until", "Loops")])
def test_a_process_that_hangs_is_named_in_time(team: Team, folder: Path, wait: str, way: str) -> None:
    """Every wait fails while it waits, with the user's line and traceback, once; the rest of the team lives."""
    team.start("arena", 2, behavior=f"bad_ways:{way}", follow={1: 0}, lockstep_timeout=LIMIT)
    team.wait_for_go()
    began = monotonic()
    with pytest.raises(AssertionError) as told:
        WAITS[wait](team)
    assert monotonic() - began < LIMIT + 5.0 * HOST_FACTOR
    first, *rest = str(told.value).splitlines()
    line = next(k for k, text in enumerate(OWN.splitlines(), 1) if text.endswith(f"# {way}"))
    lines = range(line, line + 5) if way == "Loops" else [line]
    assert first in [
        f"robot_0 hangs: after {LIMIT:g} s step has not returned ({folder}/bad_ways.py:{n})" for n in lines
    ]
    assert rest[0] == "Traceback (most recent call last):"
    assert len([text for text in rest if "bad_ways.py" in text]) == 1
    assert not any("/zteam/" in text for text in rest)
    team.expect_end("robot_0")
    team.run(0.5)
    assert team.alive("robot_1")


def test_what_is_started_again_is_no_failure_if_it_comes_back(team: Team, folder: Path) -> None:
    """The end of the test waits until it is there."""
    (folder / "returns.py").write_text(RETURNS)
    (folder / "team.toml").write_text(RETURNING)
    team.launch(folder / "team.toml", in_process=True)
    team.wait_for_go()
    team.run(1)
    assert any("RuntimeError: the first of its kind" in line for line in team.lines("robot_0"))
    team.check_at_end()
    assert team.alive("robot_0")


def test_the_end_of_a_test_looks_once_more(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that ends after the last call fails the test itself, not its teardown, unless that is expected."""
    pytester.makepyfile(
        """
        def spawn(team):
            team.spawn("zteam-robot", "--id", "0", "--behavior", "dance", name="robot_0")
            # The end of the process is no call of the fixture.
            assert team._run.supervisor.processes["robot_0"].join(60)

        def test_forgotten(team):
            spawn(team)

        def test_expected(team):
            team.expect_end("robot_0")
            spawn(team)
        """
    )
    monkeypatch.setenv("COLUMNS", "200")
    result = pytester.runpytest_subprocess()
    result.assert_outcomes(failed=1, passed=1)
    reason = r"robot_0 ended \(exit code 2\): .*no behaviour 'dance'"
    # Alone, and in the short summary.
    result.stdout.re_match_lines([f"^{reason}", "^FAILED .*test_forgotten - robot_0 ended"])
