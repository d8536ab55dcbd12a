"""The robots that the gate knows: lost, stopped, at fault, silent."""

from support.gate_feed import FAULT, READY, STOPPED, come, status, told
from zteam.monitor.process.members import SILENT_AFTER
from zteam.monitor.process.start_gate import Gate


def test_a_new_process_is_not_silent_at_once() -> None:
    """A robot that comes back is not told as silent for the time that it was away."""
    gate = Gate([0], 1)
    come(gate, 0)
    gate.take_token(0, False)
    gate.take_token(0, True)
    gate.check_silence(100.0)
    assert told(gate, "silent") == []


def test_a_stop_is_no_loss() -> None:
    """A robot that published STOPPED is told as stopped, one that vanished as lost."""
    gate = Gate([0, 1], 2)
    come(gate, 0, 1)
    gate.take_status(0, status(0, STOPPED), 1.0)
    told(gate)
    gate.take_token(0, False)
    gate.take_token(1, False)
    assert told(gate) == ["robot_0 stopped", "robot_1 lost"]


def test_a_fault_is_told_with_its_text() -> None:
    """A fault is told once when it comes, and again when it comes back."""
    gate = Gate([0], 1)
    come(gate, 0)
    told(gate)
    for state in (FAULT, FAULT, READY, FAULT):
        gate.take_status(0, status(0, state, text="laser dead"), 1.0)
    assert told(gate, "fault") == ["robot_0 fault: laser dead"] * 2


def test_a_long_text_of_a_robot_is_cut() -> None:
    """What one robot says fills neither the log nor the line of all that GO waits for."""
    gate = Gate([0], 1)
    come(gate, 0)
    told(gate)
    gate.take_status(0, status(0, FAULT, text="x" * 10**6), 1.0)
    (line,) = told(gate, "fault")
    assert line.startswith("robot_0 fault: xxx") and line.endswith("…") and len(line) < 2100
    assert len(gate.waiting_for()) < 2100


def test_a_silent_robot_is_named_and_unnamed() -> None:
    """A living token without statuses is told once, and once when it answers again."""
    gate = Gate([0, 1], 2)
    come(gate, 0, 1, now=10.0)
    told(gate)
    gate.check_silence(10.0 + SILENT_AFTER)
    assert told(gate) == []
    gate.take_status(1, status(1), 12.0)
    gate.check_silence(14.0)
    gate.check_silence(14.2)
    assert told(gate) == ["robot_0 does not answer for 4 s"]
    gate.take_status(0, status(0), 15.0)
    gate.take_status(0, status(0), 15.5)
    assert told(gate, "silent", "answers") == ["robot_0 answers again"]


def test_a_process_that_never_sent_a_status_is_not_silent() -> None:
    """A teleop publishes none, and it answers. The line of what GO waits for names the robot."""
    gate = Gate([0], 1)
    come(gate, 0)
    gate.take_token(0, False)
    gate.take_token(0, True)
    told(gate)
    for now in (100.0, 100.5 + SILENT_AFTER):
        gate.check_silence(now)
    assert told(gate) == []
    assert gate.waiting_for() == "robot_0: no status yet"


def test_a_dead_robot_is_not_silent() -> None:
    """A lost robot is not told as silent too."""
    gate = Gate([0], 1)
    come(gate, 0)
    gate.take_token(0, False)
    told(gate)
    gate.check_silence(100.0)
    assert told(gate) == []
