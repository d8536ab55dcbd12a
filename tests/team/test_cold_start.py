"""A team on a machine that has not compiled the simulator's kernels yet."""

import json
import os
import re
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest

from zteam.launch.process import zteam_command
from zteam.launch.warm_parent import can_fork

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
        timeout=110,
        check=False,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout, json.loads((folder / "r.json").read_text())


def test_a_team_drives_before_anything_is_compiled(tmp_path: Path) -> None:
    """In real time the robots drive before the kernels are compiled, and every process ends with exit code 0."""
    output, report = up(tmp_path)
    assert all(robot["distance_m"] > 0.05 for robot in report["robots"])
    assert output.index("on numpy while their kernels are compiled") < output.index("All robots GO!")
    assert not list((tmp_path / "cache").glob("complete-*"))
    assert [p["exit"] for p in report["processes"]] == [0] * (9 + can_fork()), output


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
