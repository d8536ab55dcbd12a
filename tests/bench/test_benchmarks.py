"""`zteam bench` and the studies measure and print. No test judges figures; `.ci/benchmarks` judges ratios."""

import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from support.limits import LIMIT
from zteam.clock import monotonic, pause
from zteam.team.launch.process import zteam_command

STUDIES = [sys.executable, str(Path(__file__).with_name("studies"))]


def bench(*arguments: str) -> Any:
    """Run `zteam bench` with these arguments; return its JSON."""
    return measure([*zteam_command("zteam", "bench"), *arguments])


def study(*arguments: str) -> Any:
    """Run a study with these arguments; return its JSON."""
    return measure([*STUDIES, *arguments])


def measure(command: list[str]) -> Any:
    """Run a command with `--json`; return what it prints."""
    done = subprocess.run([*command, "--json"], capture_output=True, text=True, timeout=LIMIT, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_core_is_measured() -> None:
    """A short run of the core prints its figures, all of them positive."""
    figures = bench("sim", "arena", "--robots", "3", "--beams", "90", "--seconds", "1")
    assert {"rtf", "rays_per_s", "step_ms", "rss_mb"} <= set(figures)
    assert figures["robots"] == 3
    assert all(figures[name] > 0 for name in ("rtf", "rays_per_s", "step_ms", "rss_mb"))


def test_steps_are_measured() -> None:
    """Every scene has its costs, their ratio to a fixed piece of work, and the same commands in every round."""
    rows = {row["scene"]: row for row in study("steps", "--seconds", "1")}
    assert {"teleop in the open", "teleop into a wall", "follow, 4 robots"} <= set(rows)
    for row in rows.values():
        assert row["same"]
        assert 0.0 < row["safety_us"] <= row["total_us"] <= row["p90_us"] <= row["max_us"]
        assert row["ratio"] > 0.0


@pytest.mark.team
def test_a_team_is_measured() -> None:
    """A short lock-step run, in which all drive, has its speed and the parts of a tick."""
    figures = bench("team", "office", "--robots", "3", "--beams", "90", "--seconds", "2")
    assert (figures["robots"], figures["lockstep"], figures["dropped"]) == (3, True, 0)
    assert figures["rtf"] > 0
    assert figures["least_driven_m"] > 0.5
    assert set(figures["rounds"]) == {"tf", "robot_0", "robot_1", "robot_2"}
    assert len(figures["trajectory_sha256"]) == 64


@pytest.mark.team
def test_a_team_is_measured_in_one_process_too() -> None:
    """Beside the processes and the core alone, with the very trajectory that the processes drove."""
    one = bench("team", "office", "--robots", "2", "--beams", "90", "--seconds", "2", "--in-process")["in_process"]
    assert all(one[name] > 0 for name in ("rtf", "core_rtf", "robot_us", "memory_mb"))
    assert one["same_trajectory"]


@pytest.mark.team
@pytest.mark.real_time
def test_a_team_is_measured_in_real_time() -> None:
    """A short real-time run has the time of GO, latencies and memory."""
    figures = bench("team", "arena", "--robots", "2", "--seconds", "2", "--realtime")
    assert (figures["robots"], figures["lockstep"]) == (2, False)
    assert figures["go_after_seconds"] > 0
    assert 0 < figures["latency_p50_ms"] <= figures["latency_p99_ms"]
    assert figures["pss_mb"] > 0


@pytest.mark.team
def test_a_study_is_stopped_and_goes_on(tmp_path: Path) -> None:
    """Ctrl+C ends it with 130; the same command runs only what is left. A bound that is missed gives 1."""
    results = tmp_path / "results.jsonl"
    words = [*STUDIES, "lines", "arena", "--seconds", "20", "--seeds", "1-4", "--jobs", "1", "--results", str(results)]
    first = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
    deadline = monotonic() + LIMIT
    while not (results.exists() and results.read_text()):
        assert first.poll() is None and monotonic() < deadline
        pause(0.05)
    first.send_signal(signal.SIGINT)
    _, said = first.communicate(timeout=LIMIT)
    assert first.returncode == 130
    kept = results.read_text()
    assert "the same command goes on" in said
    assert "Traceback" not in said
    done = subprocess.run([*words, "--json", "--contacts", "0"], capture_output=True, text=True, timeout=LIMIT)
    assert done.returncode == 0, done.stderr
    (case,) = json.loads(done.stdout)
    assert [run["task"]["seed"] for run in case["runs"]] == [1, 2, 3, 4]
    assert results.read_text().startswith(kept)
    assert len(results.read_text().splitlines()) == 4
    missed = subprocess.run([*words, "--share", "1"], capture_output=True, text=True, timeout=LIMIT)
    assert missed.returncode == 1
    assert "arena: MISSED: share" in missed.stdout


def test_the_steps_of_a_tick_are_measured() -> None:
    """Each of them takes some time."""
    assert all(cost > 0 for cost in study("hops").values())
