"""A system without /proc, os.waitid, os.fork and process descriptors, as far as Linux can show one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam.team.launch.process import zteam_command

pytestmark = pytest.mark.team

HIDES = """
import os, sys

for name in ("waitid", "fork", "pidfd_open"):
    delattr(os, name)


def refuse(event, arguments):
    if event == "open" and str(arguments[0]).startswith("/proc"):
        raise FileNotFoundError(arguments[0])


sys.addaudithook(refuse)
"""
FIXTURE = """
import os

import pytest


@pytest.mark.parametrize("in_process", [False, True])
def test_it(team, in_process):
    assert not hasattr(os, "waitid")
    team.start("arena", in_process=in_process)
    team.wait_for_go()
    team.run(1.0)
    assert team.robot(0).distance_travelled > 0.0
"""


def run(folder: Path, *command: str) -> "subprocess.CompletedProcess[str]":
    """Run a command that is without them, as are the processes that it starts."""
    (folder / "sitecustomize.py").write_text(HIDES)
    environment = {**os.environ, "PYTHONPATH": str(folder), "ZTEAM_NO_FORK": "1"}
    return subprocess.run(
        command, capture_output=True, text=True, env=environment, cwd=folder, timeout=4 * LIMIT, check=False
    )


@pytest.mark.parametrize("mode", [(), ("--in-process",)])
def test_a_team_runs_without_them(tmp_path: Path, mode: tuple[str, ...]) -> None:
    """To its end, with a report; figures of memory are missing."""
    done = run(tmp_path, *zteam_command("zteam", "up", "arena", "--for", "2", "--lockstep", *mode))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 MB together" in done.stdout
    assert "lock-step: trajectory" in done.stdout


def test_the_fixture_works_without_them(tmp_path: Path) -> None:
    """With processes, and in the process of the test."""
    (tmp_path / "test_it.py").write_text(FIXTURE)
    done = run(tmp_path, sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 passed" in done.stdout
