"""What a monitor knows of its team, whether it gives GO itself or shows another one's team."""

from collections.abc import Sequence
from typing import Protocol

from zteam.messages import RobotStatus
from zteam.nodes.monitor.members import Members


class Team(Protocol):
    """A team that is watched: fed with tokens, statuses and the simulator's robots. The caller holds a lock."""

    members: Members

    @property
    def gone(self) -> bool:
        """Whether GO is out."""
        ...

    def take_token(self, robot_id: int, instance: str, alive: bool) -> None:
        """A process took or lost the name `robot_N`."""
        ...

    def take_status(self, robot_id: int, status: RobotStatus, now: float) -> bool:
        """A robot's status, heard at host time `now` on its own key; False if it speaks for another robot."""
        ...

    def take_world(self, robots: Sequence[int] | None) -> None:
        """The simulator has these robots; None if there is no simulator."""
        ...

    def all_running(self) -> bool:
        """Whether every robot that counts obeys the standing GO, or is gone."""
        ...

    def waiting_for(self) -> str:
        """What GO waits for, in words: each missing robot with the reason."""
        ...
