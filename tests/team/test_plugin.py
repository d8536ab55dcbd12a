"""The `team` fixture in a user's project."""

import os
import select
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam import Recording
from zteam.team.testing.team import TeamFixture
from zteam.team.testing.watch import TeamFailure

pytest_plugins = "pytester"
pytestmark = [pytest.mark.team, pytest.mark.gate]


def test_a_process_that_dies_fails_the_test_at_once(team: TeamFixture) -> None:
    """A wait for a process that has ended fails with its exit code and its last lines."""
    team.spawn("zteam-robot", "--id", "0", "--behavior", "dance", name="robot_0")
    with pytest.raises(TeamFailure, match=r"^robot_0 ended \(exit code 2\).*dance"):
        team.wait_for_processes("robot_0")
    team.expect_end("robot_0")


def test_teams_of_two_workers_are_separate(pytester: pytest.Pytester) -> None:
    """Under pytest-xdist two teams with the same names run at once, each on its own router."""
    pytester.makepyfile(
        """
        import pytest

        @pytest.mark.parametrize("speed", [0.05, 0.1])
        def test_alone(team, speed):
            team.start("arena", robots=1, behavior="forward", params={0: {"speed": speed}})
            team.wait_for_go()
            team.until(lambda: team.robot(0).speed > 0.01, within=10)
            team.run(1.0)
            assert abs(team.robot(0).speed - speed) < 0.01
            print("WHERE", team.endpoint, team.namespace)
        """
    )
    result = pytester.runpytest_subprocess("-n", "2", "-rP")
    result.assert_outcomes(passed=2)
    where = [line.split()[1:] for line in result.outlines if line.startswith("WHERE")]
    assert len({endpoint for endpoint, _ in where}) == 2
    assert len({namespace for _, namespace in where}) == 2


HANGING = """
from pathlib import Path

def test_hangs(team):
    team.spawn("zteam-sim", "arena", name="sim")
    team.spawn("zteam-robot", "--id", "0", name="robot_0")
    team.wait_for_processes("sim", "robot_0")
    team.pause_process("robot_0")
    # Programs without zteam in them.
    team.spawn("sh", "-c", "sleep 1000 & echo $!; wait", name="helper")
    team.wait_for(lambda: team.lines("helper"))
    pids = [team.pid(name) for name in ("router", "sim", "robot_0", "helper")]
    Path("pids").write_text(" ".join([*map(str, pids), *team.lines("helper")]))
    END
"""


def ended(handles: list[int]) -> bool:
    """Whether the processes of these pidfds end within LIMIT; the others are killed."""
    done = []
    for handle in handles:
        readable, _, _ = select.select([handle], [], [], LIMIT)  # noqa: TID251
        if not readable:
            signal.pidfd_send_signal(handle, signal.SIGKILL)
        os.close(handle)
        done.append(bool(readable))
    return all(done)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_no_process_outlives_pytest(pytester: pytest.Pytester, number: signal.Signals) -> None:
    """However pytest ends during a test, the team's processes end too, a frozen one included, and a program without
    zteam in it with all that it has started."""
    end = "print('READY', flush=True)\n    __import__('signal').pause()"
    path = pytester.makepyfile(HANGING.replace("END", end))
    command = [sys.executable, "-m", "pytest", "-s", "-q", "-p", "no:cacheprovider", str(path)]
    with subprocess.Popen(command, cwd=pytester.path, stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout is not None
        assert any("READY" in line for line in run.stdout)
        handles = [os.pidfd_open(int(pid)) for pid in Path(pytester.path, "pids").read_text().split()]
        run.send_signal(number)
        run.stdout.read()
        run.wait(LIMIT)
        assert ended(handles), "a process outlives pytest"


def test_a_test_that_raises_leaves_nothing(pytester: pytest.Pytester) -> None:
    """After an exception in a test, the next test finds no process of its team."""
    pytester.makepyfile(
        HANGING.replace("END", "raise ValueError")
        + """
def test_after():
    for pid in Path("pids").read_text().split():
        assert not Path("/proc", pid).exists()
"""
    )
    result = pytester.runpytest_subprocess("-p", "no:randomly")
    result.assert_outcomes(failed=1, passed=1)


def test_a_restart_leaves_nothing(team: TeamFixture) -> None:
    """`restart` ends a frozen process first, so that none is left after the test."""
    team.spawn("zteam-sim", "arena", "--paused", name="sim")
    team.spawn("zteam-robot", "--id", "0", name="robot_0")
    team.wait_for_processes("sim", "robot_0")
    frozen = team.pid("robot_0")
    team.pause_process("robot_0")
    team.restart("robot_0")
    assert team.pid("robot_0") != frozen
    assert not Path("/proc", str(frozen)).exists()


def test_an_unnamed_process_gets_a_name_of_its_own(team: TeamFixture) -> None:
    """A process that is spawned without a name does not replace another one of the team."""
    team.start("office", robots=2, behavior="idle")
    known = {name: team.pid(name) for name in ("robot_0", "robot_1")}
    team.expect_end(*(team.spawn("zteam-robot", "--id", str(i)) for i in (21, 22, 23)))
    assert {name: team.pid(name) for name in known} == known


def test_the_plugin_costs_nothing_where_it_is_not_used() -> None:
    """Every pytest run loads the plugin, so it imports neither zenoh nor numpy nor the rest of zteam."""
    code = (
        "import sys, pytest\n"
        "before = set(sys.modules)\n"
        "import zteam.team.testing.plugin\n"
        "print(sorted(set(sys.modules) - before))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=True)
    packages = ["zteam", "zteam.team", "zteam.team.testing"]
    assert done.stdout.strip() == str([*packages, "zteam.team.testing.plugin", "zteam.version"])


READ = """
import pytest
from zteam import Behavior
from zteam.messages import Twist, Vector3

class Guard(Behavior):
    def step(self, view):
        if view.now > 1e9:
            raise ValueError("out of plans")
        return Twist(Vector3(0.3))

def test_crash(team):
    team.start("arena", 1, behavior=Guard)
    team.wait_for_go()
    team.run(5)

def test_refused(team):
    team.start("arena", 1, in_process=True)
    team.sim.move(0, 100.0, 0.0)

def test_of_the_test(team):
    team.start("arena", 1, in_process=True)
    team.until(lambda: team.robot(0).sped > 0, within=1)
"""


def test_the_reason_is_what_a_person_reads_first(pytester: pytest.Pytester) -> None:
    """The summary begins with the reason, no line of zteam's code is shown, and a class of the test file is a
    behaviour."""
    pytester.makepyfile(test_read=READ)
    result = pytester.runpytest_subprocess("-p", "no:randomly", "-p", "no:cacheprovider")
    result.assert_outcomes(failed=3)
    result.stdout.fnmatch_lines(
        [
            "E * zteam.testing.TeamFailure: robot_0 ended (exit code 1): ValueError: out of plans",
            "test_read.py:14: TeamFailure",
            "FAILED test_read.py::test_crash - robot_0 ended (exit code 1): *",
            "FAILED test_read.py::test_refused - robot 0 has no room at x 100*",
            "FAILED test_read.py::test_of_the_test - AttributeError: *",
        ]
    )
    shown = [line for line in result.outlines if "zteam/" in line or "testing/" in line]
    assert not shown, shown


@pytest.mark.parametrize("option", ["-s", "-q"])
def test_lines_are_live_without_capture(pytester: pytest.Pytester, option: str) -> None:
    """With `-s` what a process writes is printed at once, with its name once; otherwise not."""
    pytester.makepyfile(
        """
        import sys

        def test_lines(team):
            team.start("arena", 1)
            team.wait_for_go()
            team.wait_for_line("robot_0", "behaviour ")
            print("TEST GOES ON")
        """
    )
    result = pytester.runpytest_subprocess(option)
    result.assert_outcomes(passed=1)
    output = result.stdout.str()
    assert ("TEST GOES ON" in output) == (option == "-s")
    before = output.partition("TEST GOES ON")[0].splitlines()
    lines = [line for line in before if "behaviour " in line]
    assert len(lines) == (option == "-s")
    assert all(line.count("[robot_0]") == 1 for line in lines)


def test_the_recordings_of_tests_that_fail_are_kept(pytester: pytest.Pytester) -> None:
    """With `--zteam-record`, and the failure has the path; the file is whole."""
    pytester.makepyfile(
        """
        import pytest

        @pytest.mark.parametrize("fails", [False, True])
        def test_drives(team, fails):
            team.start("arena", robots=1, in_process=True)
            team.wait_for_go()
            team.run(1.0)
            assert not fails
        """
    )
    result = pytester.runpytest_subprocess("--zteam-record")
    result.assert_outcomes(passed=1, failed=1)
    (kept,) = (pytester.path / "recordings").iterdir()
    assert str(kept) in result.stdout.str()
    assert Recording(kept).report.is_finished
