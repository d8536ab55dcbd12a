"""A team where the system gives little: it works, or says in one line what is missing and the way out."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from support.clock_offset import build_clock
from support.limits import LIMIT
from zteam.team.launch.process import zteam_command
from zteam.testing import Team

pytestmark = pytest.mark.team

UP = " ".join(zteam_command("zteam", "up", "arena", "--for", "1", "--lockstep"))
BARE = """
mkdir small && mount -t tmpfs -o size=4k none small || exit 77
mount -t tmpfs -o ro none /dev/shm && mount -o remount,ro,bind / || exit 77
cd small
dd if=/dev/zero of=rest bs=1k count=64 2>/dev/null
touch /written $HOME/written 2>/dev/null && exit 78
TMPDIR=$PWD {up} --report report.json
"""
"""The disk of the current and the temporary folder is full; all else can only be read, the home folder too."""


def run(script: str, folder: Path, *before: str, **environment: str | None) -> "subprocess.CompletedProcess[str]":
    """Run a script of the shell in a folder; a variable of value None is taken away."""
    given = {key: value for key, value in {**os.environ, **environment}.items() if value is not None}
    command = (*before, "bash", "-c", script)
    return subprocess.run(
        command, capture_output=True, text=True, env=given, cwd=folder, timeout=4 * LIMIT, check=False
    )


def trajectory(done: "subprocess.CompletedProcess[str]") -> str:
    """The hash of the run."""
    found = re.search(r"lock-step: trajectory (\w+)", done.stdout)
    assert found, done.stdout + done.stderr
    return found[1]


def test_a_run_needs_no_disk_no_shared_memory_and_no_home(tmp_path: Path) -> None:
    """On full and read-only disks, without /dev/shm, a run is the same; a report that cannot be written is named."""
    if os.geteuid() or shutil.which("unshare") is None:
        pytest.skip("only root may mount file systems of its own")
    done = run(BARE.format(up=UP), tmp_path, "unshare", "-m")
    if done.returncode == 77:
        pytest.skip(f"no file system can be mounted here: {done.stderr}")
    assert done.returncode == 1, done.stdout + done.stderr
    assert done.stderr.count("cannot write: No space left on device") == 1
    without = run(f"ulimit -n 64; {UP}", tmp_path, HOME=None)
    assert (without.returncode, trajectory(without)) == (0, trajectory(done))


@pytest.mark.parametrize(("limit", "way_out"), [("-n 12", "ulimit -n"), ("-v 260000", "ulimit -v")])
def test_a_limit_that_is_too_low_is_named(tmp_path: Path, limit: str, way_out: str) -> None:
    """With too few descriptors or too little memory one line names the limit to raise; there is no traceback."""
    done = run(f"ulimit {limit}; {UP}", tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    (line,) = (line for line in done.stderr.splitlines() if line.startswith("up: "))
    assert way_out in line


@pytest.mark.real_time
def test_a_clock_that_is_set_back_changes_nothing(team: Team, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The host's clock goes back by an hour in the middle of a run: the robots drive on, and nothing is told of it."""
    mark = tmp_path / "mark"
    clock = {"LD_PRELOAD": build_clock(tmp_path), "CLOCK_OFFSET_NS": -3600 * 10**9, "CLOCK_OFFSET_FROM": mark}
    for name, value in {**clock, "ZTEAM_NO_FORK": 1}.items():
        monkeypatch.setenv(name, str(value))
    team.start("arena", 2, follow={1: 0}, lockstep=False)
    team.wait_for_go()
    team.run(1.0)
    mark.touch()
    # Those that run read that clock for their logs alone; one that begins tells with it when it began.
    team.restart("monitor")
    team.wait_for(lambda: Path(f"{mark}.{team.pid('monitor')}").exists())
    before = [team.robot(i).distance_travelled for i in (0, 1)]
    team.until(lambda: all(team.robot(i).distance_travelled > before[i] + 0.3 for i in (0, 1)), within=60)
    assert team.is_go
    # Not what came late: on a crowded machine some messages do, and if the clock made them late, no robot would drive.
    amiss = re.compile("error:|clock|time jumped")
    assert not [line for _, line in team._watch.log if amiss.search(line)]
