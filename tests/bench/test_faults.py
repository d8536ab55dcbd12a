"""A minute of the study of faults."""

from pathlib import Path

import pytest

from studies.faults import measure_faults

TEAM = """
[team]
world = "office.world"
world_robots = false
[[robots]]
id = 0
model = "erratic"
pose = [24.0, 25.0, 0.0]
behavior = "path"
speed = 0.4
waypoints = [[24.0, 25.0], [41.9, 25.0], [41.9, 41.9], [8.3, 41.9], [8.3, 25.0]]
loop = true
[[robots]]
id = 1
model = "erratic"
follow = 0
pose = [23.0, 25.0, 0.0]
"""


@pytest.mark.ci
def test_random_faults_leave_nothing_behind_and_no_robot_driving(tmp_path: Path) -> None:
    """Under a minute of random faults no process crashes, none is left, no file is left, and the watchdog holds."""
    (tmp_path / "pair.toml").write_text(TEAM)
    found = measure_faults(str(tmp_path / "pair.toml"), seed=2, seconds=60.0, speed=None, say=lambda text: None)
    assert sum(found.faults.values()) >= 3
    assert (found.violations, found.crashed, found.left_processes, found.left_files) == ([], [], [], [])
