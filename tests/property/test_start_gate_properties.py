"""The start gate under any order of tokens and statuses."""

from hypothesis import given
from hypothesis import strategies as st

from zteam.messages import RobotState, RobotStatus, TeamState, TeamStatus, decode, encode
from zteam.nodes.monitor.start_gate import Gate

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
            gate.take_token(robot_id, str(detail), flag)
            (holders.setdefault(robot_id, set()).add if flag else holders.setdefault(robot_id, set()).discard)(detail)
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
    assert sum(event.kind == "go" for event in gate.members.take_events()) == (gate.epoch == 1)


@given(steps=st.lists(STATUSES, max_size=30))
def test_statuses_alone_give_no_go(steps: list[tuple[str, int, int, bool]]) -> None:
    """Statuses without presence tokens never give GO."""
    gate = Gate(None, 1)
    for _, robot_id, state, ready in steps:
        gate.take_status(robot_id, RobotStatus(robot_id=robot_id, is_ready=ready, state=state), 0.0)
        assert not gate.try_go(1)
