"""A minute of the study of faults."""

from pathlib import Path

import pytest

from studies.faults import measure_faults
from support.pairs import PAIR


@pytest.mark.ci
def test_random_faults_leave_nothing_behind_and_no_robot_driving(tmp_path: Path) -> None:
    """A minute of random faults: no process crashes or is left behind, no file is left, and the watchdog holds."""
    (tmp_path / "pair.toml").write_text(PAIR)
    found = measure_faults(str(tmp_path / "pair.toml"), seed=2, seconds=60.0, speed=None, say=lambda text: None)
    assert sum(found.faults.values()) >= 3
    assert (found.exit_code, found.hung) == (0, [])
    assert (found.violations, found.crashed, found.left_processes, found.left_files) == ([], [], [], [])
