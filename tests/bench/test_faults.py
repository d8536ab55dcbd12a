"""A minute of the study of faults."""

from pathlib import Path

import pytest

from studies.faults import measure_faults
from support.pairs import PAIR
from zteam import names
from zteam.node.kinds import ROUTER

MOST_GROWTH = 0.1
"""Of a process's memory, as a share: 0.02 to 0.04 in this minute."""
OPEN_FOR_A_MOMENT = 2
"""Descriptors that a process may have when it is looked at: it reads files of /proc."""


@pytest.mark.ci
def test_random_faults_leave_nothing_behind_and_no_robot_driving(tmp_path: Path) -> None:
    """A minute of random faults: no process crashes, grows or is left behind, no file and no descriptor is left, and
    the watchdog holds."""
    (tmp_path / "pair.toml").write_text(PAIR)
    found = measure_faults(str(tmp_path / "pair.toml"), seed=2, seconds=60.0, speed=None, say=lambda text: None)
    assert sum(found.faults.values()) >= 3
    assert (found.exit_code, found.hung) == (0, [])
    assert (found.violations, found.crashed, found.left_processes, found.left_files) == ([], [], [], [])
    assert found.growth < MOST_GROWTH, found.held
    kept = {name: each.descriptors for name, each in found.held.items() if each.same}
    assert {ROUTER, names.SIMULATOR, names.LAUNCHER} <= kept.keys()
    assert all(late <= early + OPEN_FOR_A_MOMENT for early, late in kept.values()), kept
