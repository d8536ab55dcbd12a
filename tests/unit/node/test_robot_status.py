"""The robot's side of the start gate, BOOT, READY, RUNNING; and which reasons its log prints."""

from collections.abc import Sequence

import pytest

from support.log_capture import captured_log
from support.transforms import S
from zteam.bus import MemoryHub
from zteam.messages import RobotState, TeamState, TeamStatus, time_from_ns
from zteam.node.process_node import ProcessNode
from zteam.node.robot_status import REST, Readiness, ReasonLog, StatusReport, go_epoch
from zteam.node.shutdown import Stop
from zteam.node.stopping import StopSwitch

TICK = S // 20
BOOT, READY, RUNNING = RobotState.BOOT, RobotState.READY, RobotState.RUNNING


@pytest.mark.parametrize(
    ("gated", "steps", "released", "state", "epoch"),
    [
        (True, [(["a scan"], 3)], False, BOOT, 0),
        (True, [([], 0)], False, READY, 0),
        (True, [([], 0), (["a scan"], 0)], False, BOOT, 0),
        (True, [([], 2)], True, RUNNING, 2),
        (True, [([], 2), (["a scan"], 0)], True, RUNNING, 2),
        (True, [([], 2), ([], 5), ([], 3)], True, RUNNING, 5),
        (False, [(["a scan"], 0)], True, RUNNING, 0),
    ],
    ids=["boots", "is ready", "boots again", "goes", "for good", "by the newest GO", "without a gate"],
)
def test_a_robot_boots_is_ready_and_goes(
    gated: bool, steps: Sequence[tuple[list[str], int]], released: bool, state: int, epoch: int
) -> None:
    """By what it lacks and the GO that holds: GO alone releases no robot that lacks something, and it stays."""
    readiness = Readiness(gated=gated)
    assert (readiness.state, readiness.is_ready) == (BOOT, False)
    assert [readiness.take(*step) for step in steps][-1] == released
    if released:
        readiness.drive("why")
    assert (readiness.state, readiness.epoch, readiness.is_ready) == (state, epoch, state != BOOT)
    words = {BOOT: "waiting for a scan", READY: "waiting for the monitor's GO (zteam-monitor; …)", RUNNING: "why"}
    assert readiness.reason.startswith(words[state].partition(" (")[0])
    readiness.stop()
    assert (readiness.state, readiness.is_ready) == (RobotState.STOPPED, False)


@pytest.mark.parametrize(
    ("state", "now", "epoch"), [(TeamState.GO, 2 * S, 4), (TeamState.GO, 2 * S - 1, 0), (TeamState.WAITING, 9 * S, 0)]
)
def test_go_holds_from_its_stamp_on(state: int, now: int, epoch: int) -> None:
    """Before its stamp, and while the team waits, there is no GO."""
    assert go_epoch(None, now) == 0
    assert go_epoch(TeamStatus(state=state, epoch=4, go_stamp=time_from_ns(2 * S)), now) == epoch


TEXTS = [f"{number / 20:.2f} m to go" for number in range(95)]
AWAY = REST // TICK


@pytest.mark.parametrize(
    ("reasons", "printed"),
    [
        (["too many beams", ""] * 200, ["too many beams"]),
        (["too many beams", "obstacle ahead"] * 200, ["too many beams", "obstacle ahead"]),
        ([*["a"] * 500, *[""] * (AWAY - 2), "a"], ["a"]),
        ([*["a"] * 500, *[""] * (AWAY - 1), "a"], ["a", "a"]),
        ([*TEXTS, *["arrived"] * 200], [*TEXTS[:4], "arrived"]),
    ],
    ids=["comes and goes", "two take turns", "not gone for long", "gone for a while", "has a number"],
)
def test_a_reason_is_printed_once(reasons: Sequence[str], printed: list[str]) -> None:
    """One reason a tick: again when it was gone for a while, and a few within that while if it is another in each
    step."""
    log = ReasonLog()
    assert [reason for tick, reason in enumerate(reasons) if log.admit(reason, tick * TICK)] == printed


def test_the_status_is_published_at_each_change_and_its_reason_is_logged_once(hub: MemoryHub) -> None:
    """Also one that the caller has logged in words of its own."""
    node = ProcessNode("robot_0", hub.bus(), Stop())
    node.clock.use_simulated()
    readiness = Readiness(gated=False)
    report = StatusReport(node, 0, "avoid", readiness, StopSwitch(hub.bus(), 0))
    with captured_log() as log:
        for tick in range(100):
            node.set_time(1 + tick * TICK)
            readiness.drive("" if tick % 2 else "too many beams say nothing")
            report.tell()
        readiness.drive("obstacle ahead")
        report.tell(logged=False)
        report.tell()
    assert log.lines == ["too many beams say nothing"]
