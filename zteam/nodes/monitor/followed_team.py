"""A team as another monitor tells of it, for a view of that monitor. Without a bus."""

from collections.abc import Sequence

from zteam import names
from zteam.messages import RobotStatus, TeamState, TeamStatus
from zteam.nodes.monitor.members import Members
from zteam.numbers import counted
from zteam.robot_ids import format_robot_ids


class FollowedTeam:
    """GO, and what it waits for, are the running monitor's; robots and their processes are seen directly."""

    def __init__(self) -> None:
        self.members = Members()
        self.status: TeamStatus | None = None
        """What the running monitor said last."""

    @property
    def gone(self) -> bool:
        """Whether GO is out."""
        return self.status is not None and self.status.state == TeamState.GO

    @property
    def ids(self) -> list[int]:
        """The robots that the running monitor waits for, as far as it names them."""
        return [] if self.status is None else sorted({*self.status.ready.tolist(), *self.status.missing.tolist()})

    def take_token(self, robot_id: int, instance: str, alive: bool) -> None:
        """A process took or lost the name `robot_N`."""
        self.members.take_token(robot_id, instance, alive, late=self.gone)

    def take_status(self, robot_id: int, status: RobotStatus, now: float) -> bool:
        """A robot's status, heard at host time `now` on its own key; False if it speaks for another robot."""
        if status.robot_id != robot_id:
            return False
        self.members.take_status(robot_id, status, now)
        return True

    def take_world(self, robots: Sequence[int] | None) -> None:
        """The running monitor says which robots the world lacks."""

    def take_team(self, status: TeamStatus) -> None:
        """What the running monitor says."""
        was_gone, was_known, self.status = self.gone, self.status is not None, status
        for robot_id in self.ids:
            self.members.get(robot_id)
        if self.gone and was_known and not was_gone:
            self.members.tell("go", None, "All robots GO!")
        else:
            self.members.tell("status", None, self._in_words(status))

    def _in_words(self, status: TeamStatus) -> str:
        ready = f"{status.ready.size} of {status.team_size} ready"
        return f"GO is out; {ready}" if self.gone else f"{ready}; waiting for {self.waiting_for()}"

    def all_running(self) -> bool:
        """Whether every robot that counts obeys the standing GO, or is gone."""
        if self.status is None or not self.gone:
            return False
        epoch = self.status.epoch
        there = [member for member in map(self.members.get, self.ids) if member.alive]
        return all(member.status is not None and member.status.epoch >= epoch for member in there)

    def waiting_for(self) -> str:
        """What GO waits for, in words."""
        status = self.status
        if status is None:
            return "the running monitor"
        # A monitor that is not of zteam may leave the reasons out.
        return status.waiting_for or ", ".join(map(names.robot_name, status.missing.tolist()))

    def differs_from(self, team_size: int, ids: Sequence[int] | None) -> str:
        """How the running monitor's team differs from the one asked for; empty if it does not."""
        if self.status is None:
            return ""
        size = self.status.team_size
        if size != team_size:
            return f"the running monitor's team has {counted(size, 'robot')}, not {team_size} as asked for here"
        if ids is not None and self.ids and self.ids != sorted(ids):
            has, asked = format_robot_ids(self.ids), format_robot_ids(ids)
            return f"the running monitor's team has robots {has}; asked for here: {asked}"
        return ""
