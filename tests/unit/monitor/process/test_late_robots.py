"""The start gate after GO: robots that come late or again, and a monitor that comes again."""

import pytest

from support.gate_feed import BOOT, READY, RUNNING, STOPPED, come, status, told
from zteam.messages import TeamState, TeamStatus, decode, encode
from zteam.monitor.process.start_gate import Gate


def test_a_robot_that_was_ready_in_time_is_not_late() -> None:
    """A heartbeat between GO and the robot's first step is not told."""
    gate = Gate([0], 1)
    come(gate, 0)
    gate.try_go(1)
    told(gate)
    gate.take_status(0, status(0), 1.0)
    gate.take_status(0, status(0, RUNNING, 1), 2.0)
    assert told(gate) == []


def test_a_late_robot_is_told_once() -> None:
    """A robot that becomes ready after GO is told GO, and the line says so once."""
    gate = Gate(None, 1)
    come(gate, 0)
    gate.try_go(1)
    told(gate)
    come(gate, 1, state=BOOT)
    assert told(gate) == []
    gate.take_status(1, status(1), 1.0)
    gate.take_status(1, status(1, RUNNING, 1), 2.0)
    assert told(gate) == ["robot_1 is ready late: told GO"]


@pytest.mark.parametrize(
    "states",
    [(BOOT, READY), (BOOT, RUNNING), (RUNNING,)],
)
def test_a_newcomer_is_told_of(states: tuple[int, ...]) -> None:
    """A robot that starts after GO finds the latched GO, and the monitor says so once."""
    gate = Gate(None, 1)
    come(gate, 0)
    gate.try_go(1)
    told(gate)
    gate.take_token(4, True)
    for state in (*states, RUNNING):
        gate.take_status(4, status(4, state, int(state == RUNNING)), 1.0)
    assert told(gate) == ["robot_4 is ready late: told GO"]


@pytest.mark.parametrize("states", [(BOOT, READY, RUNNING), (BOOT, RUNNING), (RUNNING,)])
def test_a_restarted_robot_is_told_again(states: tuple[int, ...]) -> None:
    """It is told as lost, as back and as told GO, also if it obeys the latched GO before its first status."""
    gate = Gate([0], 1)
    come(gate, 0)
    gate.try_go(1)
    gate.take_status(0, status(0, RUNNING, 1), 0.5)
    told(gate)
    gate.take_token(0, False)
    gate.take_token(0, True)
    for state in states:
        gate.take_status(0, status(0, state, int(state == RUNNING)), 1.0)
    assert told(gate) == ["robot_0 lost", "robot_0 is back", "robot_0 is ready late: told GO"]
    assert gate.lost == []


def test_a_restarted_monitor_adopts_the_go() -> None:
    """The GO that a running robot obeys is the team's: the same epoch, no second GO, and late robots get it."""
    gate = Gate([0, 1], 2)
    come(gate, 0, state=RUNNING, epoch=3)
    assert (gate.gone, gate.epoch) == (True, 3)
    assert told(gate) == ["the team is running already (epoch 3)"]
    assert gate.status(1).state == TeamState.GO
    come(gate, 1)
    assert told(gate) == ["robot_1 is ready late: told GO"]
    assert not gate.try_go(9)


def test_a_restarted_monitor_may_hear_of_statuses_before_tokens() -> None:
    """It adopts the GO with a robot's token then, and gives none of its own."""
    gate = Gate([0, 1], 2)
    for robot_id in (0, 1):
        gate.take_status(robot_id, status(robot_id, RUNNING, 3), 0.5)
    assert not gate.gone
    for robot_id in (0, 1):
        gate.take_token(robot_id, True)
    assert not gate.try_go(9)
    assert (gate.gone, gate.epoch, told(gate)) == (True, 3, ["the team is running already (epoch 3)"])


@pytest.mark.parametrize(("state", "epoch"), [(RUNNING, 0), (READY, 2), (STOPPED, 2)])
def test_a_robot_that_runs_without_go_is_not_followed(state: int, epoch: int) -> None:
    """A --no-gate robot runs in epoch 0, and an epoch counts from a running robot only."""
    gate = Gate([0, 1], 2)
    come(gate, 0, state=state, epoch=epoch)
    assert not gate.gone


def test_an_adopted_team_is_not_late() -> None:
    """Robots that run already are not told GO again when the monitor restarts."""
    gate = Gate([0, 1, 2], 3)
    for robot_id in range(3):
        gate.take_token(robot_id, True)
    come(gate, 0, 1, 2, state=RUNNING, epoch=1)
    assert told(gate, "late") == []


def test_adopted_robots_that_are_heard_of_one_by_one_are_not_late() -> None:
    """The first robot's GO is adopted before the next robot's token has come. A robot without GO is late as ever."""
    gate = Gate([0, 1, 2], 3)
    come(gate, 0, 1, state=RUNNING, epoch=1)
    come(gate, 2)
    assert told(gate, "late") == ["robot_2 is ready late: told GO"]


def test_another_simulator_gets_the_next_epoch() -> None:
    """Once, and only after GO: the robots that obey the GO that stands are in another world then."""
    gate = Gate([0], 1)
    for session in ("one", "two"):
        gate.take_simulator(frozenset({session}))
    come(gate, 0)
    gate.try_go(5)
    told(gate)
    gate.take_simulator(frozenset({"two"}))
    assert (gate.epoch, told(gate)) == (1, [])
    gate.take_simulator(frozenset({"three"}))
    gate.take_simulator(frozenset({"three"}))
    assert told(gate) == ["the world begins anew in another simulator (epoch 2)"]
    assert (gate.gone, gate.status(1).epoch) == (True, 2)


def test_the_highest_epoch_is_adopted() -> None:
    """Of robots that obey different GOs the newest wins."""
    gate = Gate([0, 1], 2)
    come(gate, 0, state=RUNNING, epoch=1)
    come(gate, 1, state=RUNNING, epoch=4)
    assert gate.epoch == 4


def test_the_last_epoch_of_the_wire_is_no_end() -> None:
    """A robot may tell any epoch: after the last one another simulator still has a GO that can be told."""
    gate = Gate([0], 1)
    gate.take_simulator(frozenset({"one"}))
    come(gate, 0, state=RUNNING, epoch=2**32 - 1)
    gate.take_simulator(frozenset({"two"}))
    assert (gate.epoch, decode(TeamStatus, encode(gate.status(1))).epoch) == (2**32 - 1, 2**32 - 1)


@pytest.mark.parametrize("case", ["not expected", "not alive"])
def test_a_stranger_opens_no_gate(case: str) -> None:
    """A running robot of another team, or a status without a process, gives this team no GO."""
    gate = Gate([0, 1], 2)
    if case == "not expected":
        come(gate, 7, state=RUNNING, epoch=1)
    else:
        gate.take_status(1, status(1, RUNNING, 1), 0.0)
    assert not gate.gone
