"""No robot decides by a text: reasons, statuses, logs and errors are for people."""

import json
import os
import subprocess
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam.team.launch.process import zteam_command

pytestmark = pytest.mark.team

WORDLESS = Path(__file__).parents[1] / "support" / "wordless"
READER = """
from zteam import Behavior
from zteam.messages import RobotStatus, Twist, Vector3

class Reader(Behavior):
    inputs = {"all": ("robot_$*/status", RobotStatus)}

    def step(self, view):
        told = view.inputs["all"].get(1)
        return Twist(Vector3(0.1 if told is None or " " in told.reason else 0.2))
"""
TEAM = """
[team]
world = "arena"
[[robots]]
id = 0
behavior = "reader:Reader"
[[robots]]
id = 1
behavior = "idle"
"""


def run(folder: Path, team: str, seconds: int, *options: str, python_path: str = "") -> str:
    """The trajectory hash of a run in lock-step."""
    done = subprocess.run(
        zteam_command("zteam", "up", team, "--lockstep", "--for", str(seconds), "--report", "r.json", *options),
        cwd=folder, capture_output=True, text=True, timeout=LIMIT, check=False, stdin=subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": python_path},
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    # Words of the launcher, and of the robots' processes.
    lines = [line.split() for line in done.stdout.splitlines() if line.startswith("[robot_")]
    assert lines and all((line[-1] == "x") == bool(python_path) for line in lines), done.stdout
    found: str = json.loads((folder / "r.json").read_text())["trajectory_sha256"]
    return found


@pytest.mark.parametrize(
    ("team", "seconds", "options"),
    [
        pytest.param("line", 12, ["--in-process"], marks=pytest.mark.gate, id="line in one process"),
        *(
            pytest.param(team, 30, ["--seed", str(seed), *place], marks=pytest.mark.ci, id=f"{team} {seed} {place}")
            for team, seeds in {"line": 3, "chain": 1, "formation": 1, "arena": 1, "navigation": 1}.items()
            for seed in range(1, seeds + 1)
            for place in ([], ["--in-process"])
            if not (place and team == "navigation")
        ),
    ],
)
def test_without_words_robots_drive_the_same_way(tmp_path: Path, team: str, seconds: int, options: list[str]) -> None:
    """A team all of whose reasons, statuses, log lines and errors read `x` has the same trajectory hash."""
    expected = run(tmp_path, team, seconds, *options)
    assert run(tmp_path, team, seconds, *options, python_path=str(WORDLESS)) == expected


@pytest.mark.ci
def test_a_robot_that_reads_drives_another_way(tmp_path: Path) -> None:
    """A robot that goes by the words of another one's status has another hash where they are replaced."""
    (tmp_path / "reader.py").write_text(READER)
    (tmp_path / "team.toml").write_text(TEAM)
    plain, wordless = (run(tmp_path, "team.toml", 3, "--in-process", python_path=p) for p in ("", str(WORDLESS)))
    assert plain != wordless
