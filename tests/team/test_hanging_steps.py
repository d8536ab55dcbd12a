"""A step that does not return, in `zteam up`: the robot is named, its base stops, and the run fails."""

import json
import subprocess
from pathlib import Path

import pytest

from support.limits import LIMIT
from zteam.clock import HOST_FACTOR
from zteam.team.launch.process import zteam_command

pytestmark = pytest.mark.team

BLOCKS = """
from zteam import Behavior
from zteam.messages import Twist, Vector3

class Blocks(Behavior):
    '''Drives for a second, then works for ever.'''
    first = None

    def step(self, view):
        self.first = self.first or view.now
        while view.now - self.first >= 1e9:
            pass
        return Twist(Vector3(0.3))
"""
TEAM = '[team]\nworld = "arena"\n[[robots]]\nid = 0\nbehavior = "blocks:Blocks"\n'
SPEED = 0.3
HUNG_UP = 3
"""Exit code of a process that ends itself because its step does not return."""


@pytest.mark.parametrize(
    ("where", "pace"),
    [
        pytest.param((), (), marks=pytest.mark.real_time, id="processes in real time"),
        pytest.param(
            ("--in-process",),
            ("--lockstep", "--lockstep-timeout", str(1.5 * HOST_FACTOR)),
            id="one process in lock-step",
        ),
    ],
)
def test_a_hanging_step_fails_the_run(tmp_path: Path, where: tuple[str, ...], pace: tuple[str, ...]) -> None:
    """The log, the report and the exit code tell of it; by the ground truth the base stops, and the world goes on."""
    (tmp_path / "blocks.py").write_text(BLOCKS)
    (tmp_path / "team.toml").write_text(TEAM)
    command = zteam_command("zteam", "up", "team.toml", "--for", "3", "--report", "r.json", *where, *pace)
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT, check=False)
    output = done.stdout + done.stderr
    assert done.returncode == 1, output
    assert "robot_0 failed: see the log above" in done.stderr
    if where:
        assert f"up: robot_0 hangs: after {pace[-1]} s step has not returned ({tmp_path}/blocks.py:" in done.stderr
    named = [line for line in output.splitlines() if "Blocks.step has not returned for" in line]
    assert len(named) == 1, output
    assert named[0].startswith("[robot_0]")
    assert named[0].endswith(" s, a scan comes every 0.1 s; try zteam check blocks:Blocks")
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["hung"] == ["robot_0"]
    assert report["sim_seconds"] >= 3.0
    exits = {process["name"]: process["exit"] for process in report["processes"]}
    assert where or exits["robot_0"] == HUNG_UP
    # It drove for a second, and for the watchdog's 0.2 s; in real time a command may be late, or a pause between two.
    driven = report["robots"][0]["distance_m"]
    assert 0.5 * SPEED < driven <= 1.3 * SPEED if pace else 0.0 < driven < 2.9 * SPEED
