"""The robots that the monitor knows, without a bus: their processes, their statuses, and what happened to them."""

from collections import Counter
from typing import NamedTuple

import msgspec

from zteam import names
from zteam.clock import to_ns, to_seconds
from zteam.errors import short
from zteam.messages import RobotState, RobotStatus, ns_from_time

SILENT_AFTER = 3.0
"""Host seconds without a status (they come at 1 Hz) after which a robot with a living token does not answer. One whose
time stood still for as long gets no data."""
_WALL = to_ns(1e8)
"""Stamps beyond are of the host's clock, and no time of a run."""


_WHILE = 10.0
"""Host seconds within which events of one kind are counted."""
_MOST_EVENTS = 8
"""Of one kind and robot that are shown within a while."""
_MOST_OF_STRANGERS = 16
"""As many of all robots that do not count."""
_STRANGER = -1
_MOST_LOST = 64
"""Robots that do not count and are gone are remembered up to this number."""


class Event(NamedTuple):
    """Something to tell: `robot` is None for the team as a whole."""

    kind: str
    robot: int | None
    text: str

    @property
    def sentence(self) -> str:
        return self.text if self.robot is None else f"{names.robot_name(self.robot)} {self.text}"


class EventLimit:
    """Which events are shown. Any process can make events, with forged statuses and names of robots that it invents.

    Of one kind and robot a few are shown within a while. Robots that do not count share theirs.
    """

    def __init__(self) -> None:
        self._made = Counter[tuple[str, int | None]]()
        """By kind and robot, within the while that ends at host time `_until`."""
        self._until = 0.0

    def admit(self, event: Event, counts: bool, now: float) -> Event | None:
        """The event as it is shown at host time `now`; None if it is left out. `counts` is whether its robot does."""
        known = event.robot is None or counts
        key, most = (event.kind, event.robot if known else _STRANGER), _MOST_EVENTS if known else _MOST_OF_STRANGERS
        if now >= self._until:
            self._made.clear()
            self._until = now + _WHILE
        self._made[key] += 1
        if self._made[key] == most:
            return event._replace(text=f"{event.text} (further lines of this kind are left out for {_WHILE:g} s)")
        return event if self._made[key] < most else None


class KnownRobot(msgspec.Struct):
    """What is known of one robot."""

    alive: bool = False
    """Whether a process holds the robot's name."""
    status: RobotStatus | None = None
    heard: float = 0.0
    """Host time of the last status."""
    moved: float = 0.0
    """Host time of the last status with another stamp than the one before."""
    was_ready: bool = False
    was_lost: bool = False
    told_go: bool = False
    came_late: bool = False
    """Whether its process came after GO."""
    silent: bool = False
    stopped: bool = False
    """Whether it said that it stops before it went."""
    absence: str = ""
    """That the world lacks it, in words; empty while nothing is known of that."""

    @property
    def ready(self) -> bool:
        """Whether it lives, answers and says it is ready."""
        return self.alive and not self.silent and self.status is not None and self.status.is_ready

    @property
    def obeyed(self) -> int:
        """The epoch of the GO that its live process obeys, 0 for none."""
        status = self.status if self.alive else None
        return status.epoch if status is not None and status.state == RobotState.RUNNING else 0

    @property
    def why_not_ready(self) -> str:
        if self.absence:
            return self.absence
        if not self.alive:
            return "its process is gone" if self.was_lost else "no process yet"
        if self.silent:
            return "does not answer"
        if self.status is None:
            return "no status yet"
        text = short(self.status.text) or "not ready yet"
        return f"fault: {text}" if self.status.state == RobotState.FAULT else text


class WatchedTeam:
    """Base: all robots that had a process or are waited for, and the events to tell. The caller holds a lock."""

    def __init__(self) -> None:
        self.gone = False
        """Whether GO is out."""
        self.epoch = 0
        """Of the standing GO."""
        self.members: dict[int, KnownRobot] = {}
        """By the robot's id."""
        self._events: list[Event] = []
        self._tick = -1
        """Of the simulator, when it was asked last."""
        self._ticked = 0.0
        """Host time at which the simulator was last seen at another tick."""

    def counts(self, robot_id: int) -> bool:
        """Whether GO waits for this robot, or has."""
        raise NotImplementedError

    def take_tick(self, tick: int, now: float) -> None:
        """The simulator is at this tick at host time `now`. Where time goes on, its robots get data."""
        if tick != self._tick:
            self._tick, self._ticked = tick, now

    def ticks(self, now: float) -> bool:
        """Whether the simulator was seen at another tick of late."""
        return now - self._ticked <= SILENT_AFTER

    def lack_of_data(self, member: KnownRobot, now: float) -> str:
        """That a robot which drives gets no data any more, in words; empty while it does."""
        status = member.status
        if status is None or status.state != RobotState.RUNNING:
            return ""
        quiet = now - member.moved
        if quiet <= SILENT_AFTER or self.ticks(now):
            return ""
        stamp = ns_from_time(status.header.stamp)
        return f"no data since {to_seconds(stamp):.1f} s" if stamp < _WALL else f"no data for {quiet:.0f} s"

    def get(self, robot_id: int) -> KnownRobot:
        """The robot's member, which is made at its first mention."""
        return self.members.setdefault(robot_id, KnownRobot())

    def tell(self, kind: str, robot: int | None, text: str) -> None:
        self._events.append(Event(kind, robot, short(text)))

    @property
    def has_events(self) -> bool:
        return bool(self._events)

    def take_events(self) -> list[Event]:
        events, self._events = self._events, []
        return events

    @property
    def lost(self) -> list[int]:
        """Ids of robots that were there and are gone."""
        return sorted(i for i, member in self.members.items() if member.was_lost)

    def take_token(self, robot_id: int, alive: bool) -> None:
        """A process took the name `robot_N`, or its last holder lost it."""
        member = self.get(robot_id)
        if member.alive == alive:
            return
        member.alive = alive
        if not alive:
            self._lose(robot_id, member)
            return
        member.came_late = self.gone
        if member.was_lost:
            member.was_lost = member.told_go = False
            self.tell("back", robot_id, "is back")

    def _lose(self, robot_id: int, member: KnownRobot) -> None:
        member.stopped = member.status is not None and member.status.state == RobotState.STOPPED
        # A process that comes later under this name speaks for itself.
        member.status = None
        member.was_ready = member.silent = False
        member.was_lost = True
        kind = "stopped" if member.stopped else "lost"
        self.tell(kind, robot_id, kind)
        if not self.counts(robot_id) and sum(not self.counts(i) for i in self.lost) > _MOST_LOST:
            del self.members[robot_id]

    def take_status(self, robot_id: int, status: RobotStatus, now: float) -> bool:
        """A robot's status, heard at host time `now` on its own key; False if it speaks for another robot."""
        if status.robot_id != robot_id:
            return False
        member = self.get(robot_id)
        before, member.status, member.heard = member.status, status, now
        if before is None or before.header.stamp != status.header.stamp:
            member.moved = now
        if member.silent:
            member.silent = False
            self.tell("answers", robot_id, "answers again")
        if status.state == RobotState.FAULT and (before is None or before.state != RobotState.FAULT):
            self.tell("fault", robot_id, f"fault: {status.text}")
        return True

    def forgive_silence(self, now: float) -> None:
        """Nothing could be heard until `now`: silence counts from here on."""
        for member in self.members.values():
            member.heard = now

    def _falling_silent(self, now: float) -> dict[int, KnownRobot]:
        return {
            robot_id: member
            for robot_id, member in self.members.items()
            if member.status is not None and member.alive and not member.silent and now - member.heard > SILENT_AFTER
        }

    def has_silent(self, now: float) -> bool:
        """Whether `check_silence` has something to tell."""
        return bool(self._falling_silent(now))

    def check_silence(self, now: float) -> None:
        """Tell of robots that live and send no further status."""
        for robot_id, member in self._falling_silent(now).items():
            member.silent = True
            member.was_ready = False
            self.tell("silent", robot_id, f"does not answer for {now - member.heard:.0f} s")
