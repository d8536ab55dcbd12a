"""Robots and monitors that come and go before and after a start, without processes.

Time passes in whole seconds, and what happens in one second arrives together. Messages are lost where a test says so.
"""

from collections.abc import Iterable
from contextlib import suppress

from zteam import names
from zteam.bus import MemoryHub
from zteam.bus.presence import Claim
from zteam.errors import DuplicateNameError
from zteam.messages import RobotState, RobotStatus, TeamState, TeamStatus
from zteam.monitor.process.start_gate import Gate
from zteam.node.robot_status import Readiness
from zteam.node.tokens import TokenSet


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
        self._hub.bus().watch_tokens([names.tokens_key()], self._on_token)
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
            self._gate.take_token(robot_id, name in self._tokens)

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
                    self._gate.take_status(robot.robot_id, status, float(self._now))
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
