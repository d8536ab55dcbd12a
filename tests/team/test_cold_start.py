"""A team on a machine that has not compiled the simulator's kernels yet."""

import json
import os
import re
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest

from support.limits import LIMIT
from zteam.launch.process import zteam_command
from zteam.sim.jit import SIMULATOR
from zteam.testing.team import TeamFixture

pytestmark = pytest.mark.team


def up(folder: Path, *arguments: str) -> tuple[str, dict[str, Any]]:
    """Run the shipped line with the cache in `folder`; its output and its report."""
    done = subprocess.run(
        zteam_command("zteam", "up", "line", "--for", "1", "--report", "r.json", *arguments),
        cwd=folder,
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=2 * LIMIT,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout, json.loads((folder / "r.json").read_text())


@pytest.mark.real_time
def test_a_team_drives_before_anything_is_compiled(team: TeamFixture, tmp_path: Path) -> None:
    """In real time the robots drive before the kernels are compiled, and the team ends in order."""
    where = ("--connect", team.endpoint, "--namespace", team.namespace)
    with subprocess.Popen(
        zteam_command("zteam", "up", "line", *where),
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as launcher:
        try:
            team.wait_for(lambda: all(team.robot(i).distance_travelled > 0.05 for i in range(4)))
            # Those of the behaviours are three, and soon there.
            assert not list((tmp_path / "cache").glob(f"complete-{SIMULATOR.name}-*"))
        finally:
            launcher.send_signal(signal.SIGINT)
            output, _ = launcher.communicate(timeout=LIMIT)
    assert launcher.returncode == 0, output
    assert output.index("on numpy while their kernels are compiled") < output.index("All robots GO!")


@pytest.mark.real_time
def test_compiled_kernels_take_over_while_a_team_runs(tmp_path: Path, kept_kernels: Path) -> None:
    """The simulator changes to compiled kernels between two ticks; Ctrl+C ends the team in order."""
    with subprocess.Popen(
        zteam_command("zteam", "up", "line"),
        cwd=tmp_path,
        env={**os.environ, "NUMBA_CACHE_DIR": str(kept_kernels)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as launcher:
        assert launcher.stdout is not None
        try:
            assert any("compiled kernels take over" in line for line in launcher.stdout)
        finally:
            launcher.send_signal(signal.SIGINT)
        rest = launcher.stdout.read()
    assert launcher.returncode == 0, rest
    assert "robot_3 stopped" in rest
    assert "rror" not in rest


def test_one_process_in_lockstep_compiles_the_robots_kernels_too(tmp_path: Path, kept_kernels: Path) -> None:
    """Before the first tick, once for all robots. The trajectory is that of processes, whose robots had none."""
    together, first = up(tmp_path, "--lockstep", "--in-process")
    assert together.index("compiling the robots' kernels, once on this machine") < together.index("All robots GO!")
    assert list(kept_kernels.glob("complete-behaviors-*"))
    for path in kept_kernels.glob("complete-behaviors-*"):
        path.unlink()
    apart, second = up(tmp_path, "--lockstep")
    assert "robots' kernels" not in apart
    assert first["trajectory_sha256"] == second["trajectory_sha256"]


def test_lockstep_compiles_first_and_repeats(tmp_path: Path, kept_kernels: Path) -> None:
    """Missing kernels are compiled before the first tick, once, with progress; the trajectory is the same."""
    for lacking in ("edge_kernels.finish", "mounts.place_mounts", "motion"):
        for path in kept_kernels.glob(f"*/{lacking}*"):
            path.unlink()
    cold, first = up(tmp_path, "--lockstep")
    assert re.search(r"compiled (\d+) of \1 kernels\n(.*\n)*.*All robots GO!", cold)
    assert list(kept_kernels.glob("complete-*"))
    warm, second = up(tmp_path, "--lockstep")
    assert "compil" not in warm
    assert "numpy" not in cold + warm
    assert first["trajectory_sha256"] == second["trajectory_sha256"]
