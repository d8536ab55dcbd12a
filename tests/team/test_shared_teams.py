"""`team_module` and `team_session`: each test finds the team as `start` left it."""

import pytest

pytest_plugins = "pytester"
pytestmark = [pytest.mark.team, pytest.mark.gate]

DRIVE = """
import os, pathlib, signal
import pytest

CALL = dict(world="arena", robots=2, follow={1: 0}, seed=7)

def drive(team):
    team.wait_for_go()
    team.run(3)
    return team.report.trajectory_sha256
"""
PUT_BACK = """
@pytest.fixture(scope="module")
def line(team_module):
    team_module.start(**CALL, in_process=HERE, chaos=not HERE)
    return team_module

WAYS = {
    "nothing": lambda line: None,
    "stop": lambda line: line.stop(),
    "moved": lambda line: (line.sim.move(0, 2.0, 3.5), line.sim.spawn(1.0, 3.0)),
    "ended": lambda line: line.stop("robot_1"),
}
if not HERE:
    WAYS |= {
        "killed": lambda line: line.kill("robot_1"),
        "spawned": lambda line: line.spawn("zteam-robot", "--id", "7", name="robot_7"),
        "frozen simulator": lambda line: line.pause_process("sim"),
        "router": lambda line: line.kill("router"),
    }

def test_fresh(team):
    team.start(**CALL, in_process=HERE)
    pathlib.Path("hash").write_text(drive(team))

@pytest.mark.parametrize("way", WAYS)
def test_put_back(line, way):
    assert (line.tick, line.robot(0).distance_travelled) == (1, 0.0)
    assert "robot_7" not in line._run.supervisor.members
    assert line.sim_status.stopped == []
    assert drive(line) == pathlib.Path("hash").read_text()
    assert line.robot(0).distance_travelled > 0.3
    WAYS[way](line)

def test_after_all(line):
    assert drive(line) == pathlib.Path("hash").read_text()
"""


@pytest.mark.parametrize("here", [True, False], ids=["one process", "processes"])
def test_every_test_finds_the_team_as_at_its_start(pytester: pytest.Pytester, here: bool) -> None:
    """Whatever the test before did, the run has the hash of a fresh team; broken or not, the team is made anew."""
    pytester.makepyfile(f"HERE = {here}\n{DRIVE}{PUT_BACK}")
    result = pytester.runpytest_subprocess("-p", "no:randomly", "-p", "no:xdist")
    result.assert_outcomes(passed=6 if here else 10)


LOGS = """
@pytest.fixture(scope="module")
def alone(team_module):
    team_module.start("arena", 1)
    return team_module

def test_first(alone):
    alone.wait_for_go()
    alone.spawn("zteam", "behaviors", name="only_of_the_first")
    alone.wait_for_line("only_of_the_first", "wander")

def test_fails(alone):
    alone.wait_for_go()
    os.kill(alone.pid("robot_0"), signal.SIGKILL)
    alone.wait_for(lambda: False)

def test_next(alone):
    alone.wait_for_go()
    assert alone.alive("robot_0")
"""


def test_a_failed_test_shows_its_own_lines(pytester: pytest.Pytester) -> None:
    """Its report has no line of an earlier test; the next test has the killed robot again."""
    pytester.makepyfile(DRIVE + LOGS)
    result = pytester.runpytest_subprocess("-p", "no:randomly", "-p", "no:xdist")
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines(["*processes of the team*", "FAILED *test_fails - robot_0 ended *"])
    assert not [line for line in result.outlines if line.startswith("[only_of_the_first]")]


SESSION = """
def test_starts(team_session):
    team_session.start(**CALL, in_process=True)
    drive(team_session)
    with pytest.raises(Exception, match="a test has one team"):
        team_session.start("arena", in_process=True)

def test_starts_the_same(team_session):
    team_session.start(**CALL, in_process=True)
    drive(team_session)

def test_starts_another(team_session):
    team_session.start("arena", 1, in_process=True)
    assert not team_session.alive("robot_1")
    team_session.wait_for_go()

def test_refused(team_session):
    with pytest.raises(Exception, match="no behaviour"):
        team_session.start("arena", 1, behavior="dance", in_process=True)

def test_starts_after_that(team_session, team):
    team_session.start(**CALL, in_process=True)
    drive(team_session)
"""


def test_a_test_may_start_the_team_of_a_session(pytester: pytest.Pytester) -> None:
    """A later start with the same arguments finds the team put back; with others it is another team; each file may."""
    pytester.makepyfile(test_a=DRIVE + SESSION, test_b=DRIVE + SESSION)
    result = pytester.runpytest_subprocess("-p", "no:randomly", "-p", "no:xdist")
    result.assert_outcomes(passed=10)
