"""The start gate under any order of tokens and statuses."""

from unittest.mock import patch

from hypothesis import given
from hypothesis import strategies as st

from support.starting_team import ZteamTeam
from zteam.bus import presence
from zteam.messages import RobotState, RobotStatus, TeamState, TeamStatus, decode, encode
from zteam.monitor.process.start_gate import Gate

ROBOTS = st.integers(0, 3)
TOKENS = st.tuples(st.just("token"), ROBOTS, st.sampled_from("ab"), st.booleans())
NOT_RUNNING = [RobotState.BOOT, RobotState.READY, RobotState.STOPPED, RobotState.FAULT]
STATUSES = st.tuples(st.just("status"), ROBOTS, st.sampled_from(NOT_RUNNING), st.booleans())
STEPS = st.lists(st.one_of(TOKENS, STATUSES), max_size=60)
TEAMS = st.one_of(
    st.sets(ROBOTS, min_size=1).map(lambda ids: Gate(ids, len(ids))), st.integers(1, 4).map(lambda n: Gate(None, n))
)


@given(gate=TEAMS, steps=STEPS)
def test_go_needs_every_robot_and_stays(gate: Gate, steps: list[tuple[str, int, object, bool]]) -> None:
    """GO needs a living process and its own status of every robot waited for; once given it never changes."""
    holders: dict[int, set[object]] = {}
    willing: set[int] = set()
    for stamp, (what, robot_id, detail, flag) in enumerate(steps, start=1):
        before = gate.status(stamp)
        if what == "token":
            (holders.setdefault(robot_id, set()).add if flag else holders.setdefault(robot_id, set()).discard)(detail)
            gate.take_token(robot_id, bool(holders[robot_id]))
        else:
            assert isinstance(detail, int)
            assert gate.take_status(robot_id, RobotStatus(robot_id=robot_id, is_ready=flag, state=detail), 0.0)
            (willing.add if flag else willing.discard)(robot_id)
        could = {i for i in willing if holders.get(i)}
        assert set(gate.ready) <= could
        gave = gate.try_go(stamp)
        after = decode(TeamStatus, encode(gate.status(stamp)))
        if gave:
            assert before.state == TeamState.WAITING
            assert len(could) >= gate.team_size
            assert set(gate.expected or ()) <= could
        if before.state == TeamState.GO:
            assert (after.state, after.epoch, after.go_stamp) == (before.state, before.epoch, before.go_stamp)
        assert not set(after.ready) & set(after.missing)
        assert gate.expected is None or sorted([*after.ready, *after.missing]) == gate.expected
        assert set(after.lost) <= {i for i, held in holders.items() if not held}
    assert sum(event.kind == "go" for event in gate.take_events()) == (gate.epoch == 1)


@given(steps=st.lists(STATUSES, max_size=30))
def test_statuses_alone_give_no_go(steps: list[tuple[str, int, int, bool]]) -> None:
    """Statuses without presence tokens never give GO."""
    gate = Gate(None, 1)
    for _, robot_id, state, ready in steps:
        gate.take_status(robot_id, RobotStatus(robot_id=robot_id, is_ready=ready, state=state), 0.0)
        assert not gate.try_go(1)


ACCIDENTS = st.lists(
    st.tuples(st.sampled_from(["robot", "kill", "monitor", "end", "lose", "hear", "pass"]), ROBOTS), max_size=25
)


@given(accidents=ACCIDENTS)
def test_in_the_end_all_drive(accidents: list[tuple[str, int]]) -> None:
    """Whatever was started, killed and lost before, also a second process of a robot or the monitor before or after GO:
    when all robots and a monitor live and are heard, all drive, each once."""
    with patch.object(presence, "CLAIM_WAIT", 0.0):
        team, alive, monitored = ZteamTeam(range(4)), set[int](), False
        for what, robot_id in accidents:
            if what == "robot":
                team.start_robot(robot_id)
                alive.add(robot_id)
            elif what == "kill" and robot_id in alive:
                team.end_robot(robot_id)
                alive.remove(robot_id)
            elif what == "monitor":
                team.start_monitor()
                monitored = True
            elif what == "end":
                team.end_monitor()
                monitored = False
            elif what == "lose":
                team.lossy.add(robot_id)
            elif what == "hear":
                team.lossy.discard(robot_id)
            team.pass_seconds(1)
        for robot_id in set(range(4)) - alive:
            team.start_robot(robot_id)
        if not monitored:
            team.start_monitor()
        team.lossy.clear()
        team.pass_seconds(3)
        assert team.driving == [0, 1, 2, 3]
        assert team.counted == [0, 1, 2, 3]
