"""What the start gate says it waits for, and which robots it names."""

import msgspec

from support.gate_feed import BOOT, FAULT, come, status, told
from zteam.monitor.process.members import SILENT_AFTER
from zteam.monitor.process.start_gate import Gate


def test_what_it_waits_for_has_a_reason_for_each_robot() -> None:
    """No process yet, gone, no status yet, the robot's own text, a fault, hung; nothing once GO is out."""
    gate = Gate([0, 1, 2, 3, 4, 5], 6)
    come(gate, 1, 4, 5)
    gate.take_token(1, False)
    gate.take_token(2, True)
    gate.take_token(3, True)
    gate.take_status(3, status(3, BOOT, text="waiting for base_scan"), 0.0)
    gate.take_status(4, status(4, FAULT, text="laser dead"), 0.0)
    assert gate.waiting_for() == gate.status(1).waiting_for
    assert gate.waiting_for().split("; ") == [
        "robot_0: no process yet",
        "robot_1: its process is gone",
        "robot_2: no status yet",
        "robot_3: waiting for base_scan",
        "robot_4: fault: laser dead",
    ]
    gate.check_silence(SILENT_AFTER + 1)
    assert "robot_5: does not answer" in gate.waiting_for()
    come(gate, *range(6))
    gate.try_go(1)
    assert gate.status(1).waiting_for == ""


def test_without_ids_the_reasons_are_those_of_the_robots_that_are_there() -> None:
    """How many are missing besides the robots that came, and what these still wait for."""
    gate = Gate(None, 3)
    come(gate, 0)
    come(gate, 4, state=BOOT)
    assert gate.waiting_for() == "1 more of any id; robot_4: not ready yet"
    assert gate.waiting_for(reasons=False) == "1 more of any id, robot_4"
    come(gate, 6, state=BOOT)
    assert gate.waiting_for() == "robot_4: not ready yet; robot_6: not ready yet"


def test_a_large_team_is_not_told_in_full() -> None:
    """A text that names a hundred robots is of no use."""
    text = Gate(range(100), 100).waiting_for()
    assert text.endswith("robot_7: no process yet; and 92 more robots")


def test_a_robot_that_the_world_lacks_is_named() -> None:
    """The text has the world's robots and how to add one; it is forgotten when the world has the robot."""
    gate = Gate([0, 1, 9], 3)
    come(gate, 0, 1)
    gate.take_world([0, 1, 2, 3])
    assert gate.waiting_for() == (
        "robot_9: not in the world; it has 0-3 ('zteam sim spawn --id 9 --pose X Y YAW' adds it)"
    )
    gate.take_world([])
    assert "; it has no robot (" in gate.waiting_for()
    for world in ([0, 1, 2, 3, 9], None):
        gate.take_world([])
        gate.take_world(world)
        assert gate.waiting_for() == "robot_9: no process yet"


def test_robots_that_cannot_follow_are_told_before_go() -> None:
    """A circle, and a leader that GO does not wait for, each once; a leader that is still to come is not missed."""
    gate = Gate([0, 1, 2], 3)
    for robot_id, leader in ((0, 1), (1, 0), (2, 9)):
        gate.take_token(robot_id, True)
        gate.take_status(robot_id, msgspec.structs.replace(status(robot_id), leader=leader), 0.0)
    told(gate)
    assert gate.try_go(1)
    assert told(gate) == [
        "robots follow each other in a circle: robot_0 -> robot_1 -> robot_0",
        "robot_2 follows robot_9, which has no process",
        "All robots GO!",
    ]
    gate.check_leaders(9.0)
    assert told(gate) == []
    waiting = Gate(None, 2)
    waiting.take_token(1, True)
    waiting.take_status(1, msgspec.structs.replace(status(1, BOOT), leader=9), 0.0)
    for now in (10.0, 20.0):
        waiting.check_leaders(now)
    assert told(waiting, "follow") == []
    come(waiting, 0)
    for now in (30.0, 40.0):
        waiting.check_leaders(now)
    assert told(waiting, "follow") == ["robot_1 follows robot_9, which has no process"]
    waiting.take_status(1, msgspec.structs.replace(status(1, BOOT), leader=0), 50.0)
    waiting.check_leaders(50.0)
    assert waiting.follow_problems == []


def test_a_robot_that_is_not_expected_is_named_once() -> None:
    """Whether it comes before or after its ids are known; a robot that comes after GO is only late."""
    gate = Gate([0, 1, 2], 3)
    come(gate, 7, state=BOOT)
    come(gate, 7, state=BOOT)
    unexpected = "robot_7 is not expected: GO waits for 0-2 only; it obeys that GO too"
    assert told(gate, "unexpected") == [unexpected]
    come(gate, 0, 1, 2)
    gate.try_go(1)
    come(gate, 8)
    assert told(gate, "unexpected") == []
    learnt = Gate(None, 3)
    come(learnt, 7)
    learnt.expect([0, 1, 2])
    assert told(learnt, "unexpected") == [unexpected]
