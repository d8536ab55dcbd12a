"""The start gate under any order of tokens and statuses."""

from collections.abc import Iterable
from contextlib import suppress
from unittest.mock import patch

from hypothesis import given
from hypothesis import strategies as st

from zteam import names
from zteam.bus import MemoryHub, presence
from zteam.bus.presence import Claim
from zteam.errors import DuplicateNameError
from zteam.messages import RobotState, RobotStatus, TeamState, TeamStatus, decode, encode
from zteam.monitor.process.start_gate import Gate
from zteam.node.robot_status import Readiness
from zteam.node.tokens import TokenSet

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
            gate.on_token(robot_id, bool(holders[robot_id]))
        else:
            assert isinstance(detail, int)
            gate.on_status(robot_id, RobotStatus(robot_id=robot_id, is_ready=flag, state=detail), 0.0)
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


class _ZteamRobot:
    """The robot's side of zteam's gate, with its heartbeat and the latched GO."""

    def __init__(self, robot_id: int, claim: Claim) -> None:
        self.robot_id = robot_id
        self.claim = claim
        self._gate = Readiness(gated=True)

    def step(self, team: TeamStatus) -> RobotStatus:
        """A second passes; `team` is the newest word of a monitor. What it says of itself."""
        if self._gate.take([], team.epoch if team.state == TeamState.GO else 0):
            self._gate.drive("")
        gate = self._gate
        return RobotStatus(robot_id=self.robot_id, is_ready=gate.is_ready, state=gate.state, epoch=gate.epoch)

    @property
    def drives(self) -> bool:
        """Whether it obeys GO."""
        return self._gate.state == RobotState.RUNNING


class ZteamTeam:
    """zteam's gate and robots; names are held by presence tokens on a bus in memory."""

    def __init__(self, ids: Iterable[int]) -> None:
        self.ids = tuple(ids)
        """The robots that the monitor waits for."""
        self.lossy: set[int] = set()
        """Robots whose messages are lost."""
        self._hub = MemoryHub()
        self._robots: list[_ZteamRobot] = []
        self._gate: Gate | None = None
        self._tokens = TokenSet()
        self._hub.bus().watch_tokens([names.tokens_key("*")], self._on_token)
        self._now = 0
        self._said = TeamStatus()
        """Latched: the last word of the newest monitor, which ends with its process."""

    def _on_token(self, key: str, alive: bool) -> None:
        token = names.split_token_key(key)
        if token is not None:
            self._tokens.take(*token, alive)
            self._pass_name(token[0])

    def _pass_name(self, name: str) -> None:
        robot_id = names.robot_id_of(name)
        if self._gate is not None and robot_id is not None:
            self._gate.on_token(robot_id, name in self._tokens)

    def start_monitor(self) -> None:
        """A monitor begins; it knows nothing of what was."""
        self._gate = Gate(self.ids, len(self.ids))
        for name in self._tokens:
            self._pass_name(name)

    def end_monitor(self) -> None:
        """The monitor's process ends."""
        self._gate = None
        self._said = TeamStatus()

    def start_robot(self, robot_id: int) -> None:
        """A process with this id begins."""
        claim = Claim(self._hub.bus(), names.robot_name(robot_id))
        # The process of a second robot of this id ends with an error that names the first one.
        with suppress(DuplicateNameError):
            claim.win(lambda _holder: None)
            self._robots.append(_ZteamRobot(robot_id, claim))

    def end_robot(self, robot_id: int) -> None:
        """The process of this robot that began last is killed."""
        killed = [robot for robot in self._robots if robot.robot_id == robot_id][-1]
        self._robots.remove(killed)
        killed.claim.release()

    def pass_seconds(self, seconds: int) -> None:
        """Let time pass."""
        for _ in range(seconds):
            self._now += 1
            for robot in self._robots:
                status = robot.step(self._said)
                if self._gate is not None and robot.robot_id not in self.lossy:
                    self._gate.on_status(robot.robot_id, status, float(self._now))
            if self._gate is not None:
                self._gate.check_silence(float(self._now))
                self._gate.try_go(self._now)
                self._said = self._gate.status(self._now)

    @property
    def driving(self) -> list[int]:
        """The ids of the processes that drive, sorted; an id stands twice if two processes drive one robot."""
        return sorted(robot.robot_id for robot in self._robots if robot.drives)

    @property
    def counted(self) -> list[int]:
        """The robots that the monitor takes for ready."""
        return [] if self._gate is None else self._gate.ready


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
