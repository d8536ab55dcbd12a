"""A flat floor with a team: robots that know each other's statuses, and lines behind a robot that a test commands."""

from collections.abc import Sequence
from typing import Any

import msgspec

from support.flat_floor import Floor, Segment
from zteam.behaviors import Behavior, View, load_behavior
from zteam.geometry import Pose2
from zteam.messages import PoseStamped, RobotStatus, Twist, Vector3
from zteam.messages.base import Base
from zteam.reasons import Reason

GAP = 0.8
"""Metres between two robots of a line."""


class TeamFloor(Floor):
    """Robots that know each other's statuses, one tick old, which of them are alive, and the goal of each."""

    def __init__(
        self, robots: Sequence[tuple[Pose2, Behavior]], walls: Sequence[Segment], *, seed: int = 1, delay: int = 0
    ) -> None:
        super().__init__([pose for pose, _ in robots], walls, seed, delay)
        self.team = [behavior for _, behavior in robots]
        self.gone: set[int] = set()
        self.goals: dict[int, PoseStamped] = {}
        self.commands = [(Twist(), "")] * len(robots)
        self._statuses: dict[int, RobotStatus] = {}
        self._tell()

    def _tell(self) -> None:
        for i, behavior in enumerate(self.team):
            reason = Reason.of(self.commands[i][1])
            self._statuses[i] = RobotStatus(
                robot_id=i, behavior=type(behavior).__name__.lower(), driver="behavior", gap=behavior.gap,
                leader=-1 if behavior.leader is None else behavior.leader, turns=behavior.turns,
                reason=str(reason), waits_for=reason.waits_for, blocked_by=reason.blocked_by,
            )  # fmt: skip

    def view(self, robot_id: int) -> View:
        """With the statuses of all robots; the bases of those that are gone stay known."""
        inputs = {"statuses": dict(self._statuses), "goal": self.goals.get(robot_id)}
        team, bases = tuple(set(self._statuses) - self.gone), dict.fromkeys(self._statuses, Base())
        return msgspec.structs.replace(super().view(robot_id), inputs=inputs, team=team, bases=bases)

    def tick(self) -> None:
        """All robots decide and move; then each reports what it does."""
        self.step(self.team)
        self._tell()


class Commanded(Behavior):
    """It drives by a list of commands, one a tick, and then stands; as a head it keeps its place."""

    def __init__(self, *commands: tuple[float, float, int], leader: int | None = None) -> None:
        """Each command: m/s, rad/s, and for how many ticks. `leader` is the robot that it says to follow."""
        super().__init__(None)
        self.leader, self.gap = leader, GAP
        self._commands = iter([(speed, turn) for speed, turn, ticks in commands for _ in range(ticks)])

    def step(self, view: View) -> Twist:
        """The next command."""
        speed, turn = next(self._commands, (0.0, 0.0))
        return Twist(Vector3(speed), Vector3(z=turn))


def follower(robot_id: int, **params: Any) -> Behavior:
    """One that follows the robot before it."""
    return load_behavior("follow", {"leader": robot_id - 1, "gap": GAP, **params}, robot_id)


def line(head: Behavior, count: int, x: float = 0.0, **params: Any) -> list[tuple[Pose2, Behavior]]:
    """A line along x behind a head at `x`."""
    team = [head, *(follower(i, **params) for i in range(1, count))]
    return [(Pose2(x - GAP * i, 0.0, 0.0), behavior) for i, behavior in enumerate(team)]
