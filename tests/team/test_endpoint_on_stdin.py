"""A process that reads its router's endpoint from standard input (`--connect -`)."""

import signal
import subprocess
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam.clock import monotonic
from zteam.team.launch.process import zteam_command
from zteam.team.testing.team import TeamFixture

pytestmark = pytest.mark.team


def waiting(*arguments: str) -> "subprocess.Popen[str]":
    """A robot that waits for the endpoint on its standard input."""
    return subprocess.Popen(
        zteam_command("zteam-robot", "--id", "0", *arguments, "--connect", "-"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def takes_signals(pid: int) -> bool:
    """Whether a process handles SIGTERM within LIMIT."""
    deadline = monotonic() + LIMIT
    while monotonic() < deadline:
        for line in (Path("/proc") / str(pid) / "status").read_text().splitlines():
            if line.startswith("SigCgt:") and int(line.split()[1], 16) & 1 << (signal.SIGTERM - 1):
                return True
    return False


def test_the_endpoint_comes_by_line(team: TeamFixture) -> None:
    """After one line the process is present at that router."""
    with waiting("--namespace", team.namespace) as robot:
        assert robot.stdin is not None
        robot.stdin.write(team.endpoint + "\n")
        robot.stdin.flush()
        team.wait_for_processes("robot_0")
        robot.terminate()
        robot.communicate(timeout=LIMIT)
        assert robot.returncode == 0


def test_no_endpoint_is_one_line() -> None:
    """If the input ends without an endpoint, the process ends with one line that names the option."""
    with waiting() as robot:
        output, _ = robot.communicate(timeout=LIMIT)
    assert robot.returncode == 1
    assert len(output.splitlines()) == 1
    assert "--connect -" in output


def test_a_stop_ends_the_wait() -> None:
    """A stop before the endpoint is known ends the process at once with exit code 0."""
    with waiting() as robot:
        assert takes_signals(robot.pid)
        robot.terminate()
        # communicate() would close the input, which ends the wait as well.
        robot.wait(LIMIT)
        output, _ = robot.communicate(timeout=LIMIT)
    assert (robot.returncode, output) == (0, "")
