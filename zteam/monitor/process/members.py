"""The robots that the monitor knows, without a bus: their processes, their statuses, and what happened to them."""

from collections import Counter
from typing import NamedTuple

import msgspec

from zteam import names
from zteam.errors import short
from zteam.messages import RobotState, RobotStatus

SILENT_AFTER = 3.0
"""Host seconds without a status (they come at 1 Hz) after which a robot with a living token does not answer. One whose
time stood still for as long gets no data."""
_WHILE = 10.0
"""Host seconds within which events of one kind are counted."""
_MOST_EVENTS = 8
"""Of one kind and robot that are shown within a while."""
_MOST_OF_STRANGERS = 16
"""As many of all robots that do not count."""


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
        key, most = (event.kind, event.robot if known else -1), _MOST_EVENTS if known else _MOST_OF_STRANGERS
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

    def falls_silent(self, now: float) -> bool:
        """Whether it lives and sends no further status."""
        return self.status is not None and self.alive and not self.silent and now - self.heard > SILENT_AFTER

    def lack_of_data(self, now: float, *, ticks: bool) -> str:
        """That it drives and gets no data any more, in words; empty while it does. `ticks`: the simulator does."""
        status, quiet = self.status, now - self.moved
        if status is None or status.state != RobotState.RUNNING or quiet <= SILENT_AFTER or ticks:
            return ""
        return f"no data for {quiet:.0f} s"
