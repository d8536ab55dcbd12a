"""The start gate's logic: which robots count as ready, when GO is given and holds, and what is told meanwhile."""

from collections.abc import Callable, Sequence

import msgspec
import numpy as np
import pytest

from support.gate_feed import BOOT, FAULT, READY, RUNNING, STOPPED, come, status, told
from zteam.messages import TeamState, TeamStatus, decode, encode, ns_from_time
from zteam.monitor.process.start_gate import SILENT_AFTER, Event, EventLimit, Gate

Step = Callable[[Gate], object]


def here(*ids: int, state: int = READY, epoch: int = 0, now: float = 0.0) -> Step:
    """Processes take these names and publish their state."""
    return lambda gate: come(gate, *ids, state=state, epoch=epoch, now=now)


def says(robot_id: int, state: int = READY, epoch: int = 0, now: float = 1.0) -> Step:
    """A status comes."""
    return lambda gate: gate.on_status(robot_id, status(robot_id, state, epoch), now)


def token(robot_id: int, alive: bool = True) -> Step:
    """A process takes the robot's name, or its last holder loses it."""
    return lambda gate: gate.on_token(robot_id, alive)


def silence(now: float) -> Step:
    """Host time passes, and the gate looks for silent robots."""
    return lambda gate: gate.check_silence(now)


def go(gate: Gate) -> bool:
    """Give GO if all are ready."""
    return gate.try_go(5)


def simulator(session: str) -> Step:
    """A simulator is there in this session."""
    return lambda gate: gate.on_simulator(frozenset({session}))


GO, RESTARTED = "All robots GO!", ["robot_0 lost", "robot_0 is back", "robot_0 is ready late: told GO"]
FIRST = "robot_0 ready (1 of 2; waiting for robot_1)"
RUNS = "the team is running already (epoch 3)"
LINES: dict[str, tuple[list[int] | int, list[Step], list[str]]] = {
    "each ready robot is told once, then go": (
        [0, 1, 2],
        [here(0), says(0), here(1), go, here(2), go, says(0), go],
        ["robot_0 ready (1 of 3; waiting for robot_1, robot_2)", "robot_1 ready (2 of 3; waiting for robot_2)",
         "robot_2 ready (3 of 3)", GO],
    ),
    "a robot that is not ready any more does not count": (
        [0, 1], [here(0, 1), says(1, BOOT), go, says(1), go], [FIRST, *["robot_1 ready (2 of 2)"] * 2, GO],
    ),
    "nor one that stops": ([0, 1], [here(0, 1), says(1, STOPPED), go], [FIRST, "robot_1 ready (2 of 2)"]),
    "a fault is told when it comes": (
        [0], [here(0), says(0, FAULT), says(0, FAULT), go, says(0), says(0, FAULT)],
        ["robot_0 ready (1 of 1)", "robot_0 fault: ", "robot_0 ready (1 of 1)", "robot_0 fault: "],
    ),
    "a status without a process does not count": ([0], [says(0), go, token(0), go], [GO]),
    "a robot that died does not count": (
        [0, 1], [here(0), token(0, False), here(1), go],
        [FIRST, "robot_0 lost", "robot_1 ready (1 of 2; waiting for robot_0)"],
    ),
    "a new process does not count by the status of its predecessor": (
        [0, 1], [here(0), token(0, False), token(0), here(1), go],
        [FIRST, "robot_0 lost", "robot_0 is back", "robot_1 ready (1 of 2; waiting for robot_0)"],
    ),
    "a stop is no loss": (
        [0, 1], [here(0, 1), says(0, STOPPED), token(0, False), token(1, False)],
        [FIRST, "robot_1 ready (2 of 2)", "robot_0 stopped", "robot_1 lost"],
    ),
    "a silent robot does not count until it answers": (
        [0, 1],
        [here(0), silence(SILENT_AFTER), silence(3.5), silence(4.0), here(1, now=3.5), go, says(0, now=5.0), go],
        [FIRST, "robot_0 does not answer for 4 s", "robot_1 ready (1 of 2; waiting for robot_0)",
         "robot_0 answers again", "robot_0 ready (2 of 2)", GO],
    ),
    "a dead robot, or one that never sent a status, is not silent": (
        [0, 1], [here(0), token(0, False), token(1), silence(100.0)], [FIRST, "robot_0 lost"],
    ),
    "one that comes back is not silent for the time that it was away": (
        [0, 1], [here(0), token(0, False), token(0), silence(100.0)], [FIRST, "robot_0 lost", "robot_0 is back"],
    ),
    "others do not stand in, and are named once": (
        [0, 1], [here(0, 7), here(7), go, here(1), go, here(8)],
        [FIRST, "robot_7 is not expected: GO waits for 0, 1 only; it obeys that GO too",
         "robot_7 ready (1 of 2; waiting for robot_1)", "robot_1 ready (2 of 2)", GO, "robot_8 is ready late: told GO"],
    ),
    "without ids it counts": (
        2, [here(40), go, here(7), go],
        ["robot_40 ready (1 of 2; waiting for 1 more of any id)", "robot_7 ready (2 of 2)", GO],
    ),
    "ids that are learnt later hold from then on": (
        2, [here(0), here(3, state=BOOT), lambda gate: gate.expect([1, 0]), here(2), go, here(1), go],
        ["robot_0 ready (1 of 2; waiting for 1 more of any id)",
         "robot_3 is not expected: GO waits for 0, 1 only; it obeys that GO too",
         "robot_2 is not expected: GO waits for 0, 1 only; it obeys that GO too",
         "robot_2 ready (1 of 2; waiting for robot_1)", "robot_1 ready (2 of 2)", GO],
    ),
    "a robot that was ready in time is not late": (
        [0], [here(0), go, says(0), says(0, RUNNING, 1)], ["robot_0 ready (1 of 1)", GO],
    ),
    "a late robot is told once": (
        1, [here(0), go, here(1, state=BOOT), says(1), says(1, RUNNING, 1)],
        ["robot_0 ready (1 of 1)", GO, "robot_1 is ready late: told GO"],
    ),
    "also if it obeys the latched go at once": (
        1, [here(0), go, here(1, state=RUNNING, epoch=1)],
        ["robot_0 ready (1 of 1)", GO, "robot_1 is ready late: told GO"],
    ),
    "a robot that starts again is told again": (
        [0], [here(0), go, token(0, False), here(0, state=BOOT), says(0), says(0, RUNNING, 1)],
        ["robot_0 ready (1 of 1)", GO, *RESTARTED],
    ),
    "also if its first status is that it runs": (
        [0], [here(0), go, token(0, False), here(0, state=RUNNING, epoch=1)],
        ["robot_0 ready (1 of 1)", GO, *RESTARTED],
    ),
    "a monitor that starts again adopts the go": ([0, 1], [here(0, 1, state=RUNNING, epoch=3), go], [RUNS]),
    "also where statuses come before tokens": (
        [0, 1], [says(0, RUNNING, 3), says(1, RUNNING, 3), token(0), token(1), go], [RUNS],
    ),
    "robots without the adopted go are late": (
        [0, 1], [here(0, state=RUNNING, epoch=3), here(1)], [RUNS, "robot_1 is ready late: told GO"],
    ),
    "a robot without go, or that does not run, is not followed": (
        [0, 1], [here(0, state=RUNNING), says(0, READY, 2), says(0, STOPPED, 2)], [FIRST],
    ),
    "nor one of another team, nor one without a process": (
        [0, 1], [here(7, state=RUNNING, epoch=1), says(1, RUNNING, 1)],
        ["robot_7 is not expected: GO waits for 0, 1 only; it obeys that GO too",
         "robot_7 ready (0 of 2; waiting for robot_0, robot_1)"],
    ),
    "another simulator gets the next epoch after go": (
        [0], [simulator("a"), simulator("b"), here(0), go, simulator("b"), simulator("c"), simulator("c")],
        ["robot_0 ready (1 of 1)", GO, "the world begins anew in another simulator (epoch 2)"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", LINES)
def test_what_is_told(case: str) -> None:
    """The lines of all events, in order and in the exact words of the monitor; GO is among them where it is given."""
    team, steps, lines = LINES[case]
    gate = Gate(None, team) if isinstance(team, int) else Gate(team, len(team))
    for step in steps:
        step(gate)
    assert told(gate) == lines


def ids_of(team: TeamStatus) -> list[list[int]]:
    """Its ready, missing and lost robots."""
    assert all(ids.dtype == np.int32 for ids in (team.ready, team.missing, team.lost))
    return [list(ids) for ids in (team.ready, team.missing, team.lost)]


def test_the_published_status() -> None:
    """Before and after GO, over the wire and back. GO is never taken back; where time jumps back it is renewed."""
    gate = Gate([0, 1, 2], 3)
    gate.renew(5)
    come(gate, 0, 1)
    gate.on_token(1, False)
    waiting = decode(TeamStatus, encode(gate.status(3_000_000_001)))
    assert (waiting.state, waiting.epoch, waiting.team_size) == (TeamState.WAITING, 0, 3)
    assert ns_from_time(waiting.header.stamp) == 3_000_000_001
    assert (ids_of(waiting), waiting.waiting_for) == ([[0], [1, 2], [1]], gate.waiting_for())
    come(gate, 1, 2)
    assert gate.try_go(4_500_000_000)
    given = decode(TeamStatus, encode(gate.status(9_000_000_000)))
    assert (given.state, given.epoch, ns_from_time(given.go_stamp)) == (TeamState.GO, 1, 4_500_000_000)
    assert (ids_of(given), given.waiting_for) == ([[0, 1, 2], [], []], "")
    gate.on_token(0, False)
    gate.check_silence(100.0)
    gate.renew(100)
    after = gate.status(7)
    assert (after.state, after.epoch, ns_from_time(after.go_stamp)) == (TeamState.GO, 1, 100)
    assert ids_of(after) == [[], [0, 1, 2], [0]]


def test_the_highest_epoch_is_adopted() -> None:
    """Of robots that obey different GOs the newest wins; after the last one of the wire there is still a GO to tell."""
    gate = Gate([0, 1], 2)
    gate.on_simulator(frozenset({"one"}))
    come(gate, 0, state=RUNNING, epoch=1)
    come(gate, 1, state=RUNNING, epoch=2**32 - 1)
    gate.on_simulator(frozenset({"two"}))
    assert decode(TeamStatus, encode(gate.status(1))).epoch == gate.epoch == 2**32 - 1


def test_all_running_waits_for_the_robots_that_count() -> None:
    """Every living robot of the team must obey the standing GO; lost robots and others are not waited for."""
    gate = Gate([0, 1], 2)
    come(gate, 0, 1, 9)
    assert not gate.all_running()
    gate.try_go(1)
    assert not gate.all_running()
    gate.on_status(0, status(0, RUNNING, 1), 1.0)
    assert not gate.all_running()
    gate.on_token(1, False)
    assert gate.all_running()


ADD = "('zteam sim spawn --id 9 --pose X Y YAW' adds it)"
WAITS: list[tuple[Sequence[int] | int, list[Step], list[str]]] = [
    (
        [0, 1, 2, 3, 4, 5],
        [here(1, 3, 4, 5), token(1, False), token(2), says(3, BOOT), says(4, FAULT), says(5, now=-9.0), silence(1.5)],
        ["robot_0: no process yet", "robot_1: its process is gone", "robot_2: no status yet", "robot_3: not ready yet",
         "robot_4: fault: not ready yet", "robot_5: does not answer"],
    ),
    (3, [here(0), here(4, state=BOOT)], ["1 more of any id", "robot_4: not ready yet"]),
    (3, [here(0), here(4, 6, state=BOOT)], ["robot_4: not ready yet", "robot_6: not ready yet"]),
    (1, [here(0, 4)], []),
    (range(100), [], [*(f"robot_{i}: no process yet" for i in range(8)), "and 92 more robots"]),
    ([0, 9], [here(0), lambda gate: gate.on_world([0, 1, 2])], [f"robot_9: not in the world; it has 0-2 {ADD}"]),
    ([9], [lambda gate: gate.on_world([])], [f"robot_9: not in the world; it has no robot {ADD}"]),
    ([9], [lambda gate: gate.on_world([]), lambda gate: gate.on_world(None)], ["robot_9: no process yet"]),
]  # fmt: skip


@pytest.mark.parametrize(("team", "steps", "reasons"), WAITS)
def test_what_it_waits_for_has_a_reason_for_each_robot(
    team: Sequence[int] | int, steps: list[Step], reasons: list[str]
) -> None:
    """In the text that is published, and without reasons in the table's line."""
    gate = Gate(None, team) if isinstance(team, int) else Gate(team, len(team))
    for step in steps:
        step(gate)
    parts = gate.waiting_for().split("; robot")
    assert parts == "; ".join(reasons).split("; robot")
    assert gate.waiting_for(reasons=False) == ", ".join(reason.partition(":")[0] for reason in reasons)


def test_robots_that_cannot_follow_are_told_before_go() -> None:
    """A circle, after a second, and a leader that GO does not wait for; one that is still to come is not missed."""
    gate = Gate(None, 4)
    for robot_id, leader in ((0, 1), (1, 0), (2, 9)):
        gate.on_token(robot_id, True)
        gate.on_status(robot_id, msgspec.structs.replace(status(robot_id), leader=leader), 0.0)
    circle = "robots follow each other in a circle: robot_0 -> robot_1 -> robot_0"
    told(gate)
    for now in (9.0, 9.9):
        gate.check_leaders(now)
    assert told(gate) == []
    gate.check_leaders(10.0)
    assert told(gate) == [circle]
    come(gate, 3)
    told(gate)
    assert gate.try_go(1)
    assert told(gate) == ["robot_2 follows robot_9, which has no process", GO]
    come(gate, 9)
    gate.on_token(9, False)
    gate.check_leaders(11.0)
    assert [each.text for each in gate.follow_problems] == [circle]


def test_a_long_text_of_a_robot_is_cut() -> None:
    """What one robot says fills neither the log nor the line of all that GO waits for."""
    gate = Gate([0], 1)
    gate.on_token(0, True)
    gate.on_status(0, status(0, FAULT, text="x" * 10**6), 1.0)
    (line,) = told(gate)
    assert line.startswith("robot_0 fault: xxx") and line.endswith("…")
    assert len(line) < 2100 and len(gate.waiting_for()) < 2100


def shown(limit: EventLimit, events: list[Event], now: float, *, counts: bool) -> list[str]:
    """The lines of the events that are shown."""
    return [event.sentence for e in events if (event := limit.admit(e, counts, now)) is not None]


def test_invented_robots_and_forged_statuses_fill_no_log() -> None:
    """Of thousands of faults of one robot 8 are shown, and the last of them says so; 10 s later it begins anew. Robots
    that do not count share 16 lines, and 64 of those that were lost are remembered; a tool that held the name of one is
    not."""
    limit, faults = EventLimit(), [Event("fault", 1, f"fault: {i}") for i in range(3000)]
    lines = shown(limit, faults, 0.0, counts=True)
    assert (len(lines), lines[-1]) == (8, "robot_1 fault: 7 (further lines of this kind are left out for 10 s)")
    others = [Event("fault", 2, "fault: a"), Event("lost", 1, "lost"), Event("link", None, "router lost")]
    assert shown(limit, others, 1.0, counts=True) == ["robot_2 fault: a", "robot_1 lost", "router lost"]
    assert len(shown(limit, faults, 10.0, counts=True)) == 8
    assert len(shown(limit, [Event("lost", i, "lost") for i in range(2000)], 10.0, counts=False)) == 16
    gate = Gate([0, 1], 2)
    come(gate, 0, 1)
    for i in range(100, 2100):
        gate.on_token(i, True)
        gate.on_status(i, status(i), 1.0)
        gate.on_token(i, False)
    gate.on_token(1, False)
    gate.on_token(7, True)
    gate.on_token(7, False)
    assert (len(gate.members), gate.lost) == (2 + 64, [1, *range(100, 164)])
