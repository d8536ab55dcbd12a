"""The start gate's logic: which robots count as ready, when GO is given and holds."""

import numpy as np
import pytest

from support.gate_feed import BOOT, FAULT, RUNNING, STOPPED, come, status, told
from zteam.messages import TeamState, TeamStatus, decode, encode, ns_from_time
from zteam.monitor.process.members import SILENT_AFTER
from zteam.monitor.process.start_gate import Gate


def test_each_ready_robot_is_told_until_go() -> None:
    """The line of each ready robot has the count and names the missing; then GO, once, in its exact words."""
    gate = Gate([0, 1, 2, 3], 4)
    come(gate, 0, 1)
    assert told(gate) == [
        "robot_0 ready (1 of 4; waiting for robot_1, robot_2, robot_3)",
        "robot_1 ready (2 of 4; waiting for robot_2, robot_3)",
    ]
    assert not gate.try_go(1)
    come(gate, 2, 3)
    assert told(gate)[-1] == "robot_3 ready (4 of 4)"
    assert gate.try_go(1)
    assert told(gate) == ["All robots GO!"]
    assert not gate.try_go(2)
    assert told(gate) == []


def test_a_robot_says_ready_once() -> None:
    """Heartbeats of a ready robot are not told again."""
    gate = Gate([0, 1], 2)
    come(gate, 0)
    for second in range(1, 5):
        gate.take_status(0, status(0), float(second))
    assert len(told(gate)) == 1


@pytest.mark.parametrize("state", [BOOT, STOPPED, FAULT])
def test_a_robot_that_is_not_ready_does_not_count(state: int) -> None:
    """is_ready = false holds the team, also of a robot that was ready before."""
    gate = Gate([0, 1], 2)
    come(gate, 0, 1)
    gate.take_status(1, status(1, state), 1.0)
    assert gate.ready == [0]
    assert gate.missing == [1]
    assert not gate.try_go(1)
    told(gate)
    gate.take_status(1, status(1), 2.0)
    assert told(gate) == ["robot_1 ready (2 of 2)"]
    assert gate.try_go(2)


def test_a_status_without_a_process_does_not_count() -> None:
    """A ready status of a robot without a presence token gives no GO."""
    gate = Gate([0], 1)
    gate.take_status(0, status(0), 0.0)
    assert gate.ready == []
    assert not gate.try_go(1)
    gate.take_token(0, True)
    assert gate.try_go(2)


def test_a_robot_that_dies_after_ready_does_not_count() -> None:
    """When its process is gone, the others wait for it again."""
    gate = Gate([0, 1], 2)
    come(gate, 0)
    gate.take_token(0, False)
    come(gate, 1)
    assert not gate.try_go(1)
    assert told(gate)[1:] == ["robot_0 lost", "robot_1 ready (1 of 2; waiting for robot_0)"]
    assert (gate.ready, gate.missing, gate.lost) == ([1], [0], [0])


def test_a_new_process_speaks_for_itself() -> None:
    """A restarted robot is not ready by the status of its predecessor."""
    gate = Gate([0, 1], 2)
    come(gate, 0)
    gate.take_token(0, False)
    gate.take_token(0, True)
    come(gate, 1)
    assert gate.ready == [1]
    assert not gate.try_go(1)


def test_a_silent_robot_does_not_count() -> None:
    """GO waits for a robot that hangs."""
    gate = Gate([0, 1], 2)
    come(gate, 0, now=0.0)
    gate.check_silence(SILENT_AFTER + 1)
    come(gate, 1, now=SILENT_AFTER + 1)
    assert not gate.try_go(1)
    gate.take_status(0, status(0), SILENT_AFTER + 2)
    assert gate.try_go(2)


def test_no_robot_speaks_for_another() -> None:
    """A status under another robot's key is refused and changes nothing."""
    gate = Gate([0, 1], 2)
    come(gate, 0)
    told(gate)
    for robot_id in (0, -1, 2**31 - 1):
        assert not gate.take_status(1, status(robot_id), 0.0)
    gate.take_token(1, True)
    assert gate.ready == [0]
    assert told(gate) == []


def test_others_do_not_stand_in() -> None:
    """Robots that are not expected neither count nor show among the ready."""
    gate = Gate([0, 1], 2)
    come(gate, 0, 7, 8)
    assert gate.ready == [0]
    assert not gate.try_go(1)
    come(gate, 1)
    assert gate.try_go(2)
    assert list(gate.status(2).ready) == [0, 1]


def test_without_ids_it_counts() -> None:
    """Without ids any robots count; the text says how many are missing."""
    gate = Gate(None, 3)
    come(gate, 40, 7)
    assert told(gate)[-1] == "robot_7 ready (2 of 3; waiting for 1 more of any id)"
    assert gate.waiting_for() == "1 more of any id"
    assert not gate.try_go(1)
    come(gate, 9)
    assert gate.try_go(1)
    assert list(gate.status(1).ready) == [7, 9, 40]
    assert list(gate.status(1).missing) == []


def test_ids_learnt_later_hold_from_then_on() -> None:
    """Once the simulator's robots are known, exactly those are waited for."""
    gate = Gate(None, 2)
    come(gate, 0)
    gate.expect([5, 0])
    come(gate, 1)
    assert not gate.try_go(1)
    assert gate.waiting_for() == "robot_5: no process yet"
    come(gate, 5)
    assert gate.try_go(1)


def test_the_published_status() -> None:
    """The published status before and after GO, over the wire and back."""
    gate = Gate([0, 1, 2], 3)
    come(gate, 0, 1)
    gate.take_token(1, False)
    waiting = decode(TeamStatus, encode(gate.status(3_000_000_001)))
    assert (waiting.state, waiting.epoch, waiting.team_size) == (TeamState.WAITING, 0, 3)
    assert ns_from_time(waiting.header.stamp) == 3_000_000_001
    assert [list(a) for a in (waiting.ready, waiting.missing, waiting.lost)] == [[0], [1, 2], [1]]
    assert all(a.dtype == np.int32 for a in (waiting.ready, waiting.missing, waiting.lost))
    come(gate, 1, 2)
    gate.take_status(1, status(1), 1.0)
    assert gate.try_go(4_500_000_000)
    go = decode(TeamStatus, encode(gate.status(9_000_000_000)))
    assert (go.state, go.epoch, ns_from_time(go.go_stamp)) == (TeamState.GO, 1, 4_500_000_000)
    assert [list(a) for a in (go.ready, go.missing, go.lost)] == [[0, 1, 2], [], []]


def test_go_is_never_taken_back() -> None:
    """Whatever happens to the robots, epoch, state and stamp stay."""
    gate = Gate([0, 1], 2)
    come(gate, 0, 1)
    gate.try_go(5)
    for robot_id in (0, 1):
        gate.take_token(robot_id, False)
    gate.check_silence(100.0)
    come(gate, 1, state=BOOT)
    after = gate.status(7)
    assert (after.state, after.epoch, ns_from_time(after.go_stamp)) == (TeamState.GO, 1, 5)
    assert list(after.missing) == [0, 1]


def test_a_jump_of_time_renews_a_standing_go_only() -> None:
    """After the simulator's restart GO holds from its new time on; before GO there is nothing to renew."""
    gate = Gate([0], 1)
    gate.renew(5)
    assert not gate.gone
    come(gate, 0)
    gate.try_go(9_000)
    gate.renew(100)
    assert (ns_from_time(gate.status(200).go_stamp), gate.epoch) == (100, 1)


def test_all_running_waits_for_the_robots_that_count() -> None:
    """Every living robot of the team must obey the standing GO; lost robots and others are not waited for."""
    gate = Gate([0, 1, 2], 3)
    come(gate, 0, 1, 2)
    come(gate, 9)
    assert not gate.all_running()
    gate.try_go(1)
    assert not gate.all_running()
    gate.take_status(0, status(0, RUNNING, 1), 1.0)
    gate.take_status(1, status(1, RUNNING, 1), 1.0)
    assert not gate.all_running()
    gate.take_token(2, False)
    assert gate.all_running()
