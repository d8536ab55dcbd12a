"""Which reasons the log prints."""

from support.log_capture import captured_log
from support.transforms import S
from zteam.bus import MemoryHub
from zteam.node.process_node import ProcessNode
from zteam.node.robot_status import REST, Readiness, ReasonLog, StatusReport
from zteam.node.shutdown import Stop
from zteam.node.stopping import StopSwitch

TICK = S // 20


def printed(*reasons: str, log: ReasonLog | None = None) -> list[str]:
    """What is printed of these reasons, one a tick."""
    kept = log or ReasonLog()
    return [reason for tick, reason in enumerate(reasons) if kept.admit(reason, tick * TICK)]


def test_reasons_that_take_turns_are_printed_once() -> None:
    """Two bases on one key: the reason comes and goes 20 times a second, with another one or without."""
    assert printed(*["too many beams", ""] * 200) == ["too many beams"]
    assert printed(*["too many beams", "obstacle ahead"] * 200) == ["too many beams", "obstacle ahead"]


def test_a_reason_that_was_gone_for_a_while_is_printed_again() -> None:
    """How long it held before plays no part."""
    away = REST // TICK
    assert printed(*["a"] * 500, *[""] * (away - 2), "a") == ["a"]
    assert printed(*["a"] * 500, *[""] * (away - 1), "a") == ["a", "a"]


def test_a_reason_with_a_number_fills_no_log() -> None:
    """Another text in each step: a few are printed within a while, and then the one that stays."""
    texts = [f"{number / 20:.2f} m to go" for number in range(95)]
    shown = printed(*texts, *["arrived"] * 200)
    assert shown[:4] == texts[:4]
    assert (shown[-1], len(shown)) == ("arrived", 5)


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
    assert log.lines == ["running: too many beams say nothing"]
