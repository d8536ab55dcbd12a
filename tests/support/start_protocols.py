"""Two start protocols under the same accidents: that of the lectures (ROS 1, `multi_sync`), and zteam's.

A scenario drives a team through `StartingTeam`. Time passes in whole seconds, and what happens in one second arrives
together. Robots and monitors are processes that come and go; messages are lost where the scenario says so.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field

from zteam import names
from zteam.bus import MemoryHub
from zteam.bus.presence import Claim
from zteam.errors import DuplicateNameError
from zteam.messages import RobotState, RobotStatus, TeamState, TeamStatus
from zteam.monitor.process.start_gate import Gate
from zteam.node.robot_status import Readiness
from zteam.node.tokens import TokenSet


class StartingTeam(ABC):
    """A team before and after its start."""

    def __init__(self, ids: Iterable[int]) -> None:
        self.ids = tuple(ids)
        """The robots that the monitor waits for."""
        self.lossy: set[int] = set()
        """Robots whose messages are lost."""

    @abstractmethod
    def start_monitor(self) -> None:
        """A monitor begins; it knows nothing of what was."""

    @abstractmethod
    def end_monitor(self) -> None:
        """The monitor's process ends."""

    @abstractmethod
    def start_robot(self, robot_id: int, *, is_ready: bool = True) -> None:
        """A process with this id begins; it says `is_ready` until it is asked for something else."""

    @abstractmethod
    def end_robot(self, robot_id: int) -> None:
        """The process of this robot that began last is killed."""

    @abstractmethod
    def pass_seconds(self, seconds: int) -> None:
        """Let time pass."""

    @property
    @abstractmethod
    def driving(self) -> list[int]:
        """The ids of the processes that drive, sorted; an id stands twice if two processes drive one robot."""

    @property
    @abstractmethod
    def counted(self) -> list[int]:
        """The robots that the monitor takes for ready."""


@dataclass
class _Ros:
    """A `RobotStatus` of the lectures: it has no state, and GO is one whose frame is the monitor's."""

    frame_id: str
    robot_id: int = 0
    is_ready: bool = True


@dataclass
class _LecturesRobot:
    """`SyncRobots.cpp`: it waits a second for the publisher to connect, says READY once, and waits for GO."""

    robot_id: int
    is_ready: bool
    age: int = 0
    goes: bool = False

    def step(self) -> list[_Ros]:
        """A second passes; what it publishes."""
        self.age += 1
        return [_Ros("", self.robot_id, self.is_ready)] if self.age == 1 else []

    def hear(self, message: _Ros) -> None:
        """The callback of `team_status`."""
        if message.frame_id == names.MONITOR:
            self.goes = True


@dataclass
class _LecturesMonitor:
    """`Monitor.cpp`: it counts ids that it has not seen, whatever they say, and says GO when the count is right."""

    team_size: int
    seen: set[int] = field(default_factory=set)

    def hear(self, message: _Ros) -> list[_Ros]:
        """The callback of `team_status`; what it publishes."""
        if message.robot_id in self.seen:
            return []
        self.seen.add(message.robot_id)
        return [_Ros(names.MONITOR)] if len(self.seen) == self.team_size else []


class LecturesTeam(StartingTeam):
    """Every process subscribes to `team_status`, the monitor with a queue of one message, and nothing is latched."""

    def __init__(self, ids: Iterable[int]) -> None:
        super().__init__(ids)
        self._robots: list[_LecturesRobot] = []
        self._monitor: _LecturesMonitor | None = None

    def start_monitor(self) -> None:
        self._monitor = _LecturesMonitor(len(self.ids))

    def end_monitor(self) -> None:
        self._monitor = None

    def start_robot(self, robot_id: int, *, is_ready: bool = True) -> None:
        self._robots.append(_LecturesRobot(robot_id, is_ready))

    def end_robot(self, robot_id: int) -> None:
        self._robots.remove([robot for robot in self._robots if robot.robot_id == robot_id][-1])

    def pass_seconds(self, seconds: int) -> None:
        for _ in range(seconds):
            said = [m for robot in self._robots for m in robot.step() if robot.robot_id not in self.lossy]
            # Of the messages that come together, a queue of one keeps the newest.
            queue = said[-1:]
            while queue and self._monitor is not None:
                answers = self._monitor.hear(queue.pop())
                for message in answers:
                    for robot in self._robots:
                        robot.hear(message)
                # The monitor subscribes to what it publishes.
                queue = answers[-1:]

    @property
    def driving(self) -> list[int]:
        return sorted(robot.robot_id for robot in self._robots if robot.goes)

    @property
    def counted(self) -> list[int]:
        return [] if self._monitor is None else sorted(self._monitor.seen)


class _ZteamRobot:
    """The robot's side of zteam's gate, with its heartbeat and the latched GO."""

    def __init__(self, robot_id: int, claim: Claim, *, is_ready: bool) -> None:
        self.robot_id = robot_id
        self.claim = claim
        self._lacks = [] if is_ready else ["a first scan"]
        self._gate = Readiness(gated=True)

    def step(self, team: TeamStatus) -> RobotStatus:
        """A second passes; `team` is the newest word of a monitor. What it says of itself."""
        if self._gate.take(self._lacks, team.epoch if team.state == TeamState.GO else 0):
            self._gate.drive("")
        gate = self._gate
        return RobotStatus(robot_id=self.robot_id, is_ready=gate.is_ready, state=gate.state, epoch=gate.epoch)

    @property
    def drives(self) -> bool:
        """Whether it obeys GO."""
        return self._gate.state == RobotState.RUNNING


class ZteamTeam(StartingTeam):
    """zteam's gate and robots; names are held by presence tokens on a bus in memory."""

    def __init__(self, ids: Iterable[int]) -> None:
        super().__init__(ids)
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
        self._gate = Gate(self.ids, len(self.ids))
        for name in self._tokens:
            self._pass_name(name)

    def end_monitor(self) -> None:
        self._gate = None
        self._said = TeamStatus()

    def start_robot(self, robot_id: int, *, is_ready: bool = True) -> None:
        claim = Claim(self._hub.bus(), names.robot_name(robot_id))
        # The process of a second robot of this id ends with an error that names the first one.
        with suppress(DuplicateNameError):
            claim.win(lambda _holder: None)
            self._robots.append(_ZteamRobot(robot_id, claim, is_ready=is_ready))

    def end_robot(self, robot_id: int) -> None:
        killed = [robot for robot in self._robots if robot.robot_id == robot_id][-1]
        self._robots.remove(killed)
        killed.claim.release()

    def pass_seconds(self, seconds: int) -> None:
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
        return sorted(robot.robot_id for robot in self._robots if robot.drives)

    @property
    def counted(self) -> list[int]:
        return [] if self._gate is None else self._gate.ready
