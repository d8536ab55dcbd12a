"""The robot's side of the start gate: BOOT, READY, RUNNING."""

import pytest

from support.transforms import S
from zteam.messages import RobotState, TeamState, TeamStatus, time_from_ns
from zteam.node.robot_status import Readiness, go_epoch


def test_it_boots_until_nothing_is_missing() -> None:
    """What is missing is named, and GO alone releases no robot that lacks something."""
    readiness = Readiness(gated=True)
    assert readiness.state == RobotState.BOOT
    assert not readiness.take(["a scan", "odometry"], 3)
    assert (readiness.state, readiness.reason) == (RobotState.BOOT, "waiting for a scan, odometry")
    assert (readiness.is_ready, readiness.epoch) == (False, 0)


def test_it_is_ready_until_go() -> None:
    """With all data and without GO it tells the monitor that it is ready, and does not drive."""
    readiness = Readiness(gated=True)
    assert not readiness.take([], 0)
    assert (readiness.state, readiness.is_ready) == (RobotState.READY, True)
    assert "GO" in readiness.reason


def test_a_ready_robot_that_loses_data_boots_again() -> None:
    """Before GO the state follows the data."""
    readiness = Readiness(gated=True)
    readiness.take([], 0)
    assert not readiness.take(["a scan"], 0)
    assert (readiness.state, readiness.is_ready) == (RobotState.BOOT, False)


def test_go_releases_for_good() -> None:
    """After GO neither missing data nor a time before GO stops the robot."""
    readiness = Readiness(gated=True)
    assert readiness.take([], 2)
    readiness.drive("")
    assert (readiness.state, readiness.epoch, readiness.is_ready) == (RobotState.RUNNING, 2, True)
    assert readiness.take(["a scan"], 0)
    assert (readiness.state, readiness.epoch) == (RobotState.RUNNING, 2)


def test_the_newest_go_counts() -> None:
    """A released robot obeys a later GO, and keeps it when an older one is told."""
    readiness = Readiness(gated=True)
    readiness.take([], 2)
    readiness.take([], 5)
    readiness.take([], 3)
    assert readiness.epoch == 5


def test_without_a_gate_it_drives_at_once() -> None:
    """`--no-gate` needs neither data nor GO, and its epoch is 0."""
    readiness = Readiness(gated=False)
    assert readiness.take(["a scan"], 0)
    readiness.drive("no scan")
    assert (readiness.state, readiness.reason, readiness.epoch) == (RobotState.RUNNING, "no scan", 0)


def test_it_says_that_it_stopped() -> None:
    """The last status is no promise to drive."""
    readiness = Readiness(gated=False)
    readiness.drive("")
    readiness.stop()
    assert (readiness.state, readiness.reason, readiness.is_ready) == (RobotState.STOPPED, "stopped", False)


@pytest.mark.parametrize(
    ("state", "now", "epoch"), [(TeamState.GO, 2 * S, 4), (TeamState.GO, 2 * S - 1, 0), (TeamState.WAITING, 9 * S, 0)]
)
def test_go_holds_from_its_stamp_on(state: int, now: int, epoch: int) -> None:
    """Before its stamp, and while the team waits, there is no GO."""
    assert go_epoch(None, now) == 0
    assert go_epoch(TeamStatus(state=state, epoch=4, go_stamp=time_from_ns(2 * S)), now) == epoch
