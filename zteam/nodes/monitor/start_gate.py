"""The start gate's logic, without a bus: who is there, who is ready, and whether the team may go.

The monitor feeds it with tokens and statuses and publishes what `status` says. GO is given once and never taken back;
a monitor that starts in the middle of a run adopts the GO that the robots tell of.
"""

from collections.abc import Iterable
from typing import NamedTuple

import msgspec
import numpy as np

from zteam import names
from zteam.messages import Header, RobotState, RobotStatus, TeamState, TeamStatus, time_from_ns

SILENT_AFTER = 3.0
"""Host seconds without a status (they come at 1 Hz) after which a robot with a living token does not answer."""


class Event(NamedTuple):
    """Something to tell: `robot` is None for the team as a whole."""

    kind: str
    robot: int | None
    text: str


class Member(msgspec.Struct):
    """What is known of one robot."""

    instances: set[str] = msgspec.field(default_factory=set)
    """Sessions that hold its name now."""
    status: RobotStatus | None = None
    heard: float = 0.0
    """Host time of the last status."""
    was_ready: bool = False
    was_lost: bool = False
    told_go: bool = False
    came_late: bool = False
    """Whether its process came after GO."""
    silent: bool = False
    stopped: bool = False
    """Whether it said farewell before it went."""

    @property
    def alive(self) -> bool:
        """Whether a process holds the robot's name."""
        return bool(self.instances)

    @property
    def ready(self) -> bool:
        """Whether it lives, answers and says it is ready."""
        return self.alive and not self.silent and self.status is not None and self.status.is_ready


class Gate:
    """The team as the monitor knows it."""

    def __init__(self, expected: Iterable[int] | None, team_size: int) -> None:
        self.expected = None if expected is None else sorted(set(expected))
        """The ids to wait for; None = any `team_size` robots."""
        self.team_size = team_size
        self.members: dict[int, Member] = {i: Member() for i in self.expected or ()}
        self.epoch = 0
        self.go_stamp: int | None = None
        self.events: list[Event] = []
        """To be told; the monitor empties it."""

    @property
    def gone(self) -> bool:
        """Whether GO is out."""
        return self.go_stamp is not None

    @property
    def ready(self) -> list[int]:
        """Ids of the robots that are ready and live."""
        return sorted(i for i, m in self.members.items() if m.ready and self._counts(i))

    @property
    def missing(self) -> list[int]:
        """Expected ids that are not ready."""
        return [] if self.expected is None else [i for i in self.expected if not self.members[i].ready]

    @property
    def lost(self) -> list[int]:
        """Ids of robots that were there and are gone."""
        return sorted(i for i, m in self.members.items() if m.was_lost)

    def _counts(self, robot_id: int) -> bool:
        return self.expected is None or robot_id in self.expected

    def expect(self, ids: Iterable[int]) -> None:
        """From now on wait for these robots (learnt from the simulator)."""
        self.expected = sorted(set(ids))
        for robot_id in self.expected:
            self.members.setdefault(robot_id, Member())

    def take_token(self, robot_id: int, instance: str, alive: bool) -> None:
        """A process took or lost the name `robot_N`."""
        member = self.members.setdefault(robot_id, Member())
        if alive:
            if not member.alive:
                member.came_late = self.gone
            member.instances.add(instance)
            if member.was_lost:
                member.was_lost = member.told_go = False
                self._tell("back", robot_id, "is back")
        elif instance in member.instances:
            member.instances.discard(instance)
            if not member.alive:
                self._lose(robot_id, member)

    def _lose(self, robot_id: int, member: Member) -> None:
        member.stopped = member.status is not None and member.status.state == RobotState.STOPPED
        # A process that comes later under this name speaks for itself.
        member.status = None
        member.was_ready = member.silent = False
        member.was_lost = True
        self._tell("stopped" if member.stopped else "lost", robot_id, "stopped" if member.stopped else "lost")

    def take_status(self, robot_id: int, status: RobotStatus, now: float) -> bool:
        """A robot's status, heard at host time `now` on its own key; False if it speaks for another robot."""
        if status.robot_id != robot_id:
            return False
        member = self.members.setdefault(robot_id, Member())
        before, member.status, member.heard = member.status, status, now
        if member.silent:
            member.silent = False
            self._tell("answers", robot_id, "answers again")
        if status.state == RobotState.FAULT and (before is None or before.state != RobotState.FAULT):
            self._tell("fault", robot_id, f"fault: {status.text}")
        if status.state == RobotState.RUNNING and member.alive and self._counts(robot_id):
            self._adopt(status.epoch)
        if self.gone:
            self._tell_late(robot_id, member)
        elif member.ready and not member.was_ready:
            member.was_ready = True
            self._tell("ready", robot_id, f"ready ({self._progress()})")
        elif not member.ready:
            member.was_ready = False
        return True

    def _adopt(self, epoch: int) -> None:
        """A robot of this team runs already: the newest GO that is obeyed is the team's."""
        if epoch <= self.epoch:
            return
        self.epoch = epoch
        if not self.gone:
            self.go_stamp = 0
            self._tell("adopted", None, f"the team is running already (epoch {epoch})")

    def _tell_late(self, robot_id: int, member: Member) -> None:
        if not member.ready or member.told_go or member.status is None:
            return
        member.told_go = True
        # A robot that comes late may obey the latched GO before it says a word.
        if member.status.epoch < self.epoch or member.came_late:
            self._tell("late", robot_id, "is ready late: told GO")

    def forgive_silence(self, now: float) -> None:
        """Nothing could be heard until `now`: silence counts from here on."""
        for member in self.members.values():
            member.heard = now

    def check_silence(self, now: float) -> None:
        """Name robots whose process lives but says nothing."""
        for robot_id, member in self.members.items():
            if member.alive and member.status is not None and not member.silent and now - member.heard > SILENT_AFTER:
                member.silent = True
                member.was_ready = False
                self._tell("silent", robot_id, f"does not answer for {now - member.heard:.0f} s")

    def try_go(self, stamp: int) -> bool:
        """Give GO from simulated time `stamp` (ns) on if everybody is ready; True when that happened now."""
        complete = not self.missing if self.expected is not None else len(self.ready) >= self.team_size
        if self.gone or not complete or len(self.ready) < self.team_size:
            return False
        self.epoch += 1
        self.go_stamp = stamp
        for member in self.members.values():
            member.told_go = member.ready
        self._tell("go", None, "All robots GO!")
        return True

    def renew(self, stamp: int) -> None:
        """Time went back: the standing GO holds from `stamp` on."""
        if self.gone:
            self.go_stamp = stamp

    def all_running(self) -> bool:
        """Whether every robot that counts obeys the standing GO, or is gone."""
        counted = [m for i, m in self.members.items() if self._counts(i) and m.alive]
        return self.gone and all(m.status is not None and m.status.epoch >= self.epoch for m in counted)

    def waiting_for(self) -> str:
        """Who is missing, in words."""
        if self.expected is not None:
            return ", ".join(names.robot_name(i) for i in self.missing)
        return f"{self.team_size - len(self.ready)} more of any id"

    def _progress(self) -> str:
        done = f"{len(self.ready)} of {self.team_size}"
        return done if len(self.ready) >= self.team_size else f"{done}; waiting for {self.waiting_for()}"

    def status(self, stamp: int) -> TeamStatus:
        """What to publish, at time `stamp` (ns)."""
        return TeamStatus(
            header=Header(time_from_ns(stamp), names.MONITOR),
            state=TeamState.GO if self.gone else TeamState.WAITING,
            epoch=self.epoch,
            go_stamp=time_from_ns(self.go_stamp or 0),
            team_size=self.team_size,
            ready=np.array(self.ready, np.int32),
            missing=np.array(self.missing, np.int32),
            lost=np.array(self.lost, np.int32),
        )

    def _tell(self, kind: str, robot: int | None, text: str) -> None:
        self.events.append(Event(kind, robot, printable(text)))

    def tell(self, kind: str, text: str, robot: int | None = None) -> None:
        """Something about a robot, or the team as a whole, that the gate does not know itself."""
        self._tell(kind, robot, text)


def printable(text: str) -> str:
    """A robot's own words without what would command a terminal or break a line."""
    return "".join(c if c.isprintable() else "\ufffd" for c in text)
